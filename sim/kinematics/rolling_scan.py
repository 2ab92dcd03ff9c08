"""When each row is taken and where the radar and the movers are then: the rolling scan.

Vehicle and radar share a heading; azimuth grows clockwise from straight ahead, so in the world (z up, yaw
counter-clockwise) row i looks along yaw - 2 pi i / azimuths. A row's time is the middle of its sweep.
"""

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from echoscape.scenes.core.scene import Mover
from echoscape.scenes.core.trajectory import Trajectory
from echoscape.sim.sensor.sensor import Sensor


@dataclass(frozen=True, kw_only=True)
class Turn:
    """The times of one scan: `start_s` of its first row, `row_s` from row to row [s], `azimuths` rows."""

    start_s: float
    row_s: float
    azimuths: int

    @property
    def times_s(self) -> NDArray[np.float64]:
        """Times (azimuths,) of the rows [s]."""
        return self.start_s + self.row_s * np.arange(self.azimuths, dtype=np.float64)

    @property
    def middle_s(self) -> float:
        """The time that the scan's pose refers to: half way between its first and its last row [s]."""
        return self.start_s + self.row_s * (self.azimuths - 1) / 2


def turns(sensor: Sensor, *, scans: int, rng: np.random.Generator) -> list[Turn]:
    """Return the times of `scans` successive scans from 0 s; each turn's duration is drawn by itself.

    The first n of them do not depend on how many are asked for.
    """
    nominal = 1 / sensor.rotation_hz
    draws = np.clip(rng.standard_normal(scans), -2.5, 2.5) * sensor.rotation_jitter_s
    durations = nominal + draws
    starts = np.append(0.0, np.cumsum(durations)[:-1])
    return [
        Turn(start_s=float(start), row_s=float(duration) / sensor.azimuths, azimuths=sensor.azimuths)
        for start, duration in zip(starts, durations, strict=True)
    ]


@dataclass(frozen=True, kw_only=True)
class RowPoses:
    """The radar at each row.

    position (A, 3) [m], yaw (A,) [rad], velocity (A, 3) [m/s] of the antenna in the world, float64; row_s:
    time from row to row, 0 where all rows stand for mid-scan [s].
    """

    position: NDArray[np.float64]
    yaw: NDArray[np.float64]
    velocity: NDArray[np.float64]
    row_s: float


def spread_times(turn: Turn, share: float) -> NDArray[np.float64]:
    """Return the times (azimuths,) of the rows [s], drawn together to a share of the turn."""
    if share == 1:
        return turn.times_s
    return turn.middle_s + share * (turn.times_s - turn.middle_s)


def row_poses(track: Trajectory, turn: Turn, *, height_m: float, distortion: float = 1.0) -> RowPoses:
    """Return the antenna's motion through one scan; without `distortion` it stands at its mid-scan pose.

    `distortion` is the share of the turn's time over which the rows spread.

    The velocity stays when the distortion is switched off, so that the Doppler shift does.
    """
    times = spread_times(turn, distortion)
    pose = track.pose(times)
    return RowPoses(
        position=pose[:, :3] + [0.0, 0.0, height_m],
        yaw=pose[:, 3],
        velocity=track.velocity(times)[:, :3],
        row_s=turn.row_s * distortion,
    )


@dataclass(frozen=True, kw_only=True)
class MoverStates:
    """The movers that a scan may see, at each of its rows.

    movers: M of them; state (M, A, 4) x, y, z [m], yaw [rad]; rate (M, A, 4) its time derivative, float64.
    """

    movers: tuple[Mover, ...]
    state: NDArray[np.float64]
    rate: NDArray[np.float64]


def mover_states(
    movers: Sequence[Mover], turn: Turn, *, near: NDArray[np.float64], reach_m: float, distortion: float = 1.0
) -> MoverStates:
    """Return the states of the movers within `reach_m` of the point `near` (2 or more,) [m] at mid-scan."""
    close = [
        mover
        for mover in movers
        if math.dist(mover.track.pose(np.float64(turn.middle_s))[:2], near[:2]) <= reach_m
    ]
    times = spread_times(turn, distortion)
    shape = (len(close), turn.azimuths, 4)
    return MoverStates(
        movers=tuple(close),
        state=np.array([mover.track.pose(times) for mover in close]).reshape(shape),
        rate=np.array([mover.track.velocity(times) for mover in close]).reshape(shape),
    )
