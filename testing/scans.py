"""Scans for tests: simulated once, kept on disk for the next session, and read-only.

A scan has the bytes that `echoscape simulate` writes with the same settings. A kept scan is used only where
the same code, packages and compiler made it (`sim.generation.cache`); it loads without the ray tracer.
"""

import json
import math
import platform
from collections.abc import Callable, Mapping
from dataclasses import asdict, dataclass, fields, is_dataclass, replace
from functools import lru_cache
from pathlib import Path
from typing import TYPE_CHECKING, Any, NamedTuple, TypeVar

import numpy as np

from echoscape.sim.datasets.polar_scan import PolarScan, ScanTruth
from echoscape.sim.datasets.se2 import SE2, from_world, relative
from echoscape.sim.generation.cache import cached, package_version
from echoscape.testing.settings import ScanSettings

if TYPE_CHECKING:
    from echoscape.scenes.core.trajectory import Trajectory
    from echoscape.sim.generation.config import SimulationConfig
    from echoscape.sim.sensor.sensor import Sensor
    from echoscape.sim.settings.artefacts import Artefacts
    from echoscape.sim.simulator import Simulator

_CODE = ("scenes", "sim", "testing")
_TRACER = ("drjit", "mitsuba", "karellen-llvm-core")
_CORNER_M = 0.083
"""Edge of the corner reflector [m]: 11 dBsm at 76.5 GHz, far above the ground and below compression. At 30 m
its level lies so between two codes of the small radar that one bin alone has the larger one."""
_NEAREST_M = 5.0
"""Least range of a target [m]: nearer ones are near the leakage and below the beam."""

Record = TypeVar("Record")


class ScanPair(NamedTuple):
    """Two successive scans of a drive and the true motion between them."""

    first: PolarScan
    """The earlier scan."""
    second: PolarScan
    """The later scan."""
    motion: SE2
    """True pose of the later scan in the frame of the earlier one, mid-scan to mid-scan: forward and right
    [m], yaw clockwise [rad]."""


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


def make_scan(settings: ScanSettings | None = None, **changes: Any) -> PolarScan:
    """Return a scan with its truth; its arrays cannot be written to.

    Args:
        settings: What decides the scan; None is the default.
        changes: Fields of `ScanSettings` that differ.

    Returns:
        The scan, from memory or disk where it was made before.

    Raises:
        ValueError: A setting cannot be simulated; the message names it.
        TypeError: There is no setting of a name.
    """
    settings = replace(settings or ScanSettings(), **changes)
    if not 0 <= settings.index < settings.scans:
        raise ValueError(f"index must be from 0 to scans - 1 ({settings.scans - 1}), got {settings.index}")
    content = {each.name: _plain(getattr(settings, each.name)) for each in fields(settings)}
    return _kept("scan", content, lambda: _simulated(settings))


def make_drive(settings: ScanSettings | None = None, **changes: Any) -> tuple[PolarScan, ...]:
    """Return all scans of a drive.

    Args:
        settings: What decides the drive; `index` does not count.
        changes: Fields of `ScanSettings` that differ.

    Returns:
        The scans, in order.

    Raises:
        ValueError: A setting cannot be simulated; the message names it.
        TypeError: There is no setting of a name.
    """
    settings = replace(settings or ScanSettings(), **changes)
    return tuple(make_scan(settings, index=index) for index in range(settings.scans))


def make_pair(settings: ScanSettings | None = None, **changes: Any) -> ScanPair:
    """Return two successive scans with the true motion between them.

    Args:
        settings: What decides the scans; `index` is that of the earlier one.
        changes: Fields of `ScanSettings` that differ.

    Returns:
        The pair.

    Raises:
        ValueError: A setting cannot be simulated; the message names it.
        TypeError: There is no setting of a name.
    """
    settings = replace(settings or ScanSettings(), **changes)
    first, second = (make_scan(settings, index=settings.index + step) for step in (0, 1))
    poses = (from_world(_truth(scan).middle_pose) for scan in (first, second))
    return ScanPair(first, second, SE2.from_array(relative(*poses)))


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
        TypeError: There is no setting of a name.
    """
    settings = replace(settings or ScanSettings(), **changes)
    content = {name: _plain(getattr(settings, name)) for name in ("seed", "artefacts", "sensor")}
    found = _kept(
        "target",
        {**content, "range_m": range_m, "bearing_rad": bearing_rad},
        lambda: _simulated_target(settings, range_m, bearing_rad),
        kind=_Target,
    )
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


def _kept(
    name: str, settings: Mapping[str, Any], build: Callable[[], Record], kind: Any = PolarScan
) -> Record:
    """Return what was made of the same settings before, or make and keep it; its arrays become read-only."""
    key = json.dumps([name, settings], sort_keys=True)
    if key not in _MEMORY:
        content = {**settings, "tracer": _tracer()}
        _MEMORY[key] = _read_only(cached(name, kind, content, build, code=_CODE))
    return _MEMORY[key]


_MEMORY: dict[str, Any] = {}


@lru_cache(maxsize=1)
def _tracer() -> dict[str, str]:
    """Return what compiles the ray tracer's kernels, and for which machine."""
    from echoscape.sim.raytracing.backend import choose_llvm, selected_backend

    backend = selected_backend()
    library = choose_llvm() if backend == "llvm" else None
    llvm = "none" if library is None else Path(library).resolve().name
    versions = {name: package_version(name) for name in _TRACER}
    return {**versions, "backend": backend, "llvm": llvm, "machine": platform.machine()}


def _plain(value: Any) -> Any:
    """Return a setting as JSON takes it."""
    if is_dataclass(value) and not isinstance(value, type):
        return asdict(value)
    if isinstance(value, Mapping):
        return dict(value)
    return value.item() if isinstance(value, np.generic) else value


def _read_only(record: Record) -> Record:
    """Forbid writing to the arrays of a record, so that one test cannot change the scan of another."""
    for each in fields(record):  # pyright: ignore[reportArgumentType]
        value = getattr(record, each.name)
        if isinstance(value, np.ndarray):
            value.setflags(write=False)
        elif is_dataclass(value):
            _read_only(value)
    return record


def _truth(scan: PolarScan) -> ScanTruth:
    assert scan.truth is not None  # simulated scans have it
    return scan.truth


# ---------------------------------------------------------------------- simulation, where no scan was kept


def _simulated(settings: ScanSettings) -> PolarScan:
    from echoscape.sim.generation.config import SimulationConfig

    artefacts = _artefacts(settings)
    config = SimulationConfig(
        preset=settings.preset, seed=settings.seed, scans=settings.scans, sensor=_sensor(settings)
    )
    return _simulator(config).scans(settings.index, [artefacts])[0]


@lru_cache(maxsize=2)
def _simulator(config: "SimulationConfig") -> "Simulator":
    """Return the simulator of a drive; that of a clean and of a full scan are the same."""
    from echoscape.sim.generation.single_scan import build_simulator

    return build_simulator(config)


def _sensor(settings: ScanSettings) -> "Sensor":
    from echoscape.sim.sensor.registry import sensor_from

    return sensor_from(settings.sensor) if isinstance(settings.sensor, str) else settings.sensor


def _artefacts(settings: ScanSettings) -> "Artefacts":
    from echoscape.sim.settings.artefacts import Artefacts

    given = settings.artefacts
    if given is None or isinstance(given, Artefacts):
        return given or Artefacts()
    known = [each.name for each in fields(Artefacts)]
    for name in given:
        if name not in known:
            raise ValueError(f"an artefact must be one of {', '.join(known)}, got {name!r}")
    return Artefacts(**given)


def _simulated_target(settings: ScanSettings, range_m: float | None, bearing_rad: float | None) -> _Target:
    from echoscape.scenes.core.target_meshes import with_targets
    from echoscape.scenes.core.targets import Target
    from echoscape.scenes.core.trajectory import Trajectory
    from echoscape.scenes.driving.ego_drive import plan_ego_drive
    from echoscape.scenes.town.build import build_town
    from echoscape.sim.simulator import Simulator

    sensor, artefacts = _sensor(settings), _artefacts(settings)
    range_m = (math.floor(30.0 / sensor.bin_m) + 0.5) * sensor.bin_m if range_m is None else float(range_m)
    if bearing_rad is None:
        bearing_rad = float(sensor.azimuth_rad[np.argmin(np.abs(sensor.azimuth_rad - 0.6))])
    if not _NEAREST_M <= range_m < sensor.range_m:
        raise ValueError(f"range_m must be between {_NEAREST_M:g} and {sensor.range_m:g}, got {range_m:g}")
    if not math.isfinite(bearing_rad):
        raise ValueError(f"bearing_rad must be finite, got {bearing_rad}")
    plane = build_town("empty", seed=settings.seed)
    start = plan_ego_drive(plane, seed=settings.seed, duration_s=1.0).pose(np.array(0.0))
    away_rad = float(start[3]) - bearing_rad
    corner = Target(
        kind="trihedral",
        position_m=(
            float(start[0]) + range_m * math.cos(away_rad),
            float(start[1]) + range_m * math.sin(away_rad),
            sensor.mount_height_m,
        ),
        heading_rad=away_rad + math.pi,
        size_m=(_CORNER_M,),
    )
    still = Trajectory(time_s=np.array([0.0, 1.0]), state=np.stack([start, start]), rate=np.zeros((2, 4)))
    simulator = Simulator(
        with_targets(plane, [corner]),
        _Standing(still),
        seed=settings.seed,
        sensor=sensor,
        artefacts=artefacts,
    )
    return _Target(scan=simulator.scan(0), range_m=range_m, bearing_rad=float(bearing_rad))
