"""The road graph: lanes with smooth centre lines, connected through junctions by turning lanes.

Traffic keeps to the right. The course of a vehicle is a walk along `successors`; the centre lines of
successive lanes meet with equal position and direction.
"""

from dataclasses import dataclass
from typing import Literal

import numpy as np
from numpy.typing import NDArray

LaneKind = Literal["street", "turn", "u_turn", "roundabout"]


@dataclass(frozen=True, kw_only=True)
class Lane:
    """One lane, driven in one direction.

    Attributes:
        id: Index of the lane in its graph.
        kind: "street" between junctions; "turn", "u_turn" and "roundabout" within them.
        centre: Smooth centre line (P, 2) float64 [m], samples at most 1 m apart.
        width_m: Width [m].
        speed_limit_mps: Speed limit [m/s].
        successors: Ids of the lanes that can be driven next.
        opposite: Id of the lane of the same street in the other direction, None if there is none.
        junction: Index of the junction that the lane crosses, None for a street lane.
        yields: Whether traffic on the lane gives way at its end.
    """

    id: int
    kind: LaneKind
    centre: NDArray[np.float64]
    width_m: float
    speed_limit_mps: float
    successors: tuple[int, ...]
    opposite: int | None = None
    junction: int | None = None
    yields: bool = False

    @property
    def length_m(self) -> float:
        """Length of the centre line [m]."""
        return float(np.hypot(*np.diff(self.centre, axis=0).T).sum())


@dataclass(frozen=True, kw_only=True)
class RoadGraph:
    """The lanes, footpaths and kerbs of a scene.

    Attributes:
        lanes: All lanes; `lanes[i].id == i`.
        junctions: Centres of the junctions (J, 2) float64 [m].
        footpaths: Lines along the pavements on which people walk, each (P, 2) float64 [m].
        kerbs: Closed kerb lines with the asphalt to their left, each (P, 2) float64 [m].
    """

    lanes: tuple[Lane, ...]
    junctions: NDArray[np.float64]
    footpaths: tuple[NDArray[np.float64], ...] = ()
    kerbs: tuple[NDArray[np.float64], ...] = ()
