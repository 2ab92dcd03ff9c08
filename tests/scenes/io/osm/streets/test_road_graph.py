"""The graph of roads: joined where they go on, merged where junctions are near, rings as roundabouts."""

import numpy as np
import pytest

from echoscape.scenes.io.osm.streets.road_graph import Road, RoadMap, simplified
from echoscape.scenes.io.osm.streets.road_types import DRIVEN
from echoscape.scenes.roads.street_network import StreetType

STREET, MAIN = DRIVEN["residential"], DRIVEN["secondary"]
ONE_WAY = StreetType(
    name="residential", lanes=1, lane_width_m=3.0, parking_m=0, pavement_m=0, speed_limit_mps=9, oneway=True
)
Place = tuple[float, float]


def road(places: dict[int, Place], start: int, end: int, kind: StreetType = STREET, **more: bool) -> Road:
    line = np.array([places[start], places[end]], float)
    return Road(start=start, end=end, line=line, type=kind, **more)


def ends(graph: RoadMap) -> set[tuple[int, int]]:
    return {(min(each.start, each.end), max(each.start, each.end)) for each in graph.roads}


LINE: dict[int, Place] = {1: (0, 0), 2: (100, 0), 3: (200, 0), 4: (100, 100)}


def test_roads_of_one_kind_that_meet_end_to_end_are_one() -> None:
    graph = simplified([road(LINE, 1, 2), road(LINE, 3, 2)])
    assert ends(graph) == {(1, 3)}
    assert graph.roads[0].length_m == pytest.approx(200.0)


def test_roads_of_two_kinds_stay_apart() -> None:
    assert ends(simplified([road(LINE, 1, 2), road(LINE, 2, 3, MAIN)])) == {(1, 2), (2, 3)}


def test_roads_at_a_junction_of_three_stay_apart() -> None:
    graph = simplified([road(LINE, 1, 2), road(LINE, 2, 3), road(LINE, 2, 4)])
    assert ends(graph) == {(1, 2), (2, 3), (2, 4)}


@pytest.mark.parametrize("turned", [False, True])
def test_one_way_streets_are_joined_in_their_direction(turned: bool) -> None:
    pair = [road(LINE, 1, 2, ONE_WAY), road(LINE, 2, 3, ONE_WAY)]
    (joined,) = simplified(pair[::-1] if turned else pair).roads
    assert (joined.start, joined.end) == (1, 3)
    assert joined.line[-1].tolist() == [200.0, 0.0]


def test_one_way_streets_that_lead_towards_each_other_stay_apart() -> None:
    assert len(simplified([road(LINE, 1, 2, ONE_WAY), road(LINE, 3, 2, ONE_WAY)]).roads) == 2


def test_junctions_nearer_than_their_size_are_one() -> None:
    places: dict[int, Place] = {1: (-80, 0), 2: (0, 0), 3: (12, 0), 4: (100, 0), 5: (0, 90), 6: (12, -90)}
    graph = simplified([road(places, *pair) for pair in ((1, 2), (2, 3), (3, 4), (2, 5), (3, 6))])
    assert ends(graph) == {(1, 2), (2, 4), (2, 5), (2, 6)}
    assert graph.places[2].tolist() == [6.0, 0.0]
    assert all(road.line[0 if road.start == 2 else -1].tolist() == [6.0, 0.0] for road in graph.roads)


def ring(radius_m: float) -> list[Road]:
    """Return a ring about the origin in four pieces, with an arm of 120 m at each of their ends."""
    angle = np.linspace(0.0, 2 * np.pi, 41)
    circle = radius_m * np.stack([np.cos(angle), np.sin(angle)], axis=-1)
    roads = []
    for arm in range(4):
        piece = circle[10 * arm : 10 * arm + 11]
        roads.append(Road(start=1 + arm, end=1 + (arm + 1) % 4, line=piece, type=ONE_WAY, is_ring=True))
        out = np.stack([piece[0], piece[0] * (radius_m + 120.0) / radius_m])
        roads.append(Road(start=1 + arm, end=11 + arm, line=out, type=STREET))
    return roads


@pytest.mark.parametrize(("radius_m", "kind"), [(4.0, "crossing"), (15.0, "roundabout"), (60.0, "ring")])
def test_rings_become_a_crossing_a_roundabout_or_stay(radius_m: float, kind: str) -> None:
    graph = simplified(ring(radius_m))
    if kind == "ring":
        assert len(graph.roads) == 8
        assert not graph.roundabouts
        return
    assert ends(graph) == {(1, 11), (1, 12), (1, 13), (1, 14)}
    assert graph.places[1] == pytest.approx([0.0, 0.0], abs=1e-9)
    assert graph.roundabouts == ({1} if kind == "roundabout" else set())


def test_dead_ends_without_space_to_turn_round_are_dropped() -> None:
    places = {**LINE, 4: (100.0, 20.0)}
    assert ends(simplified([road(places, 1, 2), road(places, 2, 3), road(places, 2, 4)])) == {(1, 3)}
