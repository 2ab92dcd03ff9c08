"""What decides a scan of a test, with the defaults; apart from the rest, so that reading it loads nothing."""

from collections.abc import Mapping
from dataclasses import dataclass
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from echoscape.sim.sensor.sensor import Sensor
    from echoscape.sim.settings.artefacts import Artefacts


@dataclass(frozen=True, kw_only=True)
class ScanSettings:
    """A scan of a drive, and the radar that takes it.

    Attributes:
        preset: Kind of world, as in `echoscape.scan`; a yard is built in a fraction of a second.
        seed: Seed of the world, the drive, the traffic, rays, speckle and noise.
        index: Number of the scan in its drive, from 0.
        scans: Scans of the whole drive.
        artefacts: Strengths of the artefacts, as `Artefacts` or by name, such as {"ghosts": 0}; None is the
            radar as it is, in dry weather.
        sensor: The radar, its name, or a TOML file; the small one has 100 azimuths of 512 bins, up to 88 m.
    """

    preset: str = "yard"
    seed: int = 7
    index: int = 0
    scans: int = 10
    artefacts: "Artefacts | Mapping[str, float | bool] | None" = None
    sensor: "Sensor | str" = "cts_small"


CLEAN: Mapping[str, float] = {"ghosts": 0.0, "speckle": 0.0, "saturation": 0.0}
"""Artefacts that a clean scan is without: what makes the levels of cells hard to predict."""
