"""Rigid motion between matched points in the plane: least squares, and RANSAC against wrong matches.

Sources: Umeyama, "Least-squares estimation of transformation parameters between two point patterns", IEEE
TPAMI 1991, in the plane and without scale; Fischler & Bolles, "Random sample consensus", CACM 1981.
"""

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from echoscape.sim.datasets.se2 import SE2, transform


@dataclass(frozen=True, kw_only=True)
class RansacSettings:
    """How a motion is searched among wrong matches: as in Burnett et al., RA-L 2021."""

    inlier_m: float = 0.35
    """Distance up to which a match agrees with a motion [m]."""
    samples: int = 100
    """Motions that are tried, each from two matches."""

    def __post_init__(self) -> None:
        if not 0 < self.inlier_m < math.inf:
            raise ValueError(f"inlier_m must be finite and above 0, got {self.inlier_m}")
        if self.samples < 1:
            raise ValueError(f"samples must be 1 or more, got {self.samples}")


def fit_motions(earlier_m: NDArray[np.floating], later_m: NDArray[np.floating]) -> NDArray[np.float64]:
    """Compute the motions that move points onto points with the least sum of squares.

    Args:
        earlier_m: Points (..., K, 2) in the earlier frames: forward, right [m].
        later_m: The same points (..., K, 2) in the later frames [m].

    Returns:
        T_earlier_later (..., 3): x, y [m], yaw [rad]; yaw is 0 where all points are in one place.
    """
    earlier_mean, later_mean = earlier_m.mean(axis=-2), later_m.mean(axis=-2)
    a, b = earlier_m - earlier_mean[..., None, :], later_m - later_mean[..., None, :]
    cosine = (a * b).sum(axis=(-2, -1))
    sine = (b[..., 0] * a[..., 1] - b[..., 1] * a[..., 0]).sum(axis=-1)
    rotation = np.stack([np.zeros_like(sine), np.zeros_like(sine), np.arctan2(sine, cosine)], axis=-1)
    translation = earlier_mean - transform(rotation, later_mean)
    return np.concatenate([translation, rotation[..., 2:]], axis=-1)


def distances(
    motions: NDArray[np.floating], earlier_m: NDArray[np.floating], later_m: NDArray[np.floating]
) -> NDArray[np.float64]:
    """Compute how far motions leave later points from their matches.

    Args:
        motions: T_earlier_later (..., 3).
        earlier_m: Points (K, 2) in the earlier frame [m].
        later_m: Points (K, 2) in the later frame [m].

    Returns:
        Distances (..., K) [m].
    """
    return np.linalg.norm(transform(motions[..., None, :], later_m) - earlier_m, axis=-1)


def ransac_motion(
    earlier_m: NDArray[np.floating],
    later_m: NDArray[np.floating],
    settings: RansacSettings | None = None,
    *,
    rng: np.random.Generator,
) -> tuple[SE2, NDArray[np.bool_]]:
    """Find the motion that most matches agree with, then fit it to these.

    Args:
        earlier_m: Points (K, 2) in the earlier frame: forward, right [m].
        later_m: Points (K, 2) in the later frame [m].
        settings: Thresholds; None for the published ones.
        rng: Draws the samples.

    Returns:
        T_earlier_later, and which matches agree with the best sample (K,): the motion is fitted to these.

    Raises:
        ValueError: There are fewer than two matches.
    """
    if len(earlier_m) < 2:
        raise ValueError(f"a motion needs two matches or more, got {len(earlier_m)}")
    settings = settings or RansacSettings()
    first = rng.integers(len(earlier_m), size=settings.samples)
    second = (first + rng.integers(1, len(earlier_m), size=settings.samples)) % len(earlier_m)
    sample = np.stack([first, second], axis=1)
    motions = fit_motions(earlier_m[sample], later_m[sample])
    agree = distances(motions, earlier_m, later_m) < settings.inlier_m
    inliers = agree[int(np.argmax(agree.sum(axis=1)))]
    if not inliers.any():  # both matches of every sample disagree about their distance
        return SE2.from_array(motions[0]), inliers
    return SE2.from_array(fit_motions(earlier_m[inliers], later_m[inliers])), inliers
