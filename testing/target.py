"""Scans of a corner reflector at a stated range and bearing, by a car at rest on a plane."""

import math
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np

from echoscape.scenes.core.checks import check_number
from echoscape.sim.datasets.polar_scan import PolarScan
from echoscape.testing.kept_scans import kept, settings_content
from echoscape.testing.scans import artefacts_of, checked_settings, sensor_of
from echoscape.testing.settings import ScanSettings

if TYPE_CHECKING:
    from echoscape.scenes.core.scene import Scene
    from echoscape.scenes.core.targets import Target
    from echoscape.scenes.core.trajectory import Trajectory
    from echoscape.sim.sensor.sensor import Sensor

_CORNER_M = 0.083
"""Edge of the corner reflector [m]: 11 dBsm at 76.5 GHz, far above the ground and below compression. At 30 m
its level lies so between two codes of the small radar that one bin alone has the larger one."""
_NEAREST_M = 5.0
"""Least range of a target [m]: nearer ones are near the leakage and below the beam."""
_DEFAULT_M, _DEFAULT_RAD = 30.0, 0.6


class TargetScan(NamedTuple):
    """A scan of a corner reflector on a plane by a radar at rest."""

    scan: PolarScan
    """The scan."""
    range_m: float
    """Range of the reflector from the antenna [m]."""
    bearing_rad: float
    """Bearing of the reflector, clockwise from straight ahead [rad]."""

    @property
    def azimuth(self) -> int:
        """Row of the azimuth that looks nearest to the reflector."""
        offset = np.remainder(self.scan.azimuth_rad - self.bearing_rad + math.pi, 2 * math.pi) - math.pi
        return int(np.argmin(np.abs(offset)))

    @property
    def bin(self) -> int:
        """Range bin that holds the reflector."""
        return int(self.range_m / self.scan.bin_m)


def make_target(
    range_m: float | None = None,
    bearing_rad: float | None = None,
    *,
    settings: ScanSettings | None = None,
    **changes: Any,
) -> TargetScan:
    """Return a scan of a corner reflector at the height of the antenna above a plane; the car is at rest.

    Args:
        range_m: Range of the reflector [m], 5 m or more and within the range of the radar; None is the middle
            of a bin near 30 m.
        bearing_rad: Bearing, clockwise from straight ahead [rad]; None is the azimuth nearest to 0.6 rad.
        settings: Seed, artefacts and radar; the rest does not count.
        changes: Fields of `ScanSettings` that differ.

    Returns:
        The scan with the range and the bearing.

    Raises:
        ValueError: The range is outside of these limits, or another setting cannot be simulated.
        TypeError: There is no setting of a name, or one is of another type.
    """
    settings = checked_settings(settings, changes)
    place = {"range_m": range_m, "bearing_rad": bearing_rad}
    check_number(**{name: value for name, value in place.items() if value is not None})
    content = settings_content(settings, ("seed", "artefacts", "sensor")) | place
    found = kept("target", _Target, content, lambda: _simulated(settings, range_m, bearing_rad))
    return TargetScan(found.scan, found.range_m, found.bearing_rad)


@dataclass(frozen=True, kw_only=True)
class _Target:
    """A `TargetScan` as it is kept on disk."""

    scan: PolarScan
    range_m: float
    bearing_rad: float


@dataclass(frozen=True)
class _Standing:
    """The drive of a car that does not move."""

    trajectory: "Trajectory"


# ---------------------------------------------------------------------- simulation, where no scan was kept


def _simulated(settings: ScanSettings, range_m: float | None, bearing_rad: float | None) -> _Target:
    from echoscape.scenes.core.target_meshes import with_targets
    from echoscape.scenes.town.build import build_town
    from echoscape.sim.simulator import Simulator

    sensor = sensor_of(settings)
    range_m, bearing_rad = _place(sensor, range_m, bearing_rad)
    plane = build_town("empty", seed=settings.seed)
    drive = _Standing(_at_start(plane, seed=settings.seed))
    corner = _corner(drive, sensor, range_m, bearing_rad)
    simulator = Simulator(
        with_targets(plane, [corner]),
        drive,
        seed=settings.seed,
        sensor=sensor,
        artefacts=artefacts_of(settings),
    )
    return _Target(scan=simulator.scan(0), range_m=range_m, bearing_rad=bearing_rad)


def _place(sensor: "Sensor", range_m: float | None, bearing_rad: float | None) -> tuple[float, float]:
    """Return range and bearing, by default in the middle of a bin and of an azimuth, or raise ValueError."""
    if range_m is None:
        range_m = (math.floor(_DEFAULT_M / sensor.bin_m) + 0.5) * sensor.bin_m
    if bearing_rad is None:
        bearing_rad = float(sensor.azimuth_rad[np.argmin(np.abs(sensor.azimuth_rad - _DEFAULT_RAD))])
    if not _NEAREST_M <= range_m < sensor.range_m:
        raise ValueError(f"range_m must be between {_NEAREST_M:g} and {sensor.range_m:g}, got {range_m:g}")
    if not math.isfinite(bearing_rad):
        raise ValueError(f"bearing_rad must be finite, got {bearing_rad}")
    return float(range_m), float(bearing_rad)


def _at_start(plane: "Scene", *, seed: int) -> "Trajectory":
    """Return a car at rest where a drive would start."""
    from echoscape.scenes.core.trajectory import Trajectory
    from echoscape.scenes.driving.ego_drive import plan_ego_drive

    start = plan_ego_drive(plane, seed=seed, duration_s=1.0).pose(np.array(0.0))
    return Trajectory(time_s=np.array([0.0, 1.0]), state=np.stack([start, start]), rate=np.zeros((2, 4)))


def _corner(drive: _Standing, sensor: "Sensor", range_m: float, bearing_rad: float) -> "Target":
    """Return the reflector, which faces the antenna."""
    from echoscape.scenes.core.targets import Target

    x_m, y_m, _, yaw_rad = (float(value) for value in drive.trajectory.state[0])
    away_rad = yaw_rad - bearing_rad
    return Target(
        kind="trihedral",
        position_m=(
            x_m + range_m * math.cos(away_rad),
            y_m + range_m * math.sin(away_rad),
            sensor.mount_height_m,
        ),
        heading_rad=away_rad + math.pi,
        size_m=(_CORNER_M,),
    )
