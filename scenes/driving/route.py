"""A walk on the lane graph: which lanes a car takes, one after the other.

Wandering to little-driven streets alternates with returns that follow earlier stretches forwards or
backwards, so that a long drive sees the same places again from both directions.
"""

from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import NDArray
from scipy.sparse import csr_matrix
from scipy.sparse.csgraph import connected_components, dijkstra

from echoscape.scenes.core.checks import check_between
from echoscape.scenes.core.lane_graph import Lane, RoadGraph

_U_TURN_COST_M = 300.0
_TURN_COST_M_PER_RAD = 40.0
_STRAIGHT_LIKING = 2.0
_MIN_START_LANE_M = 40.0


@dataclass(frozen=True, kw_only=True)
class RouteSettings:
    """How a route mixes new streets with known ones."""

    revisit_share: float = 0.48
    """Share of the street length that is steered to be known ground [m/m]."""
    explore_m: float = 350.0
    """Mean length of an excursion to little-driven streets; returns begin after it [m]."""
    retrace_m: float = 350.0
    """Mean length of the old course that a return follows, either way round [m]."""
    u_turn_every_m: float = 2000.0
    """Distance without a u-turn after which one is due [m]."""

    def __post_init__(self) -> None:
        """Refuse a share that is none, naming the field."""
        check_between(self, revisit_share=(0, 1))


@dataclass(frozen=True, kw_only=True)
class Route:
    """Lanes in the order driven; the drive starts `start_m` into the first and goes `length_m` from there.

    `ends_m` (L,) float64 is the travel at the end of each lane, counted from the beginning of the first.
    """

    lanes: tuple[int, ...]
    ends_m: NDArray[np.float64]
    start_m: float
    length_m: float

    @cached_property
    def begins_m(self) -> NDArray[np.float64]:
        """Travel (L,) at the beginning of each lane [m]."""
        return np.concatenate([[0.0], self.ends_m[:-1]])

    def locate(self, travel_m: NDArray[np.float64]) -> tuple[NDArray[np.intp], NDArray[np.float64]]:
        """Return the place in `lanes` (...) and the distance into that lane (...) [m] at `travel_m` (...)."""
        place = np.searchsorted(self.ends_m, travel_m, side="right").clip(max=len(self.lanes) - 1)
        return place, travel_m - self.begins_m[place]


def plan_route(
    roads: RoadGraph, *, length_m: float, rng: np.random.Generator, settings: RouteSettings | None = None
) -> Route:
    """Walk `length_m` [m] from the middle of a street; raises ValueError where no walk can go on for ever."""
    if not length_m > 0:
        raise ValueError(f"length_m must be above 0, got {length_m}")
    settings = settings or RouteSettings()
    walk = _Walk(LaneNetwork(roads), rng)
    start_m = float(rng.uniform(0.25, 0.5)) * walk.network.lengths_m[walk.lanes[0]]
    while walk.length_m < start_m + length_m:
        if walk.since_u_turn_m > settings.u_turn_every_m:
            walk.turn_round()
            walk.retrace(settings.retrace_m)
        elif walk.length_m > settings.explore_m and walk.revisited_share < settings.revisit_share:
            walk.come_back(settings.retrace_m)
        else:
            walk.explore(float(rng.exponential(settings.explore_m)))
    ends_m = np.cumsum(walk.network.lengths_m[walk.lanes])
    count = int(np.searchsorted(ends_m, start_m + length_m)) + 1
    return Route(lanes=tuple(walk.lanes[:count]), ends_m=ends_m[:count], start_m=start_m, length_m=length_m)


class LaneNetwork:
    """The lane graph as tables: lengths (N,) [m], turn angles (N,) [rad], and what can be driven for ever."""

    def __init__(self, roads: RoadGraph) -> None:
        """Tabulate `roads`."""
        self.lanes = roads.lanes
        self.kerbs = roads.kerbs
        self.lengths_m = np.array([lane.length_m for lane in roads.lanes])
        self.turn_rad = np.array([_turn_angle(lane) for lane in roads.lanes])
        pairs = np.array(
            [(lane.id, after) for lane in roads.lanes for after in lane.successors], dtype=np.intp
        )
        pairs = pairs.reshape(-1, 2)
        u_turn = np.array([lane.kind == "u_turn" for lane in roads.lanes])
        bend = np.where([lane.kind == "turn" for lane in roads.lanes], np.abs(self.turn_rad), 0.0)
        cost = self.lengths_m + _U_TURN_COST_M * u_turn + _TURN_COST_M_PER_RAD * bend
        shape = (len(roads.lanes), len(roads.lanes))
        self.graph = csr_matrix((cost[pairs[:, 1]], (pairs[:, 0], pairs[:, 1])), shape=shape)
        self.endless = self.loop_within(np.ones(len(roads.lanes), dtype=bool))
        if self.endless.sum() < 2:
            raise ValueError("roads must hold a loop of lanes to drive on, got none")

    def loop_within(self, usable: NDArray[np.bool_]) -> NDArray[np.bool_]:
        """Return those of the lanes `usable` (N,) on which one can drive for ever and come everywhere."""
        lanes = np.flatnonzero(usable)
        _, part = connected_components(self.graph[lanes][:, lanes], directed=True, connection="strong")
        loop = np.zeros(len(self.lanes), dtype=bool)
        if len(lanes):
            loop[lanes] = part == np.bincount(part, weights=self.lengths_m[lanes]).argmax()
        return loop if loop.sum() > 1 else np.zeros_like(loop)  # one lane by itself leads nowhere

    def way(self, start: int, goal: int) -> list[int]:
        """Return the lanes of the shortest way after `start` up to `goal`; empty where there is none."""
        _, before = dijkstra(self.graph, indices=start, return_predecessors=True)
        return _traced(before, start, goal)

    def way_to_u_turn(self, start: int) -> list[int]:
        """Return the lanes of the shortest way after `start` up to a u-turn; empty where there is none."""
        cost, before = dijkstra(self.graph, indices=start, return_predecessors=True)
        u_turns = [lane.id for lane in self.lanes if lane.kind == "u_turn" and self.endless[lane.id]]
        return _traced(before, start, min(u_turns, key=lambda lane: cost[lane])) if u_turns else []


def _traced(before: NDArray[np.int32], start: int, goal: int) -> list[int]:
    lanes: list[int] = []
    while goal != start:
        if goal < 0:
            return []
        lanes.append(goal)
        goal = int(before[goal])
    return lanes[::-1]


def _turn_angle(lane: Lane) -> float:
    step = np.diff(lane.centre, axis=0)
    heading = np.unwrap(np.arctan2(step[:, 1], step[:, 0]))
    return float(heading[-1] - heading[0])


def street_key(lane: Lane) -> int:
    """Return one number for both directions of the street of `lane`."""
    return lane.id if lane.opposite is None else min(lane.id, lane.opposite)


class _Walk:
    """A walk under way: the lanes so far and how often each was driven."""

    def __init__(self, network: LaneNetwork, rng: np.random.Generator) -> None:
        self.network = network
        self.rng = rng
        self.visits = np.zeros(len(network.lanes))
        self.known: set[int] = set()
        self.lanes: list[int] = []
        self.streets: list[int] = []
        self.length_m = self.street_m = self.revisited_m = self.since_u_turn_m = 0.0
        self.take(self._first())

    @property
    def revisited_share(self) -> float:
        return self.revisited_m / max(self.street_m, 1e-9)

    def _first(self) -> int:
        streets = np.array([lane.kind == "street" for lane in self.network.lanes]) & self.network.endless
        weight = np.where(streets, self.network.lengths_m, 0.0)
        # Fast roads are where a drive is likely to be: the motorway rather than the road beside it.
        weight = weight * np.array([lane.speed_limit_mps for lane in self.network.lanes]) ** 3
        long = np.where(self.network.lengths_m >= _MIN_START_LANE_M, weight, 0.0)
        weight = long if long.any() else weight
        if not weight.any():
            raise ValueError("roads must hold a street lane on a loop, got none")
        return int(self.rng.choice(len(weight), p=weight / weight.sum()))

    def take(self, lane_id: int) -> None:
        """Drive one more lane."""
        lane, length = self.network.lanes[lane_id], float(self.network.lengths_m[lane_id])
        self.lanes.append(lane_id)
        self.length_m += length
        self.since_u_turn_m = 0.0 if lane.kind == "u_turn" else self.since_u_turn_m + length
        if lane.kind == "street":
            self.street_m += length
            self.revisited_m += length * (street_key(lane) in self.known)
            self.known.add(street_key(lane))
            self.streets.append(lane_id)
        self.visits[lane_id] += 1
        if lane.opposite is not None:
            self.visits[lane.opposite] += 1

    def explore(self, length_m: float) -> None:
        """Wander, with a liking for little-driven lanes and for straight on."""
        goal = self.length_m + length_m
        while self.length_m < goal or self.network.lanes[self.lanes[-1]].kind != "street":
            options = self._options()
            weight = np.array([self._liking(option) for option in options])
            self.take(options[int(self.rng.choice(len(options), p=weight / weight.sum()))])

    def _options(self) -> list[int]:
        return [
            after for after in self.network.lanes[self.lanes[-1]].successors if self.network.endless[after]
        ]

    def _liking(self, lane_id: int) -> float:
        lane = self.network.lanes[lane_id]
        if lane.kind == "u_turn":
            return 0.003
        driven = self.visits[lane_id] + min((self.visits[after] for after in lane.successors), default=0.0)
        just_now = 0.02 if lane_id in self.lanes[-12:] else 1.0
        return (
            just_now
            * float(np.exp(-_STRAIGHT_LIKING * abs(self.network.turn_rad[lane_id])))
            / (1.0 + driven) ** 2
        )

    def turn_round(self) -> None:
        """Drive to the nearest place for a u-turn and take it; where there is none, forget about it."""
        self.since_u_turn_m = 0.0
        for step in self.network.way_to_u_turn(self.lanes[-1]):
            self.take(step)

    def retrace(self, mean_m: float) -> None:
        """Follow the most recent streets backwards."""
        self._follow(len(self.streets), mean_m, backwards=True)

    def come_back(self, mean_m: float) -> None:
        """Go to a street driven before, then follow the old course from there in either direction."""
        self._follow(
            int(self.rng.integers(len(self.streets))), mean_m, backwards=bool(self.rng.random() < 0.5)
        )

    def _follow(self, place: int, mean_m: float, *, backwards: bool) -> None:
        stretch = self.streets[:place][::-1] if backwards else self.streets[place:]
        goal = self.length_m + float(self.rng.exponential(mean_m))
        for count, lane_id in enumerate(list(stretch)):
            if count and self.length_m > goal:
                return
            opposite = self.network.lanes[lane_id].opposite
            target = opposite if backwards and opposite is not None else lane_id
            if self.network.endless[target]:
                for step in self.network.way(self.lanes[-1], target):
                    self.take(step)
        if not stretch or self.network.lanes[self.lanes[-1]].kind != "street":
            self.explore(1.0)
