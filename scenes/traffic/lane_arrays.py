"""The lanes as arrays for the traffic simulation: lengths, speed caps with braking distance, successors."""

import numpy as np
from numpy.typing import NDArray

from echoscape.scenes.core.headings import unwrapped_headings
from echoscape.scenes.core.lane_graph import Lane, RoadGraph

BEND_MPS2 = 1.8
BRAKE_MPS2 = 1.5

_GRID_M = 1.0


class LaneArrays:
    """The lanes of a road graph as arrays over N lane ids.

    Attributes:
        lanes: The lanes.
        length_m: Lengths (N,) [m].
        inside: Whether a lane lies within a junction (N,).
        yields: Whether traffic gives way at its end (N,).
        entry_cap_mps: Highest comfortable speed at its beginning (N,) [m/s].
        min_radius_m: Smallest radius of curvature (N,) [m].
    """

    def __init__(self, roads: RoadGraph) -> None:
        """Tabulate a road graph.

        Args:
            roads: The road graph.
        """
        self.lanes = roads.lanes
        self.length_m = np.array([lane.length_m for lane in roads.lanes])
        self.inside = np.array([lane.kind != "street" for lane in roads.lanes])
        self.yields = np.array([lane.yields for lane in roads.lanes])
        rows = [_lane_caps(lane) for lane in roads.lanes]
        self._offset = np.cumsum([0] + [len(caps) for caps, _ in rows[:-1]])
        self._last = np.array([len(caps) - 1 for caps, _ in rows])
        self._caps = np.concatenate([caps for caps, _ in rows])
        self.entry_cap_mps = self._caps[self._offset]
        self.min_radius_m = np.array([radius for _, radius in rows])

    def cap_mps(self, lane: NDArray[np.intp], station_m: NDArray[np.float64]) -> NDArray[np.float64]:
        """Look up the highest comfortable speed.

        Args:
            lane: Lane ids (...).
            station_m: Distances along the lanes (...) [m].

        Returns:
            Speeds (...) [m/s].
        """
        index = np.minimum((station_m / _GRID_M).astype(np.intp), self._last[lane])
        return self._caps[self._offset[lane] + index]

    def choose(
        self,
        planned: list[int],
        *,
        lane_weight: NDArray[np.float64],
        may_use: NDArray[np.bool_],
        rng: np.random.Generator,
    ) -> int:
        """Draw the lane that follows a planned path; U-turns are taken only at dead ends.

        Args:
            planned: Ids of the lanes so far.
            lane_weight: Relative probability of each lane (N,), above 0.
            may_use: Lanes that the vehicle may use (N,) bool.
            rng: Random generator.

        Returns:
            Id of the next lane.
        """
        lane = planned[-1]
        options = [after for after in self.lanes[lane].successors if may_use[after]]
        ahead = [option for option in options if self.lanes[option].kind != "u_turn"] or options
        if self.inside[lane]:  # leave a roundabout before it closes
            ahead = [
                option for option in ahead if not set(self.lanes[option].successors) & set(planned)
            ] or ahead
        weight = lane_weight[ahead]
        return ahead[int(rng.choice(len(ahead), p=weight / weight.sum()))]


def _lane_caps(lane: Lane) -> tuple[NDArray[np.float64], float]:
    """Return the speed caps of a lane every metre (S,) [m/s] and its smallest radius [m]."""
    step = np.diff(lane.centre, axis=0)
    length = np.hypot(*step.T)
    heading = unwrapped_headings(step)
    station = np.cumsum(length) - length / 2
    grid = _GRID_M * np.arange(max(int(np.ceil(length.sum() / _GRID_M)), 2) + 1)
    smooth = np.interp(grid, station, heading)
    bend = np.maximum(np.abs(np.gradient(smooth, _GRID_M)), 1e-6)
    square = np.minimum(BEND_MPS2 / bend, lane.speed_limit_mps**2)
    room = 2 * BRAKE_MPS2 * grid
    square = np.minimum.accumulate((square + room)[::-1])[::-1] - room
    return np.sqrt(square), float(1 / bend.max())
