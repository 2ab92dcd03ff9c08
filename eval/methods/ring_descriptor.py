"""Descriptors of keypoints that do not change as the car turns: how many others lie in each ring around one.

Source: Cen & Newman, "Radar-only ego-motion estimation in difficult settings via graph matching", ICRA 2019,
the annular part of its unary descriptors. Histograms are compared by the Hellinger kernel, as Arandjelović &
Zisserman, "Three things everyone should know to improve object retrieval", CVPR 2012, do.
"""

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.spatial.distance import cdist


@dataclass(frozen=True, kw_only=True)
class RingSettings:
    """The rings around a keypoint."""

    width_m: float = 0.5
    """Width of a ring [m]."""
    reach_m: float = 165.0
    """Distance from a keypoint up to which others count [m]."""

    def __post_init__(self) -> None:
        if not 0 < self.width_m < math.inf:
            raise ValueError(f"width_m must be finite and above 0, got {self.width_m}")
        if not self.width_m <= self.reach_m < math.inf:
            raise ValueError(f"reach_m must be finite and width_m or more, got {self.reach_m}")


def ring_descriptors(
    points_m: NDArray[np.floating], settings: RingSettings | None = None
) -> NDArray[np.float64]:
    """Describe keypoints by the distances of all others.

    Args:
        points_m: Keypoints (N, 2) [m].
        settings: The rings; None for the default.

    Returns:
        Square roots of the shares of the others in each ring (N, rings) float64: of unit length, or 0 where
        none is within reach.
    """
    settings = settings or RingSettings()
    rings = math.floor(settings.reach_m / settings.width_m)
    count = len(points_m)
    ring = np.floor(cdist(points_m, points_m) / settings.width_m).astype(np.int64)
    np.fill_diagonal(ring, rings)
    flat = np.minimum(ring, rings) + np.arange(count)[:, None] * (rings + 1)
    others = np.bincount(flat.ravel(), minlength=count * (rings + 1)).reshape(count, rings + 1)[:, :rings]
    return np.sqrt(others / np.maximum(others.sum(axis=1, keepdims=True), 1))
