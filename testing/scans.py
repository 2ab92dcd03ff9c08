"""Scans of drives for tests, with the bytes that `echoscape simulate` writes with the same settings."""

from collections.abc import Mapping
from dataclasses import fields, replace
from functools import lru_cache
from typing import TYPE_CHECKING, Any, NamedTuple

from echoscape.scenes.core.checks import check_kind, check_whole
from echoscape.sim.datasets.polar_scan import PolarScan, ScanTruth
from echoscape.sim.datasets.se2 import SE2, from_world, relative
from echoscape.testing.kept_scans import kept, settings_content
from echoscape.testing.settings import ScanSettings

if TYPE_CHECKING:
    from echoscape.sim.generation.config import SimulationConfig
    from echoscape.sim.sensor.sensor import Sensor
    from echoscape.sim.settings.artefacts import Artefacts
    from echoscape.sim.simulator import Simulator


class ScanPair(NamedTuple):
    """Two successive scans of a drive and the true motion between them."""

    first: PolarScan
    """The earlier scan."""
    second: PolarScan
    """The later scan."""
    motion: SE2
    """True pose of the later scan in the frame of the earlier one, mid-scan to mid-scan: forward and right
    [m], yaw clockwise [rad]."""


def make_scan(settings: ScanSettings | None = None, **changes: Any) -> PolarScan:
    """Return a scan with its truth; its arrays cannot be written to.

    Args:
        settings: What decides the scan; None is the default.
        changes: Fields of `ScanSettings` that differ.

    Returns:
        The scan, from memory or disk where it was made before.

    Raises:
        ValueError: A setting cannot be simulated; the message names it.
        TypeError: There is no setting of a name, or one is of another type.
    """
    settings = checked_settings(settings, changes)
    if not 0 <= settings.index < settings.scans:
        raise ValueError(f"index must be from 0 to scans - 1 ({settings.scans - 1}), got {settings.index}")
    content = settings_content(settings, [each.name for each in fields(settings)])
    return kept("scan", PolarScan, content, lambda: _simulated(settings))


def make_drive(settings: ScanSettings | None = None, **changes: Any) -> tuple[PolarScan, ...]:
    """Return all scans of a drive.

    Args:
        settings: What decides the drive; `index` does not count.
        changes: Fields of `ScanSettings` that differ.

    Returns:
        The scans, in order.

    Raises:
        ValueError: A setting cannot be simulated; the message names it.
        TypeError: There is no setting of a name, or one is of another type.
    """
    settings = checked_settings(settings, changes)
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
        TypeError: There is no setting of a name, or one is of another type.
    """
    settings = checked_settings(settings, changes)
    first, second = (make_scan(settings, index=settings.index + step) for step in (0, 1))
    poses = (from_world(_truth(scan).middle_pose) for scan in (first, second))
    return ScanPair(first, second, SE2.from_array(relative(*poses)))


def checked_settings(settings: ScanSettings | None, changes: Mapping[str, Any]) -> ScanSettings:
    """Change settings, and check their types.

    Args:
        settings: The settings; None is the default.
        changes: Fields that differ.

    Returns:
        The changed settings.

    Raises:
        ValueError: A number is not whole, or too small.
        TypeError: There is no setting of a name, or one is of another type.
    """
    changed = replace(settings or ScanSettings(), **changes)
    check_whole(seed=changed.seed)
    check_whole(scans=changed.scans, least=1)
    check_whole(index=changed.index, least=None)
    # Names are looked up where a scan is simulated: that loads SciPy, which kept scans do without.
    if not isinstance(changed.sensor, str):
        sensor_of(changed)
    if not isinstance(changed.artefacts, Mapping | None):
        artefacts_of(changed)
    return changed


def _truth(scan: PolarScan) -> ScanTruth:
    assert scan.truth is not None  # simulated scans have it
    return scan.truth


# ---------------------------------------------------------------------- simulation, where no scan was kept


def _simulated(settings: ScanSettings) -> PolarScan:
    from echoscape.sim.generation.config import SimulationConfig

    artefacts = artefacts_of(settings)
    config = SimulationConfig(
        preset=settings.preset, seed=settings.seed, scans=settings.scans, sensor=sensor_of(settings)
    )
    return _simulator(config).scans(settings.index, [artefacts])[0]


@lru_cache(maxsize=2)
def _simulator(config: "SimulationConfig") -> "Simulator":
    """Return the simulator of a drive; that of a clean and of a full scan are the same."""
    from echoscape.sim.generation.single_scan import build_simulator

    return build_simulator(config)


def sensor_of(settings: ScanSettings) -> "Sensor":
    """Look up the radar of settings.

    Args:
        settings: The settings.

    Returns:
        The radar.

    Raises:
        ValueError: There is no such radar; the message names those that there are.
        TypeError: It is neither a radar nor a name.
    """
    from echoscape.sim.sensor.registry import sensor_from
    from echoscape.sim.sensor.sensor import Sensor

    check_kind(Sensor | str, sensor=settings.sensor)
    return sensor_from(settings.sensor) if isinstance(settings.sensor, str) else settings.sensor


def artefacts_of(settings: ScanSettings) -> "Artefacts":
    """Convert the artefacts of settings.

    Args:
        settings: The settings.

    Returns:
        The artefacts.

    Raises:
        ValueError: There is no artefact of a name, or it cannot have such a strength.
        TypeError: They are neither `Artefacts` nor strengths by name.
    """
    from echoscape.sim.settings.artefacts import artefacts_from

    return artefacts_from(settings.artefacts)
