"""The route of a drive: a random walk on the lane graph.

Exploring little-driven streets alternates with retracing earlier stretches in the same or the opposite
direction, so that a long drive revisits places in both directions.
"""

from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import NDArray
from scipy.sparse import csr_matrix
from scipy.sparse.csgraph import connected_components, dijkstra

from echoscape.scenes.core import portable_math
from echoscape.scenes.core.checks import check_between
from echoscape.scenes.core.headings import unwrapped_headings
from echoscape.scenes.core.lane_graph import Lane, RoadGraph

_U_TURN_COST_M = 300.0
_TURN_COST_M_PER_RAD = 40.0
_STRAIGHT_PREFERENCE = 2.0
_MIN_START_LANE_M = 40.0


@dataclass(frozen=True, kw_only=True)
class RouteSettings:
    """Mix of new and revisited streets in a route."""

    revisit_share: float = 0.48
    """Share of the street length driven that has been driven before [0 to 1]."""
    explore_m: float = 350.0
    """Mean length driven on little-driven streets between revisits, which begin after it [m]."""
    retrace_m: float = 350.0
    """Mean length of earlier course that a revisit follows, in either direction [m]."""
    u_turn_every_m: float = 2000.0
    """Distance without a U-turn after which one is taken [m]."""

    def __post_init__(self) -> None:
        """Check the share.

        Raises:
            ValueError: It is not between 0 and 1.
        """
        check_between(self, revisit_share=(0, 1))


@dataclass(frozen=True, kw_only=True)
class Route:
    """Lanes in the order driven.

    Attributes:
        lanes: Ids of the L lanes.
        ends_m: Distance at the end of each lane, from the beginning of the first (L,) float64 [m].
        start_m: Distance into the first lane at which the drive starts [m].
        length_m: Length of the drive [m].
    """

    lanes: tuple[int, ...]
    ends_m: NDArray[np.float64]
    start_m: float
    length_m: float

    @cached_property
    def begins_m(self) -> NDArray[np.float64]:
        """Distance at the beginning of each lane, from the beginning of the first (L,) [m]."""
        return np.concatenate([[0.0], self.ends_m[:-1]])

    def locate(self, travel_m: NDArray[np.float64]) -> tuple[NDArray[np.intp], NDArray[np.float64]]:
        """Find the lane at a distance along the route.

        Args:
            travel_m: Distances from the beginning of the first lane (...) [m].

        Returns:
            Index into `lanes` (...) and distance into that lane (...) [m].
        """
        place = np.searchsorted(self.ends_m, travel_m, side="right").clip(max=len(self.lanes) - 1)
        return place, travel_m - self.begins_m[place]


def plan_route(
    roads: RoadGraph, *, length_m: float, rng: np.random.Generator, settings: RouteSettings | None = None
) -> Route:
    """Draw a route that starts on a random street.

    Args:
        roads: The lane graph.
        length_m: Length of the drive [m].
        rng: Random generator.
        settings: Mix of new and revisited streets; None for the default.

    Returns:
        The route.

    Raises:
        ValueError: `length_m` is not above 0, or the graph has no loop of lanes that includes a street.
    """
    if not length_m > 0:
        raise ValueError(f"length_m must be above 0, got {length_m}")
    settings = settings or RouteSettings()
    walk = _RandomWalk(LaneNetwork(roads), rng)
    start_m = float(rng.uniform(0.25, 0.5)) * walk.network.lengths_m[walk.lanes[0]]
    while walk.length_m < start_m + length_m:
        if walk.since_u_turn_m > settings.u_turn_every_m:
            walk.make_u_turn()
            walk.retrace(settings.retrace_m)
        elif walk.length_m > settings.explore_m and walk.revisited_share < settings.revisit_share:
            walk.revisit(settings.retrace_m)
        else:
            walk.explore(float(rng.exponential(settings.explore_m)))
    ends_m = np.cumsum(walk.network.lengths_m[walk.lanes])
    count = int(np.searchsorted(ends_m, start_m + length_m)) + 1
    return Route(lanes=tuple(walk.lanes[:count]), ends_m=ends_m[:count], start_m=start_m, length_m=length_m)


class LaneNetwork:
    """The lane graph as arrays over lane ids, with shortest paths.

    Attributes:
        lanes: The N lanes.
        kerbs: Kerb lines of the road graph.
        lengths_m: Length of each lane (N,) [m].
        turn_rad: Change of heading along each lane (N,) [rad], left positive.
        graph: Sparse matrix (N, N) with the cost of driving from one lane to the next [m].
        connected: Whether a lane is in the largest strongly connected component (N,): a vehicle that stays in
            it can drive for ever and reach all of it.
    """

    def __init__(self, roads: RoadGraph) -> None:
        """Tabulate a road graph.

        Args:
            roads: The road graph.

        Raises:
            ValueError: It has no loop of lanes.
        """
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
        self.connected = self.largest_component(np.ones(len(roads.lanes), dtype=bool))
        if self.connected.sum() < 2:
            raise ValueError("roads must hold a loop of lanes to drive on, got none")

    def largest_component(self, usable: NDArray[np.bool_]) -> NDArray[np.bool_]:
        """Find the largest strongly connected component of some lanes.

        Args:
            usable: Lanes that may be used (N,) bool.

        Returns:
            Lanes of the component with the greatest total length (N,) bool; none if it has a single lane.
        """
        lanes = np.flatnonzero(usable)
        _, part = connected_components(self.graph[lanes][:, lanes], directed=True, connection="strong")
        loop = np.zeros(len(self.lanes), dtype=bool)
        if len(lanes):
            loop[lanes] = part == np.bincount(part, weights=self.lengths_m[lanes]).argmax()
        return loop if loop.sum() > 1 else np.zeros_like(loop)  # a single lane is no loop

    def shortest_path(self, start: int, goal: int) -> list[int]:
        """Find the cheapest path between two lanes (Dijkstra).

        Args:
            start: Id of the lane at which the path starts.
            goal: Id of the lane at which it ends.

        Returns:
            Ids of the lanes after `start` up to `goal`; empty if it cannot be reached.
        """
        _, before = dijkstra(self.graph, indices=start, return_predecessors=True)
        return _traced(before, start, goal)

    def path_to_u_turn(self, start: int) -> list[int]:
        """Find the cheapest path to a U-turn.

        Args:
            start: Id of the lane at which the path starts.

        Returns:
            Ids of the lanes after `start` up to the U-turn; empty if none can be reached.
        """
        cost, before = dijkstra(self.graph, indices=start, return_predecessors=True)
        u_turns = [lane.id for lane in self.lanes if lane.kind == "u_turn" and self.connected[lane.id]]
        return _traced(before, start, min(u_turns, key=lambda lane: cost[lane])) if u_turns else []


def _traced(before: NDArray[np.int32], start: int, goal: int) -> list[int]:
    """Follow the predecessors from `goal` back to `start`."""
    lanes: list[int] = []
    while goal != start:
        if goal < 0:
            return []
        lanes.append(goal)
        goal = int(before[goal])
    return lanes[::-1]


def _turn_angle(lane: Lane) -> float:
    step = np.diff(lane.centre, axis=0)
    heading = unwrapped_headings(step)
    return float(heading[-1] - heading[0])


def street_key(lane: Lane) -> int:
    """Return a number that is the same for both directions of a street.

    Args:
        lane: A lane of the street.

    Returns:
        The lower id of the two lanes.
    """
    return lane.id if lane.opposite is None else min(lane.id, lane.opposite)


class _RandomWalk:
    """A random walk in progress: the lanes so far and how often each was driven."""

    def __init__(self, network: LaneNetwork, rng: np.random.Generator) -> None:
        self.network = network
        self.rng = rng
        self.visits = np.zeros(len(network.lanes))
        self.visited: set[int] = set()
        self.lanes: list[int] = []
        self.streets: list[int] = []
        self.length_m = self.street_m = self.revisited_m = self.since_u_turn_m = 0.0
        self.take(self._first())

    @property
    def revisited_share(self) -> float:
        return self.revisited_m / max(self.street_m, 1e-9)

    def _first(self) -> int:
        streets = np.array([lane.kind == "street" for lane in self.network.lanes]) & self.network.connected
        weight = np.where(streets, self.network.lengths_m, 0.0)
        # Prefer fast roads: a drive on the motorway preset should start on the motorway.
        limits = np.array([lane.speed_limit_mps for lane in self.network.lanes])
        weight = weight * (limits * limits * limits)
        long = np.where(self.network.lengths_m >= _MIN_START_LANE_M, weight, 0.0)
        weight = long if long.any() else weight
        if not weight.any():
            raise ValueError("roads must hold a street lane on a loop, got none")
        return int(self.rng.choice(len(weight), p=weight / weight.sum()))

    def take(self, lane_id: int) -> None:
        """Append a lane."""
        lane, length = self.network.lanes[lane_id], float(self.network.lengths_m[lane_id])
        self.lanes.append(lane_id)
        self.length_m += length
        self.since_u_turn_m = 0.0 if lane.kind == "u_turn" else self.since_u_turn_m + length
        if lane.kind == "street":
            self.street_m += length
            self.revisited_m += length * (street_key(lane) in self.visited)
            self.visited.add(street_key(lane))
            self.streets.append(lane_id)
        self.visits[lane_id] += 1
        if lane.opposite is not None:
            self.visits[lane.opposite] += 1

    def explore(self, length_m: float) -> None:
        """Walk at random, preferring little-driven lanes and going straight on."""
        goal = self.length_m + length_m
        while self.length_m < goal or self.network.lanes[self.lanes[-1]].kind != "street":
            options = self._options()
            weight = np.array([self._preference(option) for option in options])
            self.take(options[int(self.rng.choice(len(options), p=weight / weight.sum()))])

    def _options(self) -> list[int]:
        return [
            after for after in self.network.lanes[self.lanes[-1]].successors if self.network.connected[after]
        ]

    def _preference(self, lane_id: int) -> float:
        lane = self.network.lanes[lane_id]
        if lane.kind == "u_turn":
            return 0.003
        driven = self.visits[lane_id] + min((self.visits[after] for after in lane.successors), default=0.0)
        just_now = 0.02 if lane_id in self.lanes[-12:] else 1.0
        return (
            just_now
            * float(portable_math.exp(-_STRAIGHT_PREFERENCE * abs(self.network.turn_rad[lane_id])))
            / (1.0 + driven) ** 2
        )

    def make_u_turn(self) -> None:
        """Go to the nearest U-turn and take it; if there is none, wait another `u_turn_every_m`."""
        self.since_u_turn_m = 0.0
        for step in self.network.path_to_u_turn(self.lanes[-1]):
            self.take(step)

    def retrace(self, mean_m: float) -> None:
        """Follow the most recent streets backwards."""
        self._follow(len(self.streets), mean_m, backwards=True)

    def revisit(self, mean_m: float) -> None:
        """Go to a street driven before and follow the earlier course from there in either direction."""
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
            if self.network.connected[target]:
                for step in self.network.shortest_path(self.lanes[-1], target):
                    self.take(step)
        if not stretch or self.network.lanes[self.lanes[-1]].kind != "street":
            self.explore(1.0)
