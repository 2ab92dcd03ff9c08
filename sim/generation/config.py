"""What a dataset is made from: a world, a seed, a number of scans, and every setting of what makes them.

A configuration is checked when it is made, so that nothing senseless gets as far as a file or a ray.
"""

import math
from collections.abc import Iterator
from dataclasses import dataclass, field, fields, is_dataclass

from echoscape.scenes.driving.ego_drive import DURATION_RANGE_S, DriveSettings
from echoscape.scenes.io.target_toml import AnyTarget
from echoscape.scenes.io.user_scene import UserScene
from echoscape.scenes.town.presets import PRESETS
from echoscape.scenes.traffic.plan import TrafficSettings
from echoscape.sim.datasets.layouts.layout import Layout
from echoscape.sim.datasets.layouts.registry import LAYOUTS, LayoutName, home_of
from echoscape.sim.sensor.cts350x import CTS350X
from echoscape.sim.sensor.sensor import Sensor
from echoscape.sim.settings.artefacts import Artefacts
from echoscape.sim.settings.surfaces import SurfaceSettings
from echoscape.sim.settings.tracing import TraceSettings

DEFAULT_PRESET = "town"
OWN = "own"
"""What the preset is called where the scene is one's own."""

_JITTERS = 2.5
"""Standard deviations beyond which no turn's duration is drawn (sim.motion.turns)."""

_POSITIVE = ("traffic.near_m", "traffic.step_s", "drive.knot_s", "drive.corner_m", "drive.wander_length_m")


@dataclass(frozen=True, kw_only=True)
class SimulationConfig:
    """All that decides the bytes of a dataset."""

    preset: str = ""
    """Kind of world: town (where nothing is said), suburb, industrial, motorway, open or empty."""
    seed: int = 0
    """Seed of everything that is drawn: the town, the drive, the traffic, rays, speckle and noise."""
    scans: int = 40
    """Scans to make, four a second of driving."""
    keep_beat: bool = False
    """Keep the sampled beat signal of every scan in OUT/beat, for processing of one's own."""
    sensor: Sensor = CTS350X
    """The radar."""
    layout: LayoutName | None = None
    """Layout of the folder; by default that in which the radar's real scans are published, or Oxford's."""
    trace: TraceSettings = field(default_factory=TraceSettings)
    """How finely and how far a scan is traced."""
    artefacts: Artefacts = field(default_factory=Artefacts)
    """The effects that a scan has."""
    surfaces: SurfaceSettings = field(default_factory=SurfaceSettings)
    """How rough the world is against its materials' own figures."""
    drive: DriveSettings = field(default_factory=DriveSettings)
    """How the car is driven."""
    traffic: TrafficSettings = field(default_factory=TrafficSettings)
    """Who else is on the road; not beside a scene of one's own."""
    scene: UserScene | None = None
    """A scene of one's own in the place of a preset, see `scenes.io.user_scene`; preset is then "own"."""
    targets: tuple[AnyTarget, ...] = ()
    """Test targets put into the world besides those that the scene brings, see `scenes.core.targets`."""
    randomized: bool = False
    """Whether sensor, artefacts and surfaces were drawn about those given (`sim.generation.domain_randomization`)."""

    def __post_init__(self) -> None:
        """Name the world where nothing was said; refuse settings that make no dataset, naming the setting."""
        if self.preset in ("", OWN) and (self.scene is not None or not self.preset):
            object.__setattr__(self, "preset", DEFAULT_PRESET if self.scene is None else OWN)
        elif self.scene is not None:
            raise ValueError(f"preset must not be given beside a scene, got {self.preset!r}")
        if self.scene is not None:
            _check_unsaid("traffic", self.traffic, "which has no traffic")
            _check_unsaid("drive", self.drive, "which brings its drive")
        if self.scene is None and self.preset not in PRESETS:
            raise ValueError(f"preset must be one of {', '.join(PRESETS)}, got {self.preset!r}")
        if self.seed < 0:
            raise ValueError(f"seed must be 0 or more, got {self.seed}")
        if self.layout is not None and self.layout not in LAYOUTS:
            raise ValueError(f"layout must be one of {', '.join(LAYOUTS)}, got {self.layout!r}")
        if self.scans < 1:
            raise ValueError(f"scans must be 1 or more, got {self.scans}")
        if not 0 <= self.sensor.rotation_jitter_s < 0.1 / self.sensor.rotation_hz:
            raise ValueError(
                "sensor.rotation_jitter_s must be 0 or more and below a tenth of a turn, "
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
        """The layout of the dataset's folder."""
        return home_of(self.sensor.name) if self.layout is None else LAYOUTS[self.layout]

    @property
    def duration_s(self) -> float:
        """Length of a drive that outlasts the scans [s], however long their turns turn out."""
        return 1.0 + self.scans * self.longest_turn_s

    @property
    def longest_turn_s(self) -> float:
        """The longest that a turn can last [s]."""
        return 1 / self.sensor.rotation_hz + _JITTERS * self.sensor.rotation_jitter_s


def _check_unsaid(name: str, settings: object, why: str) -> None:
    """Refuse settings of which something is said beside a scene of one's own, where they would do nothing."""
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
    """Refuse a number of drive or traffic that is not finite, negative, or 0 where that makes no sense."""
    if not math.isfinite(value):
        raise ValueError(f"{name} must be finite, got {value}")
    if value < 0 or (value == 0 and name in _POSITIVE):
        raise ValueError(f"{name} must be {'above 0' if name in _POSITIVE else '0 or more'}, got {value:g}")
