"""Who may cross a junction when: lanes that come too near one another are held by one vehicle at a time.

The radar car's times are known beforehand and come first; everybody else asks, and waits at the stop line until
the lanes across are free for as long as the crossing takes.
"""

import itertools
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.spatial import cKDTree

from echoscape.scenes.drive import Drive
from echoscape.scenes.roads import RoadGraph

_CLEAR_M = 3.0
_SAMPLE_M = 1.0
_LEAD_S = 5.0
_TAIL_S = 0.7
_SLACK_M = 1.5


def conflicting_lanes(roads: RoadGraph) -> NDArray[np.bool_]:
    """Return (N, N) whether two lanes inside junctions come within a vehicle's width; never for street lanes."""
    inside = [lane for lane in roads.lanes if lane.kind != "street"]
    table = np.zeros((len(roads.lanes), len(roads.lanes)), dtype=bool)
    if not inside:
        return table
    spread = [lane.centre[:: max(int(_SAMPLE_M * len(lane.centre) / lane.length_m), 1)] for lane in inside]
    lane = np.repeat([lane.id for lane in inside], [len(points) for points in spread])
    pairs = cKDTree(np.concatenate(spread)).query_pairs(_CLEAR_M + _SAMPLE_M / 2, output_type="ndarray")
    table[lane[pairs[:, 0]], lane[pairs[:, 1]]] = True
    table |= table.T
    np.fill_diagonal(table, True)
    for own in inside:
        for after in own.successors:  # lanes of a ring that follow one another touch, but that is no conflict
            table[own.id, after] = table[after, own.id] = False
    return table & _inside_mask(roads)


def _inside_mask(roads: RoadGraph) -> NDArray[np.bool_]:
    inside = np.array([lane.kind != "street" for lane in roads.lanes])
    return inside[:, None] & inside


@dataclass(frozen=True, kw_only=True)
class EgoCrossings:
    """The radar car's crossings in the order driven: C rows.

    approach (C,) street lane before, entry (C,) first lane across, enter_s and leave_s (C,) [s], and blocks (N, C):
    whether a lane conflicts with the crossing.
    """

    approach: NDArray[np.intp]
    entry: NDArray[np.intp]
    enter_s: NDArray[np.float64]
    leave_s: NDArray[np.float64]
    blocks: NDArray[np.bool_]

    def free(self, run: tuple[int, ...], approach: int, *, now_s: float, until_s: float) -> bool:
        """Tell whether `run` can be crossed from `now_s` to `until_s` without the radar car in the way.

        Before the radar car on its own approach everyone may go; behind it, those that take the same lanes.
        """
        busy = (self.enter_s - _LEAD_S < until_s) & (self.leave_s + _TAIL_S > now_s)
        ahead = (self.approach == approach) & ((self.enter_s > now_s) | (self.entry == run[0]))
        return not bool((self.blocks[list(run)].any(axis=0) & busy & ~ahead).any())


def ego_crossings(drive: Drive, roads: RoadGraph, conflict: NDArray[np.bool_], *, length_m: float) -> EgoCrossings:
    """Find when the radar car, `length_m` [m] long, is inside which junction."""
    route = drive.route
    inside = [roads.lanes[lane].kind != "street" for lane in route.lanes]
    runs = [
        [place for place, _ in group]
        for is_inside, group in itertools.groupby(enumerate(inside), key=lambda row: row[1])
        if is_inside
    ]
    begin = np.array([route.begins_m[run[0]] for run in runs]) - length_m / 2 - _SLACK_M
    end = np.array([route.ends_m[run[-1]] for run in runs]) + length_m / 2 + _SLACK_M
    blocks = [conflict[:, [route.lanes[place] for place in run]].any(axis=1) for run in runs]
    return EgoCrossings(
        approach=np.array([route.lanes[run[0] - 1] if run[0] else -1 for run in runs], dtype=np.intp),
        entry=np.array([route.lanes[run[0]] for run in runs], dtype=np.intp),
        enter_s=_reached(drive, begin),
        leave_s=_reached(drive, end),
        blocks=np.array(blocks, dtype=bool).reshape(len(runs), len(roads.lanes)).T,
    )


def _reached(drive: Drive, travel_m: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return when (C,) [s] the drive passes `travel_m` (C,), infinite where it never does."""
    place = np.searchsorted(drive.travel_m, travel_m, side="right")
    time = np.append(drive.trajectory.time_s, np.inf)
    return time[place]


class Reservations:
    """Who holds which lanes inside junctions."""

    def __init__(self, conflict: NDArray[np.bool_], ego: EgoCrossings) -> None:
        """Start with all junctions free."""
        self._conflict = conflict
        self._ego = ego
        self._held: dict[int, tuple[int, tuple[int, ...]]] = {}

    def holds(self, vehicle: int) -> bool:
        """Tell whether `vehicle` may cross, or crosses."""
        return vehicle in self._held

    def ask(
        self, vehicle: int, approach: int, run: tuple[int, ...], *, now_s: float, until_s: float
    ) -> bool:
        """Grant `run`, come at from `approach`, if nobody is in the way until `until_s`."""
        for other_approach, other_run in self._held.values():
            behind = other_approach == approach and other_run[0] == run[0]
            if not behind and self._conflict[np.ix_(run, other_run)].any():
                return False
        if not self._ego.free(run, approach, now_s=now_s, until_s=until_s):
            return False
        self._held[vehicle] = (approach, run)
        return True

    def release_behind(self, vehicle: int, lane: int) -> None:
        """Give back what `vehicle` holds, now that it is on street lane `lane`, unless that is its approach."""
        if vehicle in self._held and self._held[vehicle][0] != lane:
            del self._held[vehicle]
