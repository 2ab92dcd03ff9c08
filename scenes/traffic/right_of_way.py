"""Right of way: lanes of a junction that conflict are held by one vehicle at a time.

The times of the ego vehicle are known in advance and have priority. Every other vehicle requests the junction
and waits at the stop line until the conflicting lanes are free for as long as the crossing takes.
"""

import itertools
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.spatial import KDTree

from echoscape.scenes.core.lane_graph import RoadGraph
from echoscape.scenes.driving.ego_drive import EgoDrive
from echoscape.scenes.traffic.car_following import NO_LANE

_CLEAR_M = 3.0
_SAMPLE_M = 1.0
_LEAD_S = 5.0
_TAIL_S = 0.7
_SLACK_M = 1.5
_LATER_S = 2.5


def conflicting_lanes(roads: RoadGraph) -> NDArray[np.bool_]:
    """Find pairs of lanes within junctions that come within the width of a vehicle.

    Args:
        roads: The road graph.

    Returns:
        Whether each pair of lanes conflicts (N, N); street lanes never do.
    """
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
    for lane_inside in inside:
        for after in lane_inside.successors:  # successive lanes touch without a conflict
            table[lane_inside.id, after] = table[after, lane_inside.id] = False
    is_inside = np.array([lane.kind != "street" for lane in roads.lanes])
    return table & is_inside[:, None] & is_inside


class EgoSchedule:
    """The drive of the ego vehicle at the time steps of the simulation.

    Attributes:
        station_m: Distance along its lane at each step (T,) [m].
        speed_mps: Speed at each step (T,) [m/s].
    """

    def __init__(self, drive: EgoDrive, *, steps: int, step_s: float, lookahead: int) -> None:
        """Sample a drive, and a little beyond its end, where the car stands still.

        Args:
            drive: The drive.
            steps: Number of time steps.
            step_s: Time step [s].
            lookahead: Number of lanes that `lanes` returns.
        """
        self._later = int(_LATER_S / step_s)
        self._lookahead = lookahead
        time = step_s * np.arange(steps + 1 + self._later, dtype=np.float64)
        velocity = drive.velocity(np.minimum(time, drive.duration_s))
        self._travel_m = drive.travel(time)
        self._place, self.station_m = drive.route.locate(self._travel_m)
        self.speed_mps = np.hypot(velocity[:, 0], velocity[:, 1])
        self._route = list(drive.route.lanes)
        self._lanes = np.array(self._route + [NO_LANE] * lookahead, dtype=np.intp)

    def lanes(self, now: int) -> tuple[NDArray[np.intp], int]:
        """Return the present and the next lanes.

        Args:
            now: Index of the time step.

        Returns:
            Ids of the lanes from the present one on (Q,), and the id of the lane before.
        """
        place = int(self._place[now])
        return self._lanes[place : place + self._lookahead], int(self._lanes[place - 1]) if place else NO_LANE

    def lanes_from(self, lane: int, now: int) -> list[int]:
        """Return the lanes that the car will take from a lane on.

        Args:
            lane: Id of the lane.
            now: Index of the time step.

        Returns:
            Ids of the lanes; empty if the car does not reach `lane` soon.
        """
        coming = self._route[self._place[now] :][: 2 * self._lookahead]
        return coming[coming.index(lane) :] if lane in coming else []

    def look_ahead(self, now: int) -> tuple[float, float]:
        """Return the progress of the car during the time by which others must stay ahead of it.

        Args:
            now: Index of the time step.

        Returns:
            Distance driven [m] and speed at the end [m/s].
        """
        then = now + self._later
        return float(self._travel_m[then] - self._travel_m[now]), float(self.speed_mps[then])


@dataclass(frozen=True, kw_only=True)
class EgoCrossings:
    """The junctions that the ego vehicle crosses, C in the order driven.

    Attributes:
        approach: Street lane before each (C,), -1 if the drive starts in it.
        entry: First lane within it (C,).
        enter_s: Time at which the car enters (C,) [s].
        leave_s: Time at which it has left (C,) [s].
        blocks: Whether a lane conflicts with the crossing (N, C).
    """

    approach: NDArray[np.intp]
    entry: NDArray[np.intp]
    enter_s: NDArray[np.float64]
    leave_s: NDArray[np.float64]
    blocks: NDArray[np.bool_]

    def is_free(self, run: tuple[int, ...], approach: int, *, now_s: float, until_s: float) -> bool:
        """Check whether the ego vehicle leaves a crossing free.

        Ahead of the ego vehicle on its own approach everyone may go; behind it, those who enter by the same
        lane.

        Args:
            run: Ids of the lanes across the junction.
            approach: Id of the street lane before it.
            now_s: Beginning of the crossing [s].
            until_s: End of the crossing [s].

        Returns:
            Whether it is free.
        """
        busy = (self.enter_s - _LEAD_S < until_s) & (self.leave_s + _TAIL_S > now_s)
        ahead = (self.approach == approach) & ((self.enter_s > now_s) | (self.entry == run[0]))
        return not bool((self.blocks[list(run)].any(axis=0) & busy & ~ahead).any())


def ego_crossings(
    drive: EgoDrive, roads: RoadGraph, conflict: NDArray[np.bool_], *, length_m: float
) -> EgoCrossings:
    """Find when the ego vehicle is inside which junction.

    Args:
        drive: The drive of the ego vehicle.
        roads: The road graph.
        conflict: Whether each pair of lanes conflicts (N, N).
        length_m: Length of the ego vehicle [m].

    Returns:
        Its crossings.
    """
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
    """Return the times (C,) [s] at which the drive passes `travel_m` (C,), inf where it never does."""
    place = np.searchsorted(drive.travel_m, travel_m, side="right")
    time = np.append(drive.trajectory.time_s, np.inf)
    return time[place]


class Reservations:
    """Reservations of lanes within junctions."""

    def __init__(self, conflict: NDArray[np.bool_], ego: EgoCrossings) -> None:
        """Start with all junctions free.

        Args:
            conflict: Whether each pair of lanes conflicts (N, N).
            ego: Crossings of the ego vehicle.
        """
        # Sets are faster than the table: there are some hundred requests a step, each for a few lanes.
        self._conflict = [frozenset(np.flatnonzero(row).tolist()) for row in conflict]
        self._ego = ego
        self._held: dict[tuple[int, int], tuple[tuple[int, ...], bool]] = {}

    def holds(self, vehicle: int, approach: int) -> bool:
        """Check for a reservation.

        Args:
            vehicle: Index of the vehicle.
            approach: Id of the street lane before the junction.

        Returns:
            Whether the vehicle may cross, or is crossing, the junction.
        """
        return (vehicle, approach) in self._held

    def request(
        self,
        vehicle: int,
        approach: int,
        run: tuple[int, ...],
        *,
        now_s: float,
        until_s: float,
        compact: bool,
    ) -> bool:
        """Reserve the lanes across a junction if no other vehicle conflicts.

        A vehicle may follow another from the same approach if both are compact.

        Args:
            vehicle: Index of the vehicle.
            approach: Id of the street lane before the junction.
            run: Ids of the lanes across the junction.
            now_s: Beginning of the crossing [s].
            until_s: End of the crossing [s].
            compact: Whether the vehicle is short for the bends of its lanes.

        Returns:
            Whether the lanes were reserved.
        """
        against = frozenset().union(*(self._conflict[lane] for lane in run))
        for (other, other_approach), (other_run, other_compact) in self._held.items():
            if other == vehicle:
                continue
            behind = other_approach == approach and other_run[0] == run[0] and compact and other_compact
            if not behind and not against.isdisjoint(other_run):
                return False
        if not self._ego.is_free(run, approach, now_s=now_s, until_s=until_s):
            return False
        self._held[vehicle, approach] = (run, compact)
        return True

    def release_passed(self, vehicle: int, lane: int) -> None:
        """Release the reservations of a vehicle except the one at the end of its present street lane.

        Args:
            vehicle: Index of the vehicle.
            lane: Id of that street lane.
        """
        for key in [key for key in self._held if key[0] == vehicle and key[1] != lane]:
            del self._held[key]
