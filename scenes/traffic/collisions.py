"""Finds moving boxes that overlap, to ensure that no vehicle or person passes through another.

Oriented boxes on the ground, tested by separating axes (Gottschalk et al., OBBTree, SIGGRAPH 1996, in the
plane).
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from echoscape.scenes.core.scene import HasPose, Mover

_COARSE_S = 1.0
_FINE_ROWS = 200_000
EGO = -1


@dataclass(frozen=True, kw_only=True)
class Overlaps:
    """Samples at which two boxes overlap.

    Attributes:
        time_s: Time of each sample (N,) [s].
        first: Index of one mover (N,), -1 for the ego vehicle.
        second: Index of the other mover (N,).
    """

    time_s: NDArray[np.float64]
    first: NDArray[np.intp]
    second: NDArray[np.intp]

    def __len__(self) -> int:
        """Return the number of samples."""
        return len(self.time_s)


def overlaps(
    ego: HasPose,
    movers: Sequence[Mover],
    *,
    ego_extent_m: tuple[float, float, float],
    duration_s: float,
    step_s: float = 0.1,
) -> Overlaps:
    """Find all overlaps between the boxes of the ego vehicle and the movers.

    Args:
        ego: Pose of the ego vehicle over time.
        movers: The movers.
        ego_extent_m: Length, width and height of the ego vehicle [m].
        duration_s: End of the time that is searched, which starts at 0 [s].
        step_s: Time between samples [s].

    Returns:
        The overlaps.
    """
    tracks: list[HasPose] = [ego, *(mover.track for mover in movers)]
    extent = np.array([ego_extent_m, *(mover.prototype.extent_m for mover in movers)])[:, :2]
    time, first, second = _near(tracks, extent, duration_s=duration_s, step_s=step_s)
    touch = np.zeros(len(time), dtype=bool)
    for begin in range(0, len(time), _FINE_ROWS):
        rows = slice(begin, begin + _FINE_ROWS)
        touch[rows] = boxes_touch(
            _poses_of(tracks, first[rows], time[rows]),
            extent[first[rows]],
            _poses_of(tracks, second[rows], time[rows]),
            extent[second[rows]],
        )
    return Overlaps(time_s=time[touch], first=first[touch] - 1, second=second[touch] - 1)


def _near(
    tracks: Sequence[HasPose], extent: NDArray[np.float64], *, duration_s: float, step_s: float
) -> tuple[NDArray[np.float64], NDArray[np.intp], NDArray[np.intp]]:
    """Return times and pairs of indices around the coarse times at which two boxes may overlap."""
    per_coarse = max(round(_COARSE_S / step_s), 1)
    coarse = step_s * per_coarse * np.arange(int(duration_s / (step_s * per_coarse)) + 2, dtype=np.float64)
    xy = np.stack([track.pose(coarse)[:, :2] for track in tracks], axis=1)  # (C, M, 2)
    moved = np.linalg.norm(np.diff(xy, axis=0), axis=-1).max(axis=0, initial=0.0)
    reach = np.hypot(*extent.T) / 2 + 1.5 * moved + 1.0
    rows = []
    for i in range(len(tracks) - 1):
        gap = np.abs(xy[:, i + 1 :] - xy[:, i : i + 1]).max(axis=-1)
        at, other = np.nonzero(gap < reach[i] + reach[i + 1 :])
        rows.append(np.stack([at, np.full_like(at, i), other + i + 1], axis=-1))
    near = np.concatenate(rows) if rows else np.zeros((0, 3), dtype=np.intp)
    fine = step_s * (np.arange(per_coarse) - per_coarse // 2)
    time = (coarse[near[:, 0], None] + fine).ravel()
    first, second = (np.repeat(near[:, column], per_coarse) for column in (1, 2))
    inside = (time >= 0) & (time <= duration_s)
    return time[inside], first[inside], second[inside]


def _poses_of(
    tracks: Sequence[HasPose], who: NDArray[np.intp], time: NDArray[np.float64]
) -> NDArray[np.float64]:
    """Return x, y, yaw (N, 3) of tracks `who` (N,) at `time` (N,)."""
    pose = np.zeros((len(who), 3))
    order = np.argsort(who, kind="stable")
    for rows in np.split(order, np.flatnonzero(np.diff(who[order])) + 1):
        if len(rows):
            pose[rows] = tracks[int(who[rows[0]])].pose(time[rows])[:, [0, 1, 3]]
    return pose


def boxes_touch(
    first: NDArray[np.float64],
    first_extent: NDArray[np.float64],
    second: NDArray[np.float64],
    second_extent: NDArray[np.float64],
) -> NDArray[np.bool_]:
    """Test pairs of boxes for overlap.

    Args:
        first: x, y [m] and yaw [rad] of the first boxes (N, 3).
        first_extent: Their length and width (N, 2) [m].
        second: x, y [m] and yaw [rad] of the second boxes (N, 3).
        second_extent: Their length and width (N, 2) [m].

    Returns:
        Whether each pair overlaps (N,).
    """
    between = second[:, :2] - first[:, :2]
    apart = np.zeros(len(first), dtype=bool)
    axes = [yaw + quarter for yaw in (first[:, 2], second[:, 2]) for quarter in (0.0, np.pi / 2)]
    for axis in axes:
        distance = np.abs(between[:, 0] * np.cos(axis) + between[:, 1] * np.sin(axis))
        reach = sum(
            extent[:, 0] / 2 * np.abs(np.cos(axis - box[:, 2]))
            + extent[:, 1] / 2 * np.abs(np.sin(axis - box[:, 2]))
            for box, extent in ((first, first_extent), (second, second_extent))
        )
        apart |= distance > reach
    return ~apart
