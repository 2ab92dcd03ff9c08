"""The road graph: lanes with smooth centre lines, joined through junctions by turning lanes.

Traffic keeps to the right. A drive or a mover is a walk along `successors`; the centre lines of successive
lanes join end to end with equal position and direction.
"""

from dataclasses import dataclass
from typing import Literal

import numpy as np
from numpy.typing import NDArray

LaneKind = Literal["street", "turn", "u_turn", "roundabout"]


@dataclass(frozen=True, kw_only=True)
class Lane:
    """One direction of travel.

    `centre` (P, 2) float64 [m] is sampled at most 1 m apart and is smooth; lanes of kind "turn" and "u_turn"
    cross the junction `junction`, "street" lanes lie between junctions. `opposite` is the lane of the same
    street in the other direction, `yields` says that traffic on it gives way at its end.
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
        """Length of the centre line."""
        return float(np.hypot(*np.diff(self.centre, axis=0).T).sum())


@dataclass(frozen=True, kw_only=True)
class RoadGraph:
    """All lanes (`lanes[i].id == i`), the pavements' walking lines and the kerbs (each (P, 2) float64 [m]).

    `junctions` (J, 2) float64 are the junctions' middles; `kerbs` are closed lines with asphalt to the left.
    """

    lanes: tuple[Lane, ...]
    junctions: NDArray[np.float64]
    walks: tuple[NDArray[np.float64], ...] = ()
    kerbs: tuple[NDArray[np.float64], ...] = ()
