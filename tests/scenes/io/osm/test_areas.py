"""Land cover: areas do not overlap, and what comes first in the order keeps its whole area."""

import numpy as np
import pytest
import shapely
from shapely.geometry import box

from echoscape.scenes.io.osm.areas import cover_of, land_covers
from echoscape.scenes.io.osm.elements.map_data import OsmMap, Tags, Way

LAND = box(-100, -100, 100, 100)


def squares(*given: tuple[float, Tags]) -> tuple[OsmMap, dict[int, np.ndarray]]:
    """Return a map of squares about the origin, each of a half side [m] and tags."""
    places, ways = {}, {}
    for number, (half, tags) in enumerate(given, 1):
        corners = [(-half, -half), (half, -half), (half, half), (-half, half)]
        nodes = tuple(10 * number + corner for corner in range(4))
        places |= {node: np.array(corner) for node, corner in zip(nodes, corners, strict=True)}
        ways[number] = Way(id=number, nodes=(*nodes, nodes[0]), tags=tags)
    return OsmMap(file="a.osm", nodes={}, ways=ways, relations={}, bounds_deg=None), places


def test_areas_that_overlap_are_divided_in_order() -> None:
    park, pond, parking = {"leisure": "park"}, {"natural": "water"}, {"amenity": "parking"}
    found = land_covers(*squares((30.0, park), (20.0, parking), (10.0, pond)), LAND)
    assert [each.cover for each in found] == ["water", "car_park", "park"]
    assert [each.area.area for each in found] == pytest.approx([400.0, 1600.0 - 400.0, 3600.0 - 1600.0])
    assert shapely.union_all([each.area for each in found]).area == pytest.approx(3600.0)


def test_areas_end_at_roads_and_buildings() -> None:
    free = LAND.difference(box(-100, -5, 100, 5))
    (wood,) = land_covers(*squares((20.0, {"natural": "wood"})), free)
    assert wood.area.area == pytest.approx(40.0 * 40.0 - 40.0 * 10.0)


@pytest.mark.parametrize(
    ("tags", "cover"),
    [
        ({"natural": "wood", "leisure": "park"}, "wood"),
        ({"amenity": "parking", "parking": "underground"}, None),
        ({"amenity": "parking"}, "car_park"),
        ({"landuse": "residential"}, None),
        ({"building": "yes"}, None),
    ],
)
def test_covers_by_tags(tags: Tags, cover: str | None) -> None:
    assert cover_of(tags) == cover


def test_waterways_are_as_wide_as_the_map_says() -> None:
    places = {1: np.array([-50.0, 0.0]), 2: np.array([50.0, 0.0])}
    for tags, width in (({"waterway": "river", "width": "20"}, 20.0), ({"waterway": "canal"}, 9.0)):
        way = Way(id=1, nodes=(1, 2), tags=tags)
        osm = OsmMap(file="a.osm", nodes={}, ways={1: way}, relations={}, bounds_deg=None)
        (river,) = land_covers(osm, places, LAND)
        assert river.area.area == pytest.approx(100.0 * width)
