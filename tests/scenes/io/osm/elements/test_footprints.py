"""Areas of rings and multipolygons, from the shoelace formula, whatever ways they are put together from."""

from pathlib import Path

import numpy as np
import pytest

from echoscape.scenes.io.osm.elements.footprints import Shape, shapes_of
from echoscape.scenes.io.osm.elements.map_data import Node, OsmMap, Relation, Way

CORNERS = [(0, 0), (40, 0), (40, 30), (0, 30), (10, 10), (20, 10), (20, 20), (10, 20)]
PLACES = {number: np.array(place, float) for number, place in enumerate(CORNERS, 1)}


def shapes(ways: dict[int, tuple[int, ...]], members: list[tuple[str, int, str]]) -> list[Shape]:
    osm = OsmMap(
        file=str(Path("a.osm")),
        nodes={number: Node(id=number, lat_deg=0, lon_deg=0, tags={}) for number in PLACES},
        ways={number: Way(id=number, nodes=nodes, tags={}) for number, nodes in ways.items()},
        relations={1: Relation(id=1, members=tuple(members), tags={"type": "multipolygon"})},
        bounds_deg=(0, 0, 1, 1),
    )
    return shapes_of(osm, PLACES, lambda tags: "type" in tags)


@pytest.mark.parametrize(
    "ways",
    [
        {1: (1, 2, 3, 4, 1), 2: (5, 6, 7, 8, 5)},
        {1: (1, 4, 3, 2, 1), 2: (5, 6, 7, 8, 5)},
        {1: (1, 2, 3), 3: (1, 4, 3), 2: (5, 8, 7), 4: (7, 6, 5)},
    ],
)
def test_the_area_is_that_of_outer_rings_less_inner_ones(ways: dict[int, tuple[int, ...]]) -> None:
    members = [("way", number, "outer" if number % 2 else "inner") for number in ways]
    (shape,) = shapes(ways, members)
    assert shape.polygon.area == pytest.approx(40 * 30 - 10 * 10)
    assert shape.polygon.exterior.is_ccw


def test_members_without_a_role_are_outer_rings() -> None:
    (shape,) = shapes({1: (1, 2, 3, 4, 1)}, [("way", 1, ""), ("node", 3, "entrance")])
    assert shape.polygon.area == pytest.approx(1200.0)


def test_incomplete_multipolygons_are_left_out() -> None:
    assert shapes({1: (1, 2, 3, 4, 1)}, [("way", 1, "outer"), ("way", 99, "inner")]) == []
    assert shapes({1: (1, 2, 3)}, [("way", 1, "outer")]) == []


def test_a_multipolygon_of_two_parts_is_two_shapes_in_order() -> None:
    ways = {1: (5, 6, 7, 8, 5), 2: (2, 3, 6, 2)}
    found = shapes(ways, [("way", 1, "outer"), ("way", 2, "outer")])
    assert [shape.part for shape in found] == [0, 1]
    assert found == shapes(ways, [("way", 2, "outer"), ("way", 1, "outer")])
