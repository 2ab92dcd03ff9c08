"""A drive scan by scan: the times of each scan, the poses of the antenna, and the moving objects nearby.

Draws the durations of the revolutions and, where only a share of the moving objects is wanted, which of them.
"""

from collections.abc import Sequence
from typing import Protocol

import numpy as np

from echoscape.scenes.core.checks import check_whole
from echoscape.scenes.core.scene import Mover
from echoscape.scenes.core.trajectory import Trajectory
from echoscape.sim.kinematics.rolling_scan import (
    AzimuthPoses,
    MoverStates,
    Revolution,
    azimuth_poses,
    mover_states,
    revolutions,
)
from echoscape.sim.sensor.sensor import Sensor
from echoscape.sim.settings.artefacts import Artefacts

_REVOLUTIONS_STAGE, _MOVERS_STAGE = 301, 307
"""Numbers of the random stages; those between belong to `sim.simulator` and `sim.effects.interference`."""
_LEAST_REVOLUTIONS = 64
_MARGIN_M = 10.0
"""Added to the range of the sensor: the middle of a moving object may lie beyond it while its near end does
not."""


class HasTrajectory(Protocol):
    """A drive, or any other object with a trajectory."""

    @property
    def trajectory(self) -> Trajectory:
        """The motion of the vehicle that carries the radar."""
        ...


class Timeline:
    """The motion of one vehicle and of the moving objects around it, by scan number."""

    def __init__(self, drive: HasTrajectory, movers: Sequence[Mover], *, sensor: Sensor, seed: int) -> None:
        """Take the motions.

        Args:
            drive: The drive of the vehicle that carries the radar.
            movers: All moving objects.
            sensor: The radar: rotation rate, azimuths, height and range.
            seed: Decides durations of revolutions, and which moving objects are kept.
        """
        self._track, self._movers = drive.trajectory, tuple(movers)
        self._sensor, self._seed = sensor, seed
        self._revolutions: list[Revolution] = []  # a memo: drawn from the seed, the same whenever it is made

    def revolution(self, index: int) -> Revolution:
        """Return the times of a scan.

        Args:
            index: Number of the scan, from 0.

        Returns:
            Start, period and number of its azimuths.

        Raises:
            ValueError: `index` is no whole number of 0 or more.
        """
        check_whole(index=index)
        if index >= len(self._revolutions):
            rng = np.random.default_rng(np.random.SeedSequence([self._seed, 0, _REVOLUTIONS_STAGE]))
            count = max(_LEAST_REVOLUTIONS, 2 * index)
            self._revolutions = revolutions(self._sensor, scans=count, rng=rng)
        return self._revolutions[index]

    def poses(self, revolution: Revolution, artefacts: Artefacts) -> AzimuthPoses:
        """Return the motion of the antenna through a scan.

        Args:
            revolution: The times of the scan.
            artefacts: Of which motion distortion and attitude count.

        Returns:
            Position, attitude and velocity at each azimuth.
        """
        return azimuth_poses(
            self._track,
            revolution,
            height_m=self._sensor.mount_height_m,
            distortion=artefacts.motion_distortion,
            attitude=artefacts.attitude,
        )

    def movers(
        self, revolution: Revolution, artefacts: Artefacts, *, reach_m: float | None = None
    ) -> MoverStates:
        """Return the moving objects near the radar in a scan.

        Args:
            revolution: The times of the scan.
            artefacts: Of which motion distortion and the share of moving objects count.
            reach_m: Largest distance from the vehicle at mid-scan [m]; None is the range of the sensor.

        Returns:
            The objects and their states at each azimuth.
        """
        return mover_states(
            [mover for mover in self._movers if self._is_kept(mover, artefacts.movers)],
            revolution,
            near=self._track.pose(np.float64(revolution.middle_s)),
            reach_m=self._sensor.range_m + _MARGIN_M if reach_m is None else reach_m,
            distortion=artefacts.motion_distortion,
        )

    def _is_kept(self, mover: Mover, share: float) -> bool:
        """Whether an object belongs to the share of moving objects that is kept; the same in every scan."""
        if share in (0.0, 1.0):
            return share == 1.0
        draw = np.random.SeedSequence([self._seed, mover.instance, _MOVERS_STAGE]).generate_state(1)[0]
        return bool(draw < share * 2**32)
