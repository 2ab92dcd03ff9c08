"""Who may cross a junction when: lanes that come too near one another are held by one vehicle at a time.

The radar car's times are known beforehand and come first; everybody else asks, and waits at the stop line
until the lanes across are free for as long as the crossing takes.
"""

import itertools
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.spatial import KDTree

from echoscape.scenes.core.lane_graph import RoadGraph
from echoscape.scenes.driving.ego_drive import EgoDrive
from echoscape.scenes.traffic.car_following import NOTHING

_CLEAR_M = 3.0
_SAMPLE_M = 1.0
_LEAD_S = 5.0
_TAIL_S = 0.7
_SLACK_M = 1.5
_LATER_S = 2.5


def conflicting_lanes(roads: RoadGraph) -> NDArray[np.bool_]:
    """Return (N, N) whether two lanes in junctions come within a vehicle's width; never for street lanes."""
    inside = [lane for lane in roads.lanes if lane.kind != "street"]
    table = np.zeros((len(roads.lanes), len(roads.lanes)), dtype=bool)
    if not inside:
        return table
    spread = [lane.centre[:: max(int(_SAMPLE_M * len(lane.centre) / lane.length_m), 1)] for lane in inside]
    lane = np.repeat([lane.id for lane in inside], [len(points) for points in spread])
    pairs = KDTree(np.concatenate(spread)).query_pairs(_CLEAR_M + _SAMPLE_M / 2, output_type="ndarray")
    table[lane[pairs[:, 0]], lane[pairs[:, 1]]] = True
    table |= table.T
    np.fill_diagonal(table, True)
    for own in inside:
        for after in own.successors:  # lanes of a ring that follow one another touch, but that is no conflict
            table[own.id, after] = table[after, own.id] = False
    is_inside = np.array([lane.kind != "street" for lane in roads.lanes])
    return table & is_inside[:, None] & is_inside


class EgoCourse:
    """The radar car's drive on the clock of the simulation: station_m and speed_mps (T,) a step."""

    def __init__(self, drive: EgoDrive, *, steps: int, step_s: float, lookahead: int) -> None:
        """Sample `drive` for `steps` steps, and a little longer: it stands where it ends."""
        self._later = int(_LATER_S / step_s)
        self._lookahead = lookahead
        time = step_s * np.arange(steps + 1 + self._later, dtype=np.float64)
        velocity = drive.velocity(np.minimum(time, drive.duration_s))
        self._travel_m = drive.travel(time)
        self._place, self.station_m = drive.route.locate(self._travel_m)
        self.speed_mps = np.hypot(velocity[:, 0], velocity[:, 1])
        self._route = list(drive.route.lanes)
        self._lanes = np.array(self._route + [NOTHING] * lookahead, dtype=np.intp)

    def lanes(self, now: int) -> tuple[NDArray[np.intp], int]:
        """Return the lanes (Q,) from the present one on, and the one before, at step `now`."""
        place = int(self._place[now])
        return self._lanes[place : place + self._lookahead], int(self._lanes[place - 1]) if place else NOTHING

    def way_from(self, lane: int, now: int) -> list[int]:
        """Return the lanes the car will take from `lane` on if it comes there soon, else nothing."""
        coming = self._route[self._place[now] :][: 2 * self._lookahead]
        return coming[coming.index(lane) :] if lane in coming else []

    def later(self, now: int) -> tuple[float, float]:
        """Return how far [m] the car gets while others must be ahead of it, and its speed then [m/s]."""
        then = now + self._later
        return float(self._travel_m[then] - self._travel_m[now]), float(self.speed_mps[then])


@dataclass(frozen=True, kw_only=True)
class EgoCrossings:
    """The radar car's crossings in the order driven: C rows.

    approach (C,) street lane before, entry (C,) first lane across, enter_s and leave_s (C,) [s], and
    blocks (N, C) whether a lane conflicts with the crossing.
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


def ego_crossings(
    drive: EgoDrive, roads: RoadGraph, conflict: NDArray[np.bool_], *, length_m: float
) -> EgoCrossings:
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


def _reached(drive: EgoDrive, travel_m: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return when (C,) [s] the drive passes `travel_m` (C,), infinite where it never does."""
    place = np.searchsorted(drive.travel_m, travel_m, side="right")
    time = np.append(drive.trajectory.time_s, np.inf)
    return time[place]


class Reservations:
    """Who holds which lanes inside junctions."""

    def __init__(self, conflict: NDArray[np.bool_], ego: EgoCrossings) -> None:
        """Start with all junctions free."""
        # Sets, not the table: this is asked some hundred times a step, of a handful of lanes each time.
        self._conflict = [frozenset(np.flatnonzero(row).tolist()) for row in conflict]
        self._ego = ego
        self._held: dict[tuple[int, int], tuple[tuple[int, ...], bool]] = {}

    def holds(self, vehicle: int, approach: int) -> bool:
        """Tell whether `vehicle` may cross, or crosses, at the end of street lane `approach`."""
        return (vehicle, approach) in self._held

    def ask(
        self,
        vehicle: int,
        approach: int,
        run: tuple[int, ...],
        *,
        now_s: float,
        until_s: float,
        compact: bool,
    ) -> bool:
        """Grant `run`, come at from `approach`, if nobody is in the way until `until_s`.

        One may go in behind another from the same approach if both are `compact`, short for the bends of
        their run.
        """
        against = frozenset().union(*(self._conflict[lane] for lane in run))
        for (other, other_approach), (other_run, other_compact) in self._held.items():
            if other == vehicle:
                continue
            behind = other_approach == approach and other_run[0] == run[0] and compact and other_compact
            if not behind and not against.isdisjoint(other_run):
                return False
        if not self._ego.free(run, approach, now_s=now_s, until_s=until_s):
            return False
        self._held[vehicle, approach] = (run, compact)
        return True

    def release_behind(self, vehicle: int, lane: int) -> None:
        """Give back what `vehicle` holds of junctions but that at the end of its street lane `lane`."""
        for key in [key for key in self._held if key[0] == vehicle and key[1] != lane]:
            del self._held[key]
