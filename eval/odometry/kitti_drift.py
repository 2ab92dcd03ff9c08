"""Drift of a trajectory as the KITTI benchmark counts it: error of segments of 100 to 800 m by length.

Source: the KITTI odometry devkit, `evaluate_odometry.cpp` (Geiger et al., CVPR 2012). A segment ends at the
first frame whose true way from the segment's start exceeds its nominal length, by which its error is divided;
all segments count alike. The devkit adds the way up in single precision, here it is double.
"""

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray

from echoscape.eval.odometry.trajectory_io import matrices

LENGTHS_M = (100.0, 200.0, 300.0, 400.0, 500.0, 600.0, 700.0, 800.0)
KITTI_STEP = 10
"""Frames from one segment's start to the next: the devkit's, once a second at 10 Hz."""
RADAR_STEP = 4
"""The same for a radar that turns four times a second."""


@dataclass(frozen=True, kw_only=True)
class Segments:
    """Errors of S segments.

    length_m (S,): nominal; translation (S,): of the end's place, over the length [m/m]; rotation (S,): of the
    end's heading, over the length [rad/m].
    """

    length_m: NDArray[np.float64]
    translation: NDArray[np.float64]
    rotation: NDArray[np.float64]


@dataclass(frozen=True, kw_only=True)
class Drift:
    """Drift of a trajectory; None where it has no segment.

    translation_percent: mean translation error over length [%]; rotation_deg_per_m: mean rotation error over
    length [deg/m]; segments: how many; by_length: length [m], translation [%], rotation [deg/m], segments.
    """

    translation_percent: float | None
    rotation_deg_per_m: float | None
    segments: int
    by_length: tuple[tuple[float, float, float, int], ...] = ()

    def content(self) -> dict[str, object]:
        """Return the figures by name, ready for JSON."""
        names = ("length_m", "translation_percent", "rotation_deg_per_m", "segments")
        return {
            "translation_percent": self.translation_percent,
            "rotation_deg_per_m": self.rotation_deg_per_m,
            "segments": self.segments,
            "by_length": [dict(zip(names, row, strict=True)) for row in self.by_length],
        }


def drift(estimate: ArrayLike, truth: ArrayLike, *, step: int = KITTI_STEP) -> Drift:
    """Return the drift of `estimate` against `truth`, each (N, 3) planar poses or (N, 4, 4) matrices.

    Raises:
        ValueError: they differ in length, are no poses or not finite, or `step` is below 1.
    """
    return drift_of_segments(segments(estimate, truth, step=step))


def segments(estimate: ArrayLike, truth: ArrayLike, *, step: int = KITTI_STEP) -> Segments:
    """Return the errors of every segment of `LENGTHS_M` that starts at every `step`-th frame.

    E = (Q_a^-1 Q_b)^-1 (P_a^-1 P_b) with P true and Q estimated poses, a the first and b the last frame; its
    shift is the translation error, arccos((trace R - 1) / 2) the rotation error.

    Raises:
        ValueError: as for `drift`.
    """
    found, true = _poses("estimate", estimate), _poses("truth", truth)
    if len(found) != len(true):
        raise ValueError(f"estimate must have as many poses as truth, {len(true)}, got {len(found)}")
    if step < 1:
        raise ValueError(f"step must be 1 or more, got {step}")
    way_m = np.append(0.0, np.cumsum(np.linalg.norm(np.diff(true[:, :3, 3], axis=0), axis=1)))[: len(true)]
    starts = np.arange(0, len(true), step)
    first = np.repeat(starts, len(LENGTHS_M))
    length = np.tile(np.array(LENGTHS_M, np.float64), len(starts))
    last = np.searchsorted(way_m, way_m[first] + length, side="right")
    reached = last < len(true)
    first, last, length = first[reached], last[reached], length[reached]
    error = np.linalg.inv(_moved(found, first, last)) @ _moved(true, first, last)
    cosine = (np.trace(error[:, :3, :3], axis1=1, axis2=2) - 1) / 2
    return Segments(
        length_m=length,
        translation=np.linalg.norm(error[:, :3, 3], axis=1) / length,
        rotation=np.arccos(np.clip(cosine, -1.0, 1.0)) / length,
    )


def joined(parts: list[Segments]) -> Segments:
    """Return the segments of several stretches as one."""
    empty = np.zeros(0)
    return Segments(
        length_m=np.concatenate([empty, *(each.length_m for each in parts)]),
        translation=np.concatenate([empty, *(each.translation for each in parts)]),
        rotation=np.concatenate([empty, *(each.rotation for each in parts)]),
    )


def drift_of_segments(errors: Segments) -> Drift:
    """Return the means over all segments, and over those of each length."""
    count = len(errors.length_m)
    if count == 0:
        return Drift(translation_percent=None, rotation_deg_per_m=None, segments=0)
    percent, degrees = 100 * errors.translation, np.degrees(errors.rotation)
    rows = []
    for length_m in LENGTHS_M:
        of_it = errors.length_m == length_m
        if of_it.any():
            means = float(percent[of_it].mean()), float(degrees[of_it].mean())
            rows.append((length_m, *means, int(of_it.sum())))
    return Drift(
        translation_percent=float(percent.mean()),
        rotation_deg_per_m=float(degrees.mean()),
        segments=count,
        by_length=tuple(rows),
    )


def _moved(poses: NDArray[np.float64], first: NDArray, last: NDArray) -> NDArray[np.float64]:
    """Return T_first_last (S, 4, 4)."""
    return np.linalg.inv(poses[first]) @ poses[last]


def _poses(name: str, values: ArrayLike) -> NDArray[np.float64]:
    """Return poses as matrices (N, 4, 4).

    Raises:
        ValueError: they are none; the message names the argument.
    """
    poses = np.asarray(values, np.float64)
    if poses.ndim == 2 and poses.shape[1] == 3:
        poses = matrices(poses)
    if poses.ndim != 3 or poses.shape[1:] != (4, 4) or len(poses) == 0:
        raise ValueError(f"{name} must be poses (N, 3) or (N, 4, 4), got shape {np.shape(values)}")
    if not np.isfinite(poses).all():
        raise ValueError(
            f"{name} must be finite; pose {int(np.argmin(np.isfinite(poses).all((1, 2))))} is not"
        )
    return poses
