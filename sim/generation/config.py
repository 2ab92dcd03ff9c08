"""The configuration of a simulation: a world, a seed, a number of scans, and the settings of every stage.

It is checked when it is made, so that a setting that cannot be simulated is refused before any work is done.
"""

import math
from collections.abc import Iterator
from dataclasses import dataclass, field, fields, is_dataclass

from echoscape.scenes.core.checks import check_whole
from echoscape.scenes.driving.ego_drive import DURATION_RANGE_S, DriveSettings
from echoscape.scenes.io.scene_file import AnyScene
from echoscape.scenes.io.target_toml import AnyTarget
from echoscape.scenes.io.user_scene import UserScene
from echoscape.scenes.town.presets import PRESETS
from echoscape.scenes.traffic.plan import TrafficSettings
from echoscape.sim.datasets.layouts.layout import Layout
from echoscape.sim.datasets.layouts.registry import LAYOUTS, LayoutName, home_of
from echoscape.sim.kinematics.rolling_scan import LONGEST_DEVIATION
from echoscape.sim.sensor.cts350x import CTS350X
from echoscape.sim.sensor.sensor import Sensor
from echoscape.sim.settings.artefacts import Artefacts
from echoscape.sim.settings.surfaces import SurfaceSettings
from echoscape.sim.settings.tracing import TraceSettings

DEFAULT_PRESET = "town"
CUSTOM_PRESET = "custom"
"""The preset's name where the scene is a custom one."""

_POSITIVE = ("traffic.near_m", "traffic.step_s", "drive.knot_s", "drive.corner_m", "drive.wander_length_m")


@dataclass(frozen=True, kw_only=True)
class SimulationConfig:
    """All settings that decide the bytes of a data set."""

    preset: str = ""
    """Kind of world: town (the default), suburb, industrial, motorway, open, yard or empty (a road on a
    plane, with traffic)."""
    seed: int = 0
    """Seed of everything that is drawn: the town, the drive, the traffic, rays, speckle and noise."""
    scans: int = 40
    """Scans to simulate, four a second of driving."""
    keep_beat: bool = False
    """Keep the sampled beat signal of every scan in OUT/beat, for your own signal processing."""
    sensor: Sensor = CTS350X
    """The radar."""
    layout: LayoutName | None = None
    """Layout of the folder; by default that of the radar's published data set, or Oxford's."""
    trace: TraceSettings = field(default_factory=TraceSettings)
    """Number of rays and bounces, and the weakest echo that is kept."""
    artefacts: Artefacts = field(default_factory=Artefacts)
    """Strengths of the artefacts."""
    surfaces: SurfaceSettings = field(default_factory=SurfaceSettings)
    """Roughness of the world relative to the values of its materials."""
    drive: DriveSettings = field(default_factory=DriveSettings)
    """How the car is driven."""
    traffic: TrafficSettings = field(default_factory=TrafficSettings)
    """Other road users; not with a custom scene of a mesh, which has no roads."""
    scene: AnyScene | None = None
    """A custom scene or an OpenStreetMap extract in place of a preset, see `scenes.io.user_scene` and
    `scenes.io.osm.extract`; preset is then "custom"."""
    targets: tuple[AnyTarget, ...] = ()
    """Test targets in addition to those of the scene, see `scenes.core.targets`."""
    randomized: bool = False
    """Whether sensor, artefacts and surfaces were drawn by `sim.generation.domain_randomization`."""

    def __post_init__(self) -> None:
        """Fill in the preset; refuse settings that cannot be simulated, naming the setting."""
        if self.preset in ("", CUSTOM_PRESET) and (self.scene is not None or not self.preset):
            object.__setattr__(self, "preset", DEFAULT_PRESET if self.scene is None else CUSTOM_PRESET)
        elif self.scene is not None:
            what = "scene" if isinstance(self.scene, UserScene) else "map"
            raise ValueError(f"preset must not be given beside a {what}, got {self.preset!r}")
        if isinstance(self.scene, UserScene):
            _check_default("traffic", self.traffic, "which has no traffic")
            _check_default("drive", self.drive, "which brings its drive")
        if self.scene is None and self.preset not in PRESETS:
            raise ValueError(f"preset must be one of {', '.join(PRESETS)}, got {self.preset!r}")
        check_whole(seed=self.seed)
        check_whole(scans=self.scans, least=1)
        for name in ("seed", "scans"):  # NumPy's integers are no JSON
            object.__setattr__(self, name, int(getattr(self, name)))
        if self.layout is not None and self.layout not in LAYOUTS:
            raise ValueError(f"layout must be one of {', '.join(LAYOUTS)}, got {self.layout!r}")
        if not 0 <= self.sensor.rotation_jitter_s < 0.1 / self.sensor.rotation_hz:
            raise ValueError(
                "sensor.rotation_jitter_s must be 0 or more and below a tenth of a revolution, "
                f"got {self.sensor.rotation_jitter_s}"
            )
        for name, value in (*_numbers("drive", self.drive), *_numbers("traffic", self.traffic)):
            _check_number(name, value)
        if self.duration_s > DURATION_RANGE_S[1]:
            most = int(self.scans * DURATION_RANGE_S[1] / self.duration_s) - 1
            raise ValueError(
                f"scans must be {most} or fewer (drives end at {DURATION_RANGE_S[1]:g} s), got {self.scans}"
            )

    @property
    def folder_layout(self) -> Layout:
        """Layout of the data set's folder."""
        return home_of(self.sensor.name) if self.layout is None else LAYOUTS[self.layout]

    @property
    def duration_s(self) -> float:
        """Duration of a drive that outlasts the scans, however long their revolutions are drawn [s]."""
        return 1.0 + self.scans * self.longest_revolution_s

    @property
    def longest_revolution_s(self) -> float:
        """Longest possible revolution of the antenna [s]."""
        return 1 / self.sensor.rotation_hz + LONGEST_DEVIATION * self.sensor.rotation_jitter_s


def _check_default(name: str, settings: object, why: str) -> None:
    """Refuse settings that have no effect beside a custom scene unless they are the default ones."""
    for (place, value), (_, default) in zip(
        _numbers(name, settings), _numbers(name, type(settings)()), strict=True
    ):
        if value != default:
            raise ValueError(f"{place} must not be given beside a scene, {why}, got {value:g}")


def _numbers(name: str, settings: object) -> Iterator[tuple[str, float]]:
    """Yield the dotted name and value of every number in `settings`, a dataclass, tuple, or number."""
    if is_dataclass(settings):
        for each in fields(settings):
            yield from _numbers(f"{name}.{each.name}", getattr(settings, each.name))
    elif isinstance(settings, tuple):
        for value in settings:
            yield from _numbers(name, value)
    elif isinstance(settings, (int, float)):
        yield name, settings


def _check_number(name: str, value: float) -> None:
    """Refuse a number of drive or traffic that is not finite, below 0, or 0 where it must be above."""
    if not math.isfinite(value):
        raise ValueError(f"{name} must be finite, got {value}")
    if value < 0 or (value == 0 and name in _POSITIVE):
        raise ValueError(f"{name} must be {'above 0' if name in _POSITIVE else '0 or more'}, got {value:g}")
