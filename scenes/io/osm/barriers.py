"""Hedges, walls, fences and guard rails of a map, and its single objects: trees, lamps, benches, bollards.

Heights and materials that the map does not give are drawn for each from its id
(wiki.openstreetmap.org/wiki/Key:barrier). Roads cut barriers; what would stand on a road is left out.
"""

from collections.abc import Callable

import numpy as np
import shapely
from numpy.typing import NDArray
from shapely.geometry import LineString, Point
from shapely.geometry.base import BaseGeometry

from echoscape.scenes.geometry.curves import arc_length, headings, points_at, resampled
from echoscape.scenes.io.osm.areas import plant
from echoscape.scenes.io.osm.elements.map_data import OsmMap, Tags
from echoscape.scenes.io.osm.elements.tag_values import length_m
from echoscape.scenes.town.gardens import add_boundary
from echoscape.scenes.town.parcels import CityBlock
from echoscape.scenes.town.placement import SceneBuilder

_KINDS: dict[str, tuple[str, tuple[float, float]]] = {
    "hedge": ("hedge", (1.2, 2.0)),
    "wall": ("wall", (1.0, 2.0)),
    "city_wall": ("wall", (4.0, 8.0)),
    "retaining_wall": ("wall", (0.8, 2.0)),
    "fence": ("", (1.0, 1.9)),
    "guard_rail": ("guard_rail", (0.8, 0.8)),
}
"""Kind of boundary and range of its height [m] by value of barrier."""
_FENCES = {
    "chain_link": "chain_link",
    "wire": "chain_link",
    "barbed_wire": "chain_link",
    "electric": "chain_link",
    "railing": "railing",
    "metal": "railing",
    "metal_bars": "railing",
    "bars": "railing",
    "wood": "boards",
    "board": "boards",
    "panel": "boards",
    "close_boarded": "boards",
    "split_rail": "boards",
    "picket": "boards",
}
_RANGE_M = (0.4, 15.0)
_RAIL_M = 4.0
_ROW_M = 8.0
_OBJECTS: dict[tuple[str, str], tuple[str, ...]] = {
    ("highway", "street_lamp"): ("lamp_arm",),
    ("barrier", "bollard"): ("bollard_metal", "bollard_concrete"),
    ("amenity", "bench"): ("bench",),
    ("amenity", "waste_basket"): ("bin_round",),
    ("amenity", "recycling"): ("bin_wheeled",),
}
_TREES = ("tree_broadleaf", "tree_tall", "tree_spreading", "tree_street")
_NEEDLES = ("tree_conifer",)
_ROOM_M = 0.5

RngOf = Callable[[tuple[int, int, int]], np.random.Generator]


def add_barriers(
    builder: SceneBuilder,
    osm: OsmMap,
    places: dict[int, NDArray[np.float64]],
    block: CityBlock,
    free: BaseGeometry,
    *,
    rng_of: RngOf,
) -> None:
    """Add all barriers that are lines, and rows of trees.

    Args:
        builder: The scene.
        osm: The map.
        places: Place of every node (2,) [m].
        block: Occupied ground and height of the ground.
        free: Ground on which they may stand.
        rng_of: Returns the random generator of an element.
    """
    for way in osm.ways.values():
        if len(way.nodes) < 2:
            continue
        kind = way.tags.get("barrier", "")
        row = way.tags.get("natural") == "tree_row"
        if kind not in _KINDS and not row:
            continue
        rng = rng_of((1, way.id, 0))
        inside = LineString([places[node] for node in way.nodes]).intersection(free)
        for part in shapely.get_parts(
            shapely.line_merge(inside) if inside.geom_type != "LineString" else inside
        ):
            if isinstance(part, LineString) and part.length > 0.5:
                if row:
                    _tree_row(builder, part, block, way.tags, rng)
                else:
                    _barrier(builder, part, kind, block, way.tags, rng)


def _barrier(
    builder: SceneBuilder, line: LineString, kind: str, block: CityBlock, tags: Tags, rng: np.random.Generator
) -> None:
    made, span = _KINDS[kind]
    drawn = float(rng.uniform(*span))
    height = float(np.clip(length_m(tags, "height") or drawn, *_RANGE_M))
    if made == "guard_rail":
        _rails(builder, line, block)
        return
    if not made:
        drawn_kind = str(rng.choice(["boards", "boards", "railing", "chain_link"]))
        made = _FENCES.get(tags.get("fence_type", tags.get("material", "")), drawn_kind)
    add_boundary(builder, line, made, block, rng=rng, height_m=height)


def _rails(builder: SceneBuilder, line: LineString, block: CityBlock) -> None:
    run = resampled(np.asarray(line.coords)[:, :2], 1.0)
    along, heading = arc_length(run), headings(run)
    for at in np.arange(_RAIL_M / 2, along[-1], _RAIL_M):
        place = points_at(run, np.array([at]))[0]
        builder.place("guard_rail", place, base_m=block.base_m, yaw_rad=float(np.interp(at, along, heading)))
    block.occupied.add(line.buffer(0.3))


def _tree_row(
    builder: SceneBuilder, line: LineString, block: CityBlock, tags: Tags, rng: np.random.Generator
) -> None:
    run = np.asarray(line.coords)[:, :2]
    length, at = line.length, float(rng.uniform(0.0, 2.0))
    while at < length:
        name = str(rng.choice(_species(tags)))
        place = points_at(run, np.array([at]))[0]
        plant(builder, block.occupied, name, place, room_m=_ROOM_M, base_m=block.base_m, rng=rng)
        at += _ROW_M * float(rng.uniform(0.8, 1.25))


def _species(tags: Tags) -> tuple[str, ...]:
    return _NEEDLES if tags.get("leaf_type") == "needleleaved" else _TREES


def add_objects(
    builder: SceneBuilder,
    osm: OsmMap,
    places: dict[int, NDArray[np.float64]],
    block: CityBlock,
    free: BaseGeometry,
    *,
    rng_of: RngOf,
) -> None:
    """Add trees, lamps, benches, bins and bollards that are mapped as nodes.

    Args:
        builder: The scene.
        osm: The map.
        places: Place of every node (2,) [m].
        block: Occupied ground and height of the ground.
        free: Ground on which they may stand.
        rng_of: Returns the random generator of an element.
    """
    for node in osm.nodes.values():
        names = next((_OBJECTS[item] for item in node.tags.items() if item in _OBJECTS), ())
        tree = node.tags.get("natural") == "tree"
        place = places[node.id]
        if not (names or tree) or not free.contains(Point(place)):
            continue
        rng = rng_of((0, node.id, 0))
        if tree:
            name = str(rng.choice(_species(node.tags)))
            plant(builder, block.occupied, name, place, room_m=_ROOM_M, base_m=block.base_m, rng=rng)
        elif block.occupied.claim(Point(place).buffer(0.4)):
            yaw = float(rng.uniform(0, 2 * np.pi))
            builder.place(str(rng.choice(names)), place, base_m=block.base_m, yaw_rad=yaw)
