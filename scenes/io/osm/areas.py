"""Land cover of a map: water, woods, parks, car parks and yards, and what stands on each.

Where areas overlap, water comes first, then what is paved, then woods, then the rest.
"""

from collections.abc import Callable
from dataclasses import dataclass
from typing import Literal

import numpy as np
import shapely
from numpy.typing import NDArray
from shapely.geometry import LineString, Point, Polygon
from shapely.geometry.base import BaseGeometry

from echoscape.scenes.io.osm.elements.footprints import Shape, shapes_of
from echoscape.scenes.io.osm.elements.map_data import OsmMap, Tags
from echoscape.scenes.io.osm.elements.tag_values import length_m
from echoscape.scenes.roads.ground_mesh import polygons
from echoscape.scenes.town.open_spaces import PARK_TREES, lay_car_park, lay_yard
from echoscape.scenes.town.parcels import CityBlock
from echoscape.scenes.town.placement import OccupiedArea, SceneBuilder

Cover = Literal["water", "car_park", "paved", "wood", "scrub", "orchard", "park", "open", "yard"]
ORDER: tuple[Cover, ...] = ("water", "car_park", "paved", "wood", "scrub", "orchard", "park", "yard", "open")
_COVERS: dict[tuple[str, str], Cover] = {
    ("natural", "water"): "water",
    ("waterway", "riverbank"): "water",
    ("waterway", "dock"): "water",
    ("landuse", "reservoir"): "water",
    ("landuse", "basin"): "water",
    ("leisure", "swimming_pool"): "water",
    ("amenity", "parking"): "car_park",
    ("highway", "pedestrian"): "paved",
    ("place", "square"): "paved",
    ("natural", "wood"): "wood",
    ("landuse", "forest"): "wood",
    ("natural", "scrub"): "scrub",
    ("natural", "heath"): "scrub",
    ("landuse", "orchard"): "orchard",
    ("leisure", "park"): "park",
    ("leisure", "garden"): "park",
    ("landuse", "cemetery"): "park",
    ("landuse", "recreation_ground"): "park",
    ("landuse", "village_green"): "park",
    ("landuse", "industrial"): "yard",
    ("landuse", "railway"): "yard",
    ("landuse", "grass"): "open",
    ("landuse", "meadow"): "open",
    ("landuse", "farmland"): "open",
    ("landuse", "farm"): "open",
    ("leisure", "pitch"): "open",
    ("leisure", "playground"): "open",
    ("natural", "grassland"): "open",
    ("natural", "sand"): "open",
    ("natural", "beach"): "open",
}
_RIVERS_M = {"river": 12.0, "canal": 9.0, "stream": 2.0, "ditch": 1.2, "drain": 1.5}
_PLANTS: dict[Cover, tuple[float, tuple[str, ...], float]] = {
    "wood": (5.5, ("tree_broadleaf", "tree_tall", "tree_conifer", "tree_spreading", "tree_shrub"), 1.2),
    "scrub": (4.0, ("tree_shrub",), 0.7),
    "orchard": (6.5, ("tree_broadleaf", "tree_street"), 1.2),
    "park": (15.0, PARK_TREES, 2.0),
}
"""Side of the square that has about one plant, its kinds, and free space around each [m]."""
_CAR_SHARE = (0.2, 0.6)


@dataclass(frozen=True, kw_only=True)
class LandCover:
    """An area of one kind.

    Attributes:
        cover: Its kind.
        key: Kind, id and part of its element, for its random numbers.
        area: Where it is, less what comes before it.
    """

    cover: Cover
    key: tuple[int, int, int]
    area: BaseGeometry


def cover_of(tags: Tags) -> Cover | None:
    """Return the land cover that tags mean.

    Args:
        tags: Tags of an area.

    Returns:
        The cover, None where they mean none.
    """
    found = {_COVERS[item] for item in tags.items() if item in _COVERS}
    if tags.get("parking", "surface") not in ("surface", "lane", "street_side"):
        found -= {"car_park"}
    return next((cover for cover in ORDER if cover in found), None)


def land_covers(osm: OsmMap, places: dict[int, NDArray[np.float64]], free: BaseGeometry) -> list[LandCover]:
    """Divide the land among the covers of a map.

    Args:
        osm: The map.
        places: Place of every node (2,) [m].
        free: Land without roads and buildings.

    Returns:
        Areas that do not overlap.
    """
    shapes = shapes_of(osm, places, lambda tags: cover_of(tags) is not None and "building" not in tags)
    shapes += _rivers(osm, places)
    ranked = sorted(shapes, key=lambda each: (_rank(each), each.kind, each.id, each.part))
    found = []
    for shape in ranked:
        area = shape.polygon.intersection(free)
        cover = cover_of(shape.tags)
        if cover is not None and area.area > 1.0:
            found.append(LandCover(cover=cover, key=(shape.kind, shape.id, shape.part), area=area))
            free = free.difference(shape.polygon)
    return found


def _rank(shape: Shape) -> int:
    cover = cover_of(shape.tags)
    return len(ORDER) if cover is None else ORDER.index(cover)


def _rivers(osm: OsmMap, places: dict[int, NDArray[np.float64]]) -> list[Shape]:
    """Return the area of waterways that are mapped as lines."""
    made = []
    for way in osm.ways.values():
        kind = way.tags.get("waterway", "")
        if kind not in _RIVERS_M or len(way.nodes) < 2 or way.tags.get("tunnel", "no") != "no":
            continue
        width = length_m(way.tags, "width", "est_width") or _RIVERS_M[kind]
        line = LineString([places[node] for node in way.nodes])
        for part, polygon in enumerate(polygons(line.buffer(width / 2, cap_style="flat"))):
            tags = {"natural": "water"}
            made.append(Shape(kind=1, id=way.id, part=part, polygon=polygon, tags=tags))
    return made


def furnish(
    builder: SceneBuilder,
    occupied: OccupiedArea,
    covers: list[LandCover],
    *,
    base_m: float,
    rng_of: Callable[[tuple[int, int, int]], np.random.Generator],
) -> None:
    """Add what stands on the areas: trees and shrubs, cars in car parks, containers and trucks in yards.

    Args:
        builder: The scene.
        occupied: Occupied ground, which is extended.
        covers: The areas.
        base_m: Height of the ground [m].
        rng_of: Returns the random generator of an area.
    """
    for each in covers:
        rng = rng_of(each.key)
        if each.cover in _PLANTS:
            _plant(builder, occupied, each, base_m, rng)
        for outline in polygons(each.area) if each.cover in ("car_park", "yard") else ():
            block = CityBlock(outline=outline, occupied=occupied, base_m=base_m, inradius_m=0.0)
            if each.cover == "yard":
                lay_yard(builder, block, rng=rng, density=0.25)
            else:
                lay_car_park(
                    builder, block, filled_share=float(rng.uniform(*_CAR_SHARE)), rng=rng, inset_m=1.0
                )


def _plant(
    builder: SceneBuilder, occupied: OccupiedArea, each: LandCover, base_m: float, rng: np.random.Generator
) -> None:
    """Plant an area at random; of trees in a park that are mapped one by one, no more are added near."""
    spacing, names, room = _PLANTS[each.cover]
    inside = each.area.buffer(-1.0)
    for part in polygons(inside):
        low, high = np.array(part.bounds[:2]), np.array(part.bounds[2:])
        count = int(np.prod(high - low) / spacing**2)
        places = low + rng.uniform(0, 1, (count, 2)) * (high - low)
        for place in places[shapely.contains_xy(part, places)]:
            plant(builder, occupied, str(rng.choice(names)), place, room_m=room, base_m=base_m, rng=rng)


def plant(
    builder: SceneBuilder,
    occupied: OccupiedArea,
    name: str,
    place: NDArray[np.float64],
    *,
    room_m: float,
    base_m: float,
    rng: np.random.Generator,
) -> bool:
    """Plant a tree where there is space for its trunk.

    Args:
        builder: The scene.
        occupied: Occupied ground, which is extended.
        name: Name of its prototype.
        place: Its place (2,) [m].
        room_m: Radius of the ground that it takes [m].
        base_m: Height of the ground [m].
        rng: Random generator.

    Returns:
        Whether the ground was free.
    """
    scale, yaw = float(rng.uniform(0.75, 1.3)), float(rng.uniform(0, 2 * np.pi))
    free = occupied.claim(Point(place).buffer(room_m, quad_segs=2))
    if free:
        builder.place(name, place, base_m=base_m, yaw_rad=yaw, scale=scale)
    return free


def soil_without(block: Polygon, covers: list[LandCover]) -> BaseGeometry:
    """Return the part of a block that is soil: neither water nor paved.

    Args:
        block: The block.
        covers: The areas of the map.

    Returns:
        The soil.
    """
    hard = [each.area for each in covers if each.cover in ("water", "car_park", "paved")]
    near = [area for area in hard if area.intersects(block)]
    return block.difference(shapely.union_all(near)) if near else block
