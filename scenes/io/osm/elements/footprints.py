"""Polygons of a map from closed ways and multipolygon relations, in the plane.

Multipolygons: wiki.openstreetmap.org/wiki/Relation:multipolygon. Rings are put together from the ways of each
role, and the area is that of the outer rings less that of the inner ones. Incomplete relations are left out.
"""

from collections.abc import Callable, Iterator
from dataclasses import dataclass

import numpy as np
import shapely
from numpy.typing import NDArray
from shapely.geometry import LineString, MultiPolygon, Polygon
from shapely.geometry.base import BaseGeometry

from echoscape.scenes.io.osm.elements.map_data import OsmMap, Relation, Tags

_SKIN_M = 0.005
"""Deviation from a straight edge below which a corner is left out [m]."""
_SMALLEST_M2 = 0.5


@dataclass(frozen=True, kw_only=True)
class Shape:
    """An element of a map with an area.

    Attributes:
        kind: 1 of a way, 2 of a relation.
        id: Id of the element.
        part: Number of the polygon where it has several.
        polygon: Its polygon, counter-clockwise, which may have holes [m].
        tags: Its tags.
    """

    kind: int
    id: int
    part: int
    polygon: Polygon
    tags: Tags


def shapes_of(
    osm: OsmMap, places: dict[int, NDArray[np.float64]], wanted: Callable[[Tags], bool]
) -> list[Shape]:
    """Collect polygons.

    Args:
        osm: The map.
        places: Place of every node (2,) [m].
        wanted: Whether an element is wanted, by its tags.

    Returns:
        The polygons in order: those of ways, then those of relations, by id.
    """
    found = []
    for way in osm.ways.values():
        if way.is_ring and wanted(way.tags):
            ring = Polygon([places[node] for node in way.nodes])
            found += _shapes(1, way.id, shapely.make_valid(ring), way.tags)
    for relation in osm.relations.values():
        if relation.tags.get("type") in ("multipolygon", "boundary") and wanted(relation.tags):
            found += _shapes(2, relation.id, _area(relation, osm, places), relation.tags)
    return found


def _shapes(kind: int, number: int, area: BaseGeometry, tags: Tags) -> Iterator[Shape]:
    """Yield the polygons of an area, in order of their lowest corner."""
    whole = [each for each in shapely.get_parts(area) if isinstance(each, Polygon)]
    parts = [each for each in shapely.orient_polygons(shapely.simplify(whole, _SKIN_M)) if each.is_valid]
    sound = [each for each in parts if isinstance(each, Polygon) and each.area > _SMALLEST_M2]
    for part, polygon in enumerate(sorted(sound, key=lambda each: each.bounds)):
        yield Shape(kind=kind, id=number, part=part, polygon=polygon, tags=tags)


def _area(relation: Relation, osm: OsmMap, places: dict[int, NDArray[np.float64]]) -> BaseGeometry:
    """Return the area of a multipolygon, empty where a way is missing."""
    rings: dict[str, list[LineString]] = {"outer": [], "inner": []}
    for kind, ref, role in relation.members:
        if kind != "way" or role not in ("", "outer", "inner"):
            continue
        if ref not in osm.ways:
            return Polygon()
        if len(osm.ways[ref].nodes) > 1:
            rings[role or "outer"].append(LineString([places[node] for node in osm.ways[ref].nodes]))
    outer, inner = (_filled(rings[role]) for role in ("outer", "inner"))
    return outer.difference(inner)


def _filled(lines: list[LineString]) -> BaseGeometry:
    """Return the area that lines enclose."""
    if not lines:
        return MultiPolygon()
    faces = shapely.get_parts(shapely.polygonize([shapely.unary_union(lines)]))
    return shapely.union_all([Polygon(face.exterior) for face in faces])
