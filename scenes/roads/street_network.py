"""The street network: junctions, and streets of several types between them."""

from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from echoscape.scenes.geometry.curves import Line, arc_length


@dataclass(frozen=True, kw_only=True)
class StreetType:
    """Cross-section and speed limit of a street.

    Attributes:
        name: Name of the type.
        lanes: Number of lanes in each direction; of a one-way street, of all its lanes.
        lane_width_m: Width of a lane [m].
        parking_m: Width of the parking strip on each side [m], 0 for none.
        pavement_m: Width of the pavement on each side [m], 0 for none.
        speed_limit_mps: Speed limit [m/s].
        oneway: Whether all lanes lead from the start of the street to its end.
    """

    name: str
    lanes: int
    lane_width_m: float
    parking_m: float
    pavement_m: float
    speed_limit_mps: float
    oneway: bool = False

    @property
    def half_width_m(self) -> float:
        """Distance from the middle of the carriageway to the kerb [m]."""
        return self.lane_edge_m + self.parking_m

    @property
    def lane_edge_m(self) -> float:
        """Distance from the middle of the carriageway to the outer edge of the outermost lane [m]."""
        return self.lanes * self.lane_width_m / (2 if self.oneway else 1)


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
    """A street between two junctions.

    Attributes:
        start: Index of the junction at which it starts.
        end: Index of the junction at which it ends.
        line: Its centre line (P, 2) [m].
        type: Its cross-section.
    """

    start: int
    end: int
    line: Line
    type: StreetType

    @property
    def length_m(self) -> float:
        """Length of the centre line [m]."""
        return float(arc_length(self.line)[-1])


@dataclass(frozen=True, kw_only=True)
class OuterStreet:
    """A street beyond those that are driven: it has a carriageway but no lanes.

    Attributes:
        line: Its centre line (P, 2) [m].
        type: Its cross-section.
    """

    line: Line
    type: StreetType


@dataclass(frozen=True, kw_only=True)
class Network:
    """Junctions and the streets between them.

    Attributes:
        junctions: Positions of the junctions (J, 2) float64 [m].
        streets: The streets that are driven.
        roundabouts: Indices of the junctions that are roundabouts.
        outskirts: The streets around them, which no vehicle drives on.
    """

    junctions: NDArray[np.float64]
    streets: tuple[Street, ...]
    roundabouts: frozenset[int] = field(default_factory=frozenset)
    outskirts: tuple[OuterStreet, ...] = ()

    def arms(self, junction: int) -> list[tuple[int, bool]]:
        """List the street ends at a junction.

        Args:
            junction: Index of the junction.

        Returns:
            For each street end, the index of the street and whether the street starts here.
        """
        ends = [(number, True) for number, street in enumerate(self.streets) if street.start == junction]
        return ends + [
            (number, False) for number, street in enumerate(self.streets) if street.end == junction
        ]
