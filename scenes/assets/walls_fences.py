"""Garden walls and fences along a line: pillars and copings, posts and boards, rails and bars.

They stand on z = 0. Repeated parts are computed as arrays, so that long fences are cheap to make.
"""

from typing import Literal

import numpy as np
from numpy.typing import NDArray

from echoscape.scenes.core.scene import Mesh
from echoscape.scenes.geometry.meshes import quads

FenceKind = Literal["boards", "railing", "chain_link"]

_PILLAR_M = 3.2
_POST_M = 2.4


def wall(polyline: NDArray[np.float64], *, height_m: float, thickness_m: float) -> Mesh:
    """Make a wall with an overhanging coping and pillars about 3.2 m apart.

    Args:
        polyline: Line along which it stands (P, 2) [m].
        height_m: Height [m].
        thickness_m: Thickness [m].

    Returns:
        The mesh.

    Raises:
        ValueError: `polyline` has fewer than two points or the wrong shape.
    """
    origin, forward, length = _segments(polyline)
    half = 0.5 * thickness_m
    zero = np.zeros_like(length)
    body = _boxes((zero, zero - half, zero), (length, zero + half, zero + height_m - 0.08))
    coping = _boxes(
        (zero - 0.03, zero - half - 0.04, zero + height_m - 0.08),
        (length + 0.03, zero + half + 0.04, zero + height_m),
    )
    row, place = _spread(length, _PILLAR_M)
    wide, level = half + 0.06, np.zeros_like(place)
    pillars = _boxes(
        (place - wide, level - wide, level), (place + wide, level + wide, level + height_m + 0.07)
    )
    parts = [_placed(part, origin, forward) for part in (body, coping)]
    return quads(np.concatenate([*parts, _placed(pillars, origin[row], forward[row])]))


def fence(polyline: NDArray[np.float64], *, height_m: float, kind: FenceKind) -> dict[str, Mesh]:
    """Make a fence.

    Args:
        polyline: Line along which it stands (P, 2) [m].
        height_m: Height [m].
        kind: "boards": wooden posts and rails with boards alternately in front of and behind the rails;
            "railing": metal posts, two rails and a bar every 0.4 m; "chain_link": metal posts and three wires
            as thin rails.

    Returns:
        Its mesh by name of the material.

    Raises:
        ValueError: `polyline` has fewer than two points or the wrong shape.
    """
    origin, forward, length = _segments(polyline)
    row, place = _spread(length, _POST_M)
    thick = 0.05 if kind == "boards" else 0.03
    level = np.zeros_like(place)
    posts = _boxes(
        (place - thick, level - thick, level), (place + thick, level + thick, level + height_m + 0.05)
    )
    made = [_placed(posts, origin[row], forward[row])]
    for share in _RAILS[kind]:
        zero, high = np.zeros_like(length), share * height_m
        size = _RAIL_M[kind]
        rail = _boxes((zero, zero - 0.5 * size, zero + high - size), (length, zero + 0.5 * size, zero + high))
        made.append(_placed(rail, origin, forward))
    if kind != "chain_link":
        made.append(_infill(origin, forward, length, height_m=height_m, kind=kind))
    return {"wood" if kind == "boards" else "metal": quads(np.concatenate(made))}


_RAILS: dict[FenceKind, tuple[float, ...]] = {
    "boards": (0.25, 0.85),
    "railing": (0.15, 0.95),
    "chain_link": (0.05, 0.5, 1.0),
}
_RAIL_M: dict[FenceKind, float] = {"boards": 0.04, "railing": 0.04, "chain_link": 0.012}


def _infill(
    origin: NDArray[np.float64],
    forward: NDArray[np.float64],
    length: NDArray[np.float64],
    *,
    height_m: float,
    kind: FenceKind,
) -> NDArray[np.float64]:
    """Return the boards or bars (Q, 4, 3)."""
    pitch = 0.3 if kind == "boards" else 0.4
    row, place = _spread(length, pitch, inner=True)
    level = np.zeros_like(place)
    if kind == "boards":
        side = np.where(np.arange(len(place)) % 2 == 0, 0.035, -0.035)
        half, deep, low = 0.47 * pitch, 0.01, 0.04
    else:
        side, half, deep, low = level, 0.01, 0.01, 0.15 * height_m - 0.04
    bars = _boxes((place - half, side - deep, level + low), (place + half, side + deep, level + height_m))
    return _placed(bars, origin[row], forward[row])


def _segments(
    polyline: NDArray[np.float64],
) -> tuple[NDArray[np.float64], NDArray[np.float64], NDArray[np.float64]]:
    """Return origins (S, 2), unit directions (S, 2) and lengths (S,) of the segments of a line."""
    points = np.asarray(polyline, dtype=np.float64)
    if points.ndim != 2 or points.shape[0] < 2 or points.shape[1] != 2:
        raise ValueError(f"polyline must be (P >= 2, 2), got {points.shape}")
    step = np.diff(points, axis=0)
    length = np.hypot(step[:, 0], step[:, 1])
    keep = length > 1e-3
    return points[:-1][keep], step[keep] / length[keep, None], length[keep]


def _spread(
    length: NDArray[np.float64], pitch_m: float, *, inner: bool = False
) -> tuple[NDArray[np.int64], NDArray[np.float64]]:
    """Return segment indices (N,) and distances along them (N,) [m]; `inner` leaves out the ends."""
    count = np.maximum(1, np.round(length / pitch_m).astype(int))
    rows, places = [], []
    for row, (span, parts) in enumerate(zip(length.tolist(), count.tolist(), strict=True)):
        at = (np.arange(parts) + 0.5) * span / parts if inner else np.linspace(0.0, span, parts + 1)
        rows.append(np.full(len(at), row))
        places.append(at)
    return np.concatenate(rows), np.concatenate(places)


def _boxes(
    low: tuple[NDArray[np.float64], NDArray[np.float64], NDArray[np.float64]],
    high: tuple[NDArray[np.float64], NDArray[np.float64], NDArray[np.float64]],
) -> NDArray[np.float64]:
    """Return quads (N, 5, 4, 3) of boxes between `low` and `high` (along, left, up), open at the bottom."""
    ends = np.stack([np.stack(low, axis=1), np.stack(high, axis=1)], axis=1)  # (N, 2, 3)
    return ends[:, _PICK, np.arange(3)]


_PICK = np.array(
    [
        [[0, 0, 1], [1, 0, 1], [1, 1, 1], [0, 1, 1]],
        [[0, 0, 0], [1, 0, 0], [1, 0, 1], [0, 0, 1]],
        [[1, 1, 0], [0, 1, 0], [0, 1, 1], [1, 1, 1]],
        [[0, 1, 0], [0, 0, 0], [0, 0, 1], [0, 1, 1]],
        [[1, 0, 0], [1, 1, 0], [1, 1, 1], [1, 0, 1]],
    ]
)
"""End of the box (0 low, 1 high) of each corner on each axis: top, right, left, back and front faces."""


def _placed(
    local: NDArray[np.float64], origin: NDArray[np.float64], forward: NDArray[np.float64]
) -> NDArray[np.float64]:
    """Return world corners (N * 5, 4, 3) of `local` (N, 5, 4, 3), each box on its segment."""
    left = forward[:, ::-1] * [-1.0, 1.0]
    flat = (
        origin[:, None, None]
        + local[..., :1] * forward[:, None, None]
        + local[..., 1:2] * left[:, None, None]
    )
    return np.concatenate([flat, local[..., 2:]], axis=-1).reshape(-1, 4, 3)
