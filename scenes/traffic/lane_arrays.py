"""What traffic needs to know of the lanes, as arrays: lengths, speeds with room to brake, ways on."""

import numpy as np
from numpy.typing import NDArray

from echoscape.scenes.core.lane_graph import Lane, RoadGraph

BEND_MPS2 = 1.8
BRAKE_MPS2 = 1.5

_GRID_M = 1.0


class LaneTables:
    """The lanes of a road graph as arrays over lane ids (N,).

    length_m; inside: whether within a junction; yields; start_cap_mps: the speed to begin a lane with;
    tightest_m: the smallest radius.
    """

    def __init__(self, roads: RoadGraph) -> None:
        """Tabulate `roads`."""
        self.lanes = roads.lanes
        self.length_m = np.array([lane.length_m for lane in roads.lanes])
        self.inside = np.array([lane.kind != "street" for lane in roads.lanes])
        self.yields = np.array([lane.yields for lane in roads.lanes])
        rows = [_lane_caps(lane) for lane in roads.lanes]
        self._offset = np.cumsum([0] + [len(caps) for caps, _ in rows[:-1]])
        self._last = np.array([len(caps) - 1 for caps, _ in rows])
        self._caps = np.concatenate([caps for caps, _ in rows])
        self.start_cap_mps = self._caps[self._offset]
        self.tightest_m = np.array([radius for _, radius in rows])

    def cap_mps(self, lane: NDArray[np.intp], station_m: NDArray[np.float64]) -> NDArray[np.float64]:
        """Return the highest comfortable speed (...) [m/s] at `station_m` (...) along `lane` (...)."""
        index = np.minimum((station_m / _GRID_M).astype(np.intp), self._last[lane])
        return self._caps[self._offset[lane] + index]

    def choose(
        self,
        planned: list[int],
        *,
        liking: NDArray[np.float64],
        may_use: NDArray[np.bool_],
        rng: np.random.Generator,
    ) -> int:
        """Draw what follows the lanes `planned`, of those that one `may_use` (N,): u-turns only at dead ends.

        `liking` (N,) > 0 weighs the lanes.
        """
        lane = planned[-1]
        options = [after for after in self.lanes[lane].successors if may_use[after]]
        ahead = [option for option in options if self.lanes[option].kind != "u_turn"] or options
        if self.inside[lane]:  # leave a roundabout before it closes
            ahead = [
                option for option in ahead if not set(self.lanes[option].successors) & set(planned)
            ] or ahead
        weight = liking[ahead]
        return ahead[int(rng.choice(len(ahead), p=weight / weight.sum()))]


def _lane_caps(lane: Lane) -> tuple[NDArray[np.float64], float]:
    """Return the speed (S,) [m/s] every metre of a lane, with room to brake, and its smallest radius [m]."""
    step = np.diff(lane.centre, axis=0)
    length = np.hypot(*step.T)
    heading = np.unwrap(np.arctan2(step[:, 1], step[:, 0]))
    station = np.cumsum(length) - length / 2
    grid = _GRID_M * np.arange(max(int(np.ceil(length.sum() / _GRID_M)), 2) + 1)
    smooth = np.interp(grid, station, heading)
    bend = np.maximum(np.abs(np.gradient(smooth, _GRID_M)), 1e-6)
    square = np.minimum(BEND_MPS2 / bend, lane.speed_limit_mps**2)
    room = 2 * BRAKE_MPS2 * grid
    square = np.minimum.accumulate((square + room)[::-1])[::-1] - room
    return np.sqrt(square), float(1 / bend.max())
