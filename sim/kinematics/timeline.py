"""A drive scan by scan: when each row is taken, where the antenna is then, and which movers are near.

Built on `sim.kinematics.rolling_scan`; draws the durations of turns, and who is there where only a share of the movers is.
"""

from collections.abc import Sequence
from typing import Protocol

import numpy as np

from echoscape.scenes.core.scene import Mover
from echoscape.scenes.core.trajectory import Trajectory
from echoscape.sim.kinematics.rolling_scan import MoverStates, RowPoses, Turn, mover_states, row_poses, turns
from echoscape.sim.sensor.sensor import Sensor
from echoscape.sim.settings.artefacts import Artefacts

_TURNS_STAGE, _MOVERS_STAGE = 301, 307
"""Numbers of the stages that draw; those between are of `sim.simulator` and `sim.effects.interference`."""
_LEAST_TURNS = 64
_ROOM_M = 10.0
"""Beyond the sensor's range, within which a mover's middle may lie and the mover still be met."""


class HasTrajectory(Protocol):
    """A drive, or anything else with a trajectory."""

    @property
    def trajectory(self) -> Trajectory:
        """The motion of the car that carries the radar."""
        ...


class Timeline:
    """The motion of one car and of the movers, by the number of the scan."""

    def __init__(self, drive: HasTrajectory, movers: Sequence[Mover], *, sensor: Sensor, seed: int) -> None:
        """`drive` is the car's; `seed` decides durations of turns and who is there."""
        self._track, self._movers = drive.trajectory, tuple(movers)
        self._sensor, self._seed = sensor, seed
        self._turns: list[Turn] = []

    def turn(self, index: int) -> Turn:
        """Return the times of scan `index`.

        Raises:
            ValueError: `index` is negative.
        """
        if index < 0:
            raise ValueError(f"index must be 0 or more, got {index}")
        if index >= len(self._turns):
            rng = np.random.default_rng(np.random.SeedSequence([self._seed, 0, _TURNS_STAGE]))
            self._turns = turns(self._sensor, scans=max(_LEAST_TURNS, 2 * index), rng=rng)
        return self._turns[index]

    def poses(self, index: int, artefacts: Artefacts) -> RowPoses:
        """Return the antenna's motion through scan `index`."""
        return row_poses(
            self._track,
            self.turn(index),
            height_m=self._sensor.mount_height_m,
            distortion=artefacts.motion_distortion,
        )

    def states(self, index: int, artefacts: Artefacts, *, reach_m: float | None = None) -> MoverStates:
        """Return the movers that are there in scan `index` within `reach_m`, or within the sensor's range."""
        turn = self.turn(index)
        return mover_states(
            [mover for mover in self._movers if self._is_there(mover, artefacts.movers)],
            turn,
            near=self._track.pose(np.float64(turn.middle_s)),
            reach_m=self._sensor.range_m + _ROOM_M if reach_m is None else reach_m,
            distortion=artefacts.motion_distortion,
        )

    def _is_there(self, mover: Mover, share: float) -> bool:
        """Whether a mover is among the share of them that is there, in every scan alike."""
        if share in (0.0, 1.0):
            return share == 1.0
        draw = np.random.SeedSequence([self._seed, mover.instance, _MOVERS_STAGE]).generate_state(1)[0]
        return bool(draw < share * 2**32)
