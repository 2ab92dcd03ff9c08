"""The street network: junctions, and streets of several widths that curve between them.

A smoothly bent chart is split again and again across its longer side, as towns grow (compare Parish & Muller,
SIGGRAPH 2001, and the block subdivision of Vanegas et al., Eurographics 2012); then spurs and roundabouts.
"""

from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from echoscape.scenes.geometry.curves import Line, arc_length, resampled, smallest_radius


@dataclass(frozen=True, kw_only=True)
class StreetType:
    """The cross-section of a street and how fast one drives on it.

    `lanes` is the number a direction; `parking_m` the width of the strip for parked vehicles on each side.
    """

    name: str
    lanes: int
    lane_width_m: float
    parking_m: float
    pavement_m: float
    speed_limit_mps: float

    @property
    def half_width_m(self) -> float:
        """From the middle of the carriageway to the kerb [m]."""
        return self.lanes * self.lane_width_m + self.parking_m

    @property
    def lane_edge_m(self) -> float:
        """From the middle of the carriageway to the outer edge of its outermost lane [m]."""
        return self.lanes * self.lane_width_m


AVENUE = StreetType(
    name="avenue", lanes=2, lane_width_m=3.3, parking_m=2.5, pavement_m=4.0, speed_limit_mps=13.4
)
STREET = StreetType(
    name="street", lanes=1, lane_width_m=3.25, parking_m=2.5, pavement_m=2.6, speed_limit_mps=13.4
)
PLAIN = StreetType(
    name="plain", lanes=1, lane_width_m=3.25, parking_m=0.0, pavement_m=2.4, speed_limit_mps=13.4
)
NARROW = StreetType(
    name="narrow", lanes=1, lane_width_m=2.75, parking_m=0.0, pavement_m=2.2, speed_limit_mps=9.0
)
ESTATE = StreetType(
    name="estate", lanes=1, lane_width_m=3.0, parking_m=2.5, pavement_m=2.2, speed_limit_mps=9.0
)
WORKS = StreetType(
    name="works", lanes=1, lane_width_m=3.6, parking_m=3.2, pavement_m=2.2, speed_limit_mps=13.4
)
COUNTRY = StreetType(
    name="country", lanes=1, lane_width_m=3.4, parking_m=0.0, pavement_m=0.0, speed_limit_mps=22.0
)


@dataclass(frozen=True, kw_only=True)
class Street:
    """A street from junction `start` to junction `end` along its middle line (P, 2) [m]."""

    start: int
    end: int
    line: Line
    type: StreetType

    @property
    def length_m(self) -> float:
        """Length of the middle line."""
        return float(arc_length(self.line)[-1])


@dataclass(frozen=True, kw_only=True)
class Network:
    """Junctions (J, 2) float64 [m], the streets between them, and which junctions are roundabouts."""

    junctions: NDArray[np.float64]
    streets: tuple[Street, ...]
    roundabouts: frozenset[int] = field(default_factory=frozenset)

    def arms(self, junction: int) -> list[tuple[int, bool]]:
        """Return (street, does it start here) of every street end at `junction`."""
        ends = [(number, True) for number, street in enumerate(self.streets) if street.start == junction]
        return ends + [
            (number, False) for number, street in enumerate(self.streets) if street.end == junction
        ]


@dataclass(frozen=True, kw_only=True)
class Growth:
    """How a town's streets grow.

    `block_m2` is the area at which blocks stop splitting; `swirl_rad` and `shear` bend the chart; `bow` is
    the greatest sideways bow of a street as a share of its length; `spurs` is the share of blocks with a dead
    end, `removed` the share of streets taken away again.
    """

    half_size_m: tuple[float, float] = (590.0, 560.0)
    block_m2: float = 15500.0
    swirl_rad: float = 0.6
    shear: float = 0.35
    wave_m: float = 600.0
    bow: float = 0.03
    spurs: float = 0.15
    removed: float = 0.10
    roundabouts: int = 2
    types: tuple[StreetType, ...] = (AVENUE, STREET, STREET, PLAIN, NARROW)
    shortest_m: float = 52.0


class Chart:
    """A smooth map from the plane to the plane, near area-preserving: a swirl and a few shearing waves."""

    def __init__(self, growth: Growth, *, rng: np.random.Generator) -> None:
        self._swirl_rad = growth.swirl_rad * rng.choice([-1.0, 1.0])
        self._reach_m = 0.62 * min(growth.half_size_m)
        angle = rng.uniform(0, np.pi) + np.arange(3) * np.pi / 3 + rng.uniform(-0.3, 0.3, 3)
        wave = growth.wave_m * rng.uniform(0.8, 1.3, 3)
        self._waves = (2 * np.pi / wave)[:, None] * np.stack([np.cos(angle), np.sin(angle)], axis=-1)
        self._height_m = growth.shear / 3 * wave / (2 * np.pi)
        self._phase = rng.uniform(0, 2 * np.pi, 3)
        self._turn_rad = rng.uniform(0, np.pi)

    def __call__(self, points: Line) -> Line:
        """Return the (..., 2) places of chart points (..., 2)."""
        angle = self._turn_rad + self._swirl_rad * np.exp(-np.sum(points**2, axis=-1) / self._reach_m**2)
        cos, sin = np.cos(angle), np.sin(angle)
        x, y = points[..., 0], points[..., 1]
        places = np.stack([cos * x - sin * y, sin * x + cos * y], axis=-1)
        for wave, height, phase in zip(self._waves, self._height_m, self._phase, strict=True):
            across = np.array([-wave[1], wave[0]]) / np.linalg.norm(wave)
            places = places + height * np.sin(points @ wave + phase)[..., None] * across
        return places


def chart_street(chart: Chart, start: Line, end: Line, *, bow: float = 0.0) -> Line:
    """Return the street (P, 2) that is straight from `start` to `end` (2,) on the chart, but for a bow.

    The bow is sin^2-shaped, so that directions at both ends stay; it is made flatter where it would be
    sharper than 60 m.
    """
    share = np.linspace(0.0, 1.0, max(int(np.linalg.norm(end - start)), 12) + 1)[:, None]
    along = end - start
    aside = np.array([-along[1], along[0]]) * bow
    for flatter in (1.0, 0.6, 0.3, 0.0):
        line = chart(start + share * along + flatter * np.sin(np.pi * share) ** 2 * aside)
        if smallest_radius(line) > 60.0:
            break
    return resampled(line, 1.0)
