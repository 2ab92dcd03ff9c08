"""Drift of a trajectory as the KITTI benchmark measures it: errors of segments of 100 to 800 m by length.

Source: the KITTI odometry devkit, `evaluate_odometry.cpp` (Geiger et al., CVPR 2012). A segment ends at the
first frame whose true path length from the segment's start exceeds its nominal length, by which its error is
divided; all segments have equal weight. The devkit sums path lengths in single precision, here it is double.
"""

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray

from echoscape.eval.odometry.trajectory_io import matrices

LENGTHS_M = (100.0, 200.0, 300.0, 400.0, 500.0, 600.0, 700.0, 800.0)
"""Nominal lengths of segments [m]."""
KITTI_STEP = 10
"""Frames from the start of one segment to the next in the devkit: one second at 10 Hz."""
RADAR_STEP = 4
"""The same for a radar with four scans a second."""


@dataclass(frozen=True, kw_only=True)
class SegmentErrors:
    """Errors of S segments.

    Attributes:
        length_m: Nominal length (S,) [m].
        translation: Error of the end's position over the length (S,) [m/m].
        rotation: Error of the end's heading over the length (S,) [rad/m].
    """

    length_m: NDArray[np.float64]
    translation: NDArray[np.float64]
    rotation: NDArray[np.float64]


@dataclass(frozen=True, kw_only=True)
class Drift:
    """Drift of a trajectory.

    Attributes:
        translation_percent: Mean translation error over length [%], None without a segment.
        rotation_deg_per_m: Mean rotation error over length [deg/m], None without a segment.
        segments: Number of segments.
        by_length: Length [m], translation [%], rotation [deg/m] and number of segments, by length.
    """

    translation_percent: float | None
    rotation_deg_per_m: float | None
    segments: int
    by_length: tuple[tuple[float, float, float, int], ...] = ()

    def as_dict(self) -> dict[str, object]:
        """Return the values by name, ready for JSON."""
        names = ("length_m", "translation_percent", "rotation_deg_per_m", "segments")
        return {
            "translation_percent": self.translation_percent,
            "rotation_deg_per_m": self.rotation_deg_per_m,
            "segments": self.segments,
            "by_length": [dict(zip(names, row, strict=True)) for row in self.by_length],
        }


def kitti_drift(estimate: ArrayLike, truth: ArrayLike, *, step: int = KITTI_STEP) -> Drift:
    """Compute the drift of a trajectory.

    Args:
        estimate: Estimated poses: planar (N, 3), x, y [m], yaw [rad], or matrices (N, 4, 4).
        truth: True poses of the same frames, in either form.
        step: Frames from the start of one segment to the next.

    Returns:
        The drift.

    Raises:
        ValueError: The trajectories differ in length, are no poses or not finite, or `step` is below 1.
    """
    return mean_drift(segment_errors(estimate, truth, step=step))


def segment_errors(estimate: ArrayLike, truth: ArrayLike, *, step: int = KITTI_STEP) -> SegmentErrors:
    """Compute the errors of all segments of `LENGTHS_M` that start at every `step`-th frame.

    E = (Q_a^-1 Q_b)^-1 (P_a^-1 P_b) with P true and Q estimated poses, a the first and b the last frame; the
    norm of its translation is the translation error, arccos((trace R - 1) / 2) the rotation error.

    Args:
        estimate: Estimated poses, as for `kitti_drift`.
        truth: True poses, as for `kitti_drift`.
        step: Frames from the start of one segment to the next.

    Returns:
        The errors.

    Raises:
        ValueError: As for `kitti_drift`.
    """
    found, true = _poses("estimate", estimate), _poses("truth", truth)
    if len(found) != len(true):
        raise ValueError(f"estimate must have as many poses as truth, {len(true)}, got {len(found)}")
    if step < 1:
        raise ValueError(f"step must be 1 or more, got {step}")
    path_m = np.append(0.0, np.cumsum(np.linalg.norm(np.diff(true[:, :3, 3], axis=0), axis=1)))[: len(true)]
    starts = np.arange(0, len(true), step)
    first = np.repeat(starts, len(LENGTHS_M))
    length = np.tile(np.array(LENGTHS_M, np.float64), len(starts))
    last = np.searchsorted(path_m, path_m[first] + length, side="right")
    reached = last < len(true)
    first, last, length = first[reached], last[reached], length[reached]
    error = np.linalg.inv(_relative(found, first, last)) @ _relative(true, first, last)
    cosine = (np.trace(error[:, :3, :3], axis1=1, axis2=2) - 1) / 2
    return SegmentErrors(
        length_m=length,
        translation=np.linalg.norm(error[:, :3, 3], axis=1) / length,
        rotation=np.arccos(np.clip(cosine, -1.0, 1.0)) / length,
    )


def concatenated(parts: list[SegmentErrors]) -> SegmentErrors:
    """Join the segments of several trajectories.

    Args:
        parts: Errors of each trajectory.

    Returns:
        All of them.
    """
    empty = np.zeros(0)
    return SegmentErrors(
        length_m=np.concatenate([empty, *(each.length_m for each in parts)]),
        translation=np.concatenate([empty, *(each.translation for each in parts)]),
        rotation=np.concatenate([empty, *(each.rotation for each in parts)]),
    )


def mean_drift(errors: SegmentErrors) -> Drift:
    """Average the errors of segments, over all of them and by length.

    Args:
        errors: The errors.

    Returns:
        The drift.
    """
    count = len(errors.length_m)
    if count == 0:
        return Drift(translation_percent=None, rotation_deg_per_m=None, segments=0)
    percent, degrees = 100 * errors.translation, np.degrees(errors.rotation)
    rows = []
    for length_m in LENGTHS_M:
        chosen = errors.length_m == length_m
        if chosen.any():
            means = float(percent[chosen].mean()), float(degrees[chosen].mean())
            rows.append((length_m, *means, int(chosen.sum())))
    return Drift(
        translation_percent=float(percent.mean()),
        rotation_deg_per_m=float(degrees.mean()),
        segments=count,
        by_length=tuple(rows),
    )


def _relative(poses: NDArray[np.float64], first: NDArray, last: NDArray) -> NDArray[np.float64]:
    """Return T_first_last (S, 4, 4)."""
    return np.linalg.inv(poses[first]) @ poses[last]


def _poses(name: str, values: ArrayLike) -> NDArray[np.float64]:
    """Return poses as matrices (N, 4, 4), or raise ValueError that names the argument."""
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
