"""Streets between buildings: they narrow, turn back earlier or are not driven, but never touch a building."""

import numpy as np
import pytest
import shapely
from shapely.geometry import LineString, Polygon, box
from shapely.geometry.base import BaseGeometry

from echoscape.scenes.driving.route import LaneNetwork
from echoscape.scenes.io.osm.elements.map_data import OsmMap, Tags, Way
from echoscape.scenes.io.osm.streets.road_network import Streets, street_plan

AREA = box(-300, -300, 300, 300)
Line = list[tuple[float, float]]


def streets_of(*lines: tuple[Line, Tags], solid: list[Polygon] | None = None) -> Streets | None:
    """Lay out roads that are given by their lines; equal places are one node."""
    places: dict[tuple[float, float], int] = {}
    ways = {}
    for number, (line, tags) in enumerate(lines, 1):
        nodes = tuple(places.setdefault(place, len(places) + 1) for place in line)
        ways[number] = Way(id=number, nodes=nodes, tags={"highway": "residential", **tags})
    osm = OsmMap(file="a.osm", nodes={}, ways=ways, relations={}, bounds_deg=None)
    points = {number: np.array(place, float) for place, number in places.items()}
    return street_plan(osm, points, AREA, solid or [], rng_of=lambda number: np.random.default_rng(number))


def driven(streets: Streets) -> BaseGeometry:
    lanes = [LineString(lane.centre).buffer(lane.width_m / 2) for lane in streets.roads.lanes]
    return shapely.union_all(lanes)


STRAIGHT: tuple[Line, Tags] = ([(-150.0, 0.0), (0.0, 0.0), (150.0, 0.0)], {})
PLAIN: tuple[Line, Tags] = (STRAIGHT[0], {"parking:both": "no"})


def beside(gap_m: float) -> list[Polygon]:
    """Return two buildings with a gap between them about the middle of the road."""
    return [box(-10, gap_m / 2, 10, 30), box(-10, -30, 10, -gap_m / 2)]


@pytest.mark.parametrize(("gap_m", "lane_m"), [(20.0, 2.9), (6.4, 2.5), (5.9, 2.5)])
def test_a_road_narrows_between_buildings(gap_m: float, lane_m: float) -> None:
    streets = streets_of(PLAIN, solid=beside(gap_m))
    assert streets is not None
    assert {lane.width_m for lane in streets.roads.lanes if lane.kind == "street"} == {lane_m}
    assert driven(streets).distance(shapely.union_all(beside(gap_m))) > 0.3


def test_parking_gives_way_to_buildings() -> None:
    with_parking: tuple[Line, Tags] = (STRAIGHT[0], {"parking:both": "lane"})
    for gap, parking in ((20.0, 2.5), (9.0, 0.0)):
        streets = streets_of(with_parking, solid=beside(gap))
        assert streets is not None
        assert streets.network.streets[0].type.parking_m == parking


def test_a_road_too_narrow_for_two_lanes_is_not_driven() -> None:
    side: tuple[Line, Tags] = ([(0.0, 0.0), (0.0, 150.0)], {"highway": "tertiary"})
    houses = [box(2.0, 60.0, 20.0, 80.0), box(-20.0, 60.0, -2.0, 80.0)]
    assert streets_of(PLAIN, side) is not None
    streets = streets_of(PLAIN, side, solid=houses)
    assert streets is not None
    assert driven(streets).bounds[3] < 20.0
    assert len(streets.network.outskirts) > 0
    for street in streets.network.outskirts:
        carriageway = LineString(street.line).buffer(street.type.half_width_m)
        assert carriageway.intersection(shapely.union_all(houses)).area == pytest.approx(0.0, abs=1e-6)


def test_a_dead_end_turns_back_before_a_building() -> None:
    wall = box(140.0, -20.0, 200.0, 20.0)
    streets = streets_of(PLAIN, solid=[wall])
    assert streets is not None
    assert driven(streets).distance(wall) > 0.3
    assert 90.0 < driven(streets).bounds[2] < 140.0


def test_every_lane_of_every_plan_can_be_reached_from_every_other() -> None:
    cross: tuple[Line, Tags] = ([(0.0, -150.0), (0.0, 0.0), (0.0, 150.0)], {"parking:both": "no"})
    far: tuple[Line, Tags] = ([(200.0, 200.0), (290.0, 210.0)], {})
    corner = box(4.6, 4.6, 30.0, 30.0)  # in the way of the turn to the right
    found = [streets_of(PLAIN, cross, far), streets_of(PLAIN, cross, far, solid=[corner])]
    for streets in found:
        assert streets is not None
        assert LaneNetwork(streets.roads).connected.all()
        assert driven(streets).bounds[3] < 190.0  # the road without a way to it is not driven
        assert len(streets.network.streets) == 4
        assert sum(lane.kind == "street" for lane in streets.roads.lanes) == 8
    whole, without = found
    assert whole is not None
    assert without is not None
    assert driven(whole).intersects(corner)
    assert driven(without).distance(corner) > 0.3
    assert len(whole.roads.lanes) - len(without.roads.lanes) == 1


def test_one_way_streets_are_driven_where_they_lead_on() -> None:
    loop: list[tuple[Line, Tags]] = [
        ([(-80.0, 0.0), (80.0, 0.0)], {"oneway": "yes"}),
        ([(80.0, 0.0), (80.0, 120.0), (-80.0, 120.0), (-80.0, 0.0)], {"oneway": "yes"}),
    ]
    dead: tuple[Line, Tags] = ([(80.0, 0.0), (250.0, 0.0)], {"oneway": "yes"})
    streets = streets_of(*loop, dead)
    assert streets is not None
    assert driven(streets).bounds[2] < 100.0
    turned = streets_of(*loop[:1], (loop[1][0], {"oneway": "-1"}))
    assert turned is None


def test_streets_that_leave_the_map_are_known() -> None:
    streets = streets_of(([(-150.0, 0.0), (400.0, 0.0)], {}))
    assert streets is not None
    ((line, kind),) = streets.exits
    assert line[-1] == pytest.approx([300.0, 0.0])
    assert kind.name == "residential"
    assert driven(streets).bounds[2] < 310.0  # with the turnaround
