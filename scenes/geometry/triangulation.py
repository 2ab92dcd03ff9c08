"""Triangles that fill a polygon: ear clipping."""

import numpy as np
from numpy.typing import NDArray


def polygon_triangles(outline: NDArray[np.float64]) -> NDArray[np.int64]:
    """Triangulate a polygon by ear clipping.

    Args:
        outline: Simple counter-clockwise polygon (N, 2).

    Returns:
        Corner indices (N - 2, 3).
    """
    left = list(range(len(outline)))
    triangles = []
    while len(left) > 3:
        ear = next((i for i in range(len(left)) if _is_ear(outline, left, i)), 0)
        triangles.append((left[ear - 1], left[ear], left[(ear + 1) % len(left)]))
        del left[ear]
    return np.array([*triangles, left], dtype=np.int64)


def _is_ear(outline: NDArray[np.float64], left: list[int], i: int) -> bool:
    """Return whether corner `i` of the remaining polygon can be cut off."""
    before, own, after = left[i - 1], left[i], left[(i + 1) % len(left)]
    corners = outline[[before, own, after]]
    edges = np.roll(corners, -1, axis=0) - corners
    if edges[0, 0] * edges[1, 1] - edges[0, 1] * edges[1, 0] <= 1e-12:
        return False
    others = outline[[j for j in left if j not in (before, own, after)]]
    away = others[:, None] - corners  # (M, 3, 2)
    side = edges[:, 0] * away[..., 1] - edges[:, 1] * away[..., 0]
    return not bool(np.any(np.all(side >= 0, axis=1)))
