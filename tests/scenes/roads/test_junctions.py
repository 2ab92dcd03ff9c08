"""Laws of the lanes: they join, bend gently, keep to the right, and all can be reached from all."""

import numpy as np
import pytest
from scipy.sparse import coo_matrix
from scipy.sparse.csgraph import connected_components

from echoscape.scenes.core.lane_graph import RoadGraph
from echoscape.scenes.geometry.curves import arc_length, smallest_radius, tangents
from echoscape.scenes.roads.motorway import motorway
from echoscape.scenes.town.build import road_network
from echoscape.scenes.town.presets import PRESETS


def graph_of(preset: str, seed: int) -> RoadGraph:
    if preset == "motorway":
        return motorway(rng=np.random.default_rng(seed), margin_m=10.0).roads
    return road_network(PRESETS[preset], seed=seed)[1]


@pytest.fixture(scope="module", params=sorted(PRESETS))
def roads(request: pytest.FixtureRequest) -> RoadGraph:
    return graph_of(request.param, 4)


def check_joins(roads: RoadGraph) -> None:
    ends = {lane.id: tangents(lane.centre)[[0, -1]] for lane in roads.lanes}
    for lane in roads.lanes:
        assert lane.successors
        for other in lane.successors:
            after = roads.lanes[other]
            np.testing.assert_allclose(lane.centre[-1], after.centre[0], atol=1e-6)
            assert np.linalg.norm(ends[lane.id][1] - ends[other][0]) < 1e-3


def check_strongly_connected(roads: RoadGraph) -> None:
    joins = np.array([(lane.id, other) for lane in roads.lanes for other in lane.successors])
    count = len(roads.lanes)
    matrix = coo_matrix((np.ones(len(joins)), joins.T), shape=(count, count))
    assert connected_components(matrix, directed=True, connection="strong")[0] == 1


def check_radii(roads: RoadGraph) -> None:
    limits = {"street": 25.0, "turn": 5.0, "u_turn": 4.5, "roundabout": 5.0}
    for lane in roads.lanes:
        assert smallest_radius(lane.centre) > limits[lane.kind], lane.id


def test_lanes_join_in_place_and_direction(roads: RoadGraph) -> None:
    check_joins(roads)


def test_every_lane_is_reached_from_every_other(roads: RoadGraph) -> None:
    check_strongly_connected(roads)


def test_lanes_bend_no_sharper_than_cars_can(roads: RoadGraph) -> None:
    check_radii(roads)


def test_lanes_are_numbered_and_sampled_at_a_metre_or_less(roads: RoadGraph) -> None:
    assert [lane.id for lane in roads.lanes] == list(range(len(roads.lanes)))
    for lane in roads.lanes:
        assert np.diff(arc_length(lane.centre)).max() < 1.0
        assert lane.kind == "street" or lane.junction is not None


def test_opposite_lanes_run_on_the_left(roads: RoadGraph) -> None:
    for lane in roads.lanes:
        if lane.opposite is not None:
            assert roads.lanes[lane.opposite].opposite == lane.id
            middle = len(lane.centre) // 2
            along = tangents(lane.centre)[middle]
            other = roads.lanes[lane.opposite].centre
            across = (
                other[np.argmin(np.linalg.norm(other - lane.centre[middle], axis=1))] - lane.centre[middle]
            )
            assert along[0] * across[1] - along[1] * across[0] > 0


def test_towns_have_roundabouts_and_dead_ends_and_lanes_that_yield() -> None:
    lanes = graph_of("town", 4).lanes
    assert {lane.kind for lane in lanes} == {"street", "turn", "u_turn", "roundabout"}
    assert any(lane.yields for lane in lanes)
    assert {lane.speed_limit_mps for lane in lanes if lane.kind == "street"} >= {9.0, 13.4}


@pytest.mark.slow
@pytest.mark.parametrize("preset", sorted(PRESETS))
@pytest.mark.parametrize("seed", range(100, 106))
def test_any_seed_gives_a_valid_graph(preset: str, seed: int) -> None:
    roads = graph_of(preset, seed)
    check_joins(roads)
    check_strongly_connected(roads)
    check_radii(roads)
