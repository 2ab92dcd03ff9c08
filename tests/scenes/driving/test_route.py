"""Routes follow successors for the length asked for and revisit streets in both directions."""

from dataclasses import replace
from itertools import pairwise

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from numpy.testing import assert_allclose

from echoscape.scenes.core.lane_graph import RoadGraph
from echoscape.scenes.driving.route import Route, plan_route, street_key


def _rng(seed: int) -> np.random.Generator:
    return np.random.default_rng(seed)


def _known_shares(route: Route, roads: RoadGraph) -> tuple[float, float]:
    """Return the shares of street length driven before, and driven before in the opposite direction."""
    seen: set[int] = set()
    known = opposite = total = 0.0
    for lane in (roads.lanes[lane] for lane in route.lanes):
        if lane.kind == "street":
            total += lane.length_m
            known += lane.length_m * bool({lane.id, lane.opposite} & seen)
            opposite += lane.length_m * (lane.opposite in seen)
            seen.add(lane.id)
    return known / total, opposite / total


@settings(max_examples=25, deadline=None)
@given(seed=st.integers(0, 2**32 - 1), length_m=st.floats(10, 3000))
def test_route_follows_successors_for_its_length(blocks: RoadGraph, seed: int, length_m: float) -> None:
    route = plan_route(blocks, length_m=length_m, rng=_rng(seed))
    for lane, after in pairwise(route.lanes):
        assert after in blocks.lanes[lane].successors
    assert route.ends_m[-1] >= route.start_m + length_m
    assert route.begins_m[-1] < route.start_m + length_m
    assert blocks.lanes[route.lanes[0]].kind == "street"


@pytest.mark.parametrize("seed", range(4))
def test_long_routes_revisit_streets_in_both_directions(town_roads: RoadGraph, seed: int) -> None:
    known, opposite = _known_shares(plan_route(town_roads, length_m=6000, rng=_rng(seed)), town_roads)
    assert known > 0.3
    assert 0.08 < opposite < known


def test_routes_take_u_turns(town_roads: RoadGraph) -> None:
    for seed in range(3):
        route = plan_route(town_roads, length_m=8000, rng=_rng(seed))
        assert sum(town_roads.lanes[lane].kind == "u_turn" for lane in route.lanes) >= 1


def test_straight_road_is_driven_up_and_down(straight: RoadGraph) -> None:
    route = plan_route(straight, length_m=3000, rng=_rng(0))
    streets = [lane for lane in route.lanes if straight.lanes[lane].kind == "street"]
    assert all(a != b for a, b in pairwise(streets))
    assert {street_key(straight.lanes[lane]) for lane in streets} == {0}


def test_same_seed_same_route_other_seed_other_route(blocks: RoadGraph) -> None:
    first, again, other = (plan_route(blocks, length_m=2000, rng=_rng(seed)) for seed in (1, 1, 2))
    assert first.lanes == again.lanes
    assert first.lanes != other.lanes


def test_locate_counts_from_the_beginning_of_each_lane(blocks: RoadGraph) -> None:
    route = plan_route(blocks, length_m=900, rng=_rng(3))
    place, station = route.locate(route.begins_m + 2.0)
    assert_allclose(place, np.arange(len(route.lanes)))
    assert_allclose(station, 2.0, atol=1e-9)


def test_refuses_roads_without_a_loop_and_no_length(blocks: RoadGraph, straight: RoadGraph) -> None:
    one_way = RoadGraph(lanes=(replace(straight.lanes[0], successors=()),), junctions=straight.junctions)
    with pytest.raises(ValueError, match="loop"):
        plan_route(one_way, length_m=100, rng=_rng(0))
    with pytest.raises(ValueError, match="length_m"):
        plan_route(blocks, length_m=0, rng=_rng(0))
