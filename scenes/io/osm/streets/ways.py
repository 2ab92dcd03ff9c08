"""Roads of a map from its ways, cut at the nodes that they share and at the edge of the map."""

import itertools
from collections.abc import Callable, Iterator
from dataclasses import replace

import numpy as np
import shapely
from numpy.typing import NDArray
from shapely.geometry import LineString, Point
from shapely.geometry.base import BaseGeometry

from echoscape.scenes.io.osm.elements.map_data import OsmMap, Way
from echoscape.scenes.io.osm.streets.road_graph import Road
from echoscape.scenes.io.osm.streets.road_types import (
    UNDRIVEN,
    is_driven,
    is_reversed,
    is_undriven,
    street_type,
)

_CUT_ID = 1 << 70
"""First id of the ends of cut roads; ids of nodes are below 2^63."""
_BUILT_UP_M = 35.0
_BUILT_UP_PER_M = 1 / 90.0

Places = dict[int, NDArray[np.float64]]


def cut_roads(
    osm: OsmMap,
    places: Places,
    area: BaseGeometry,
    tree: shapely.STRtree,
    rng_of: Callable[[int], np.random.Generator],
) -> tuple[list[Road], list[Road]]:
    """Cut the roads of a map.

    Args:
        osm: The map.
        places: Place of every node (2,) [m].
        area: The area of the map.
        tree: Footprints of its buildings.
        rng_of: Returns the random generator of a way from its id.

    Returns:
        The driven roads, cut at the nodes that they share, and the undriven ones.
    """
    driven = [way for way in osm.ways.values() if is_driven(way.tags) and len(way.nodes) > 1]
    uses: dict[int, int] = {}
    for way in driven:
        for place, node in enumerate(way.nodes):
            uses[node] = uses.get(node, 0) + (1 if place in (0, len(way.nodes) - 1) else 2)
    roads: list[Road] = []
    cuts = itertools.count(_CUT_ID)
    for way in driven:
        kind = street_type(way, built_up=_is_built_up(way, places, tree), rng=rng_of(way.id))
        nodes = way.nodes[::-1] if is_reversed(way.tags) else way.nodes
        for piece in _pieces(nodes, uses):
            line = np.array([places[node] for node in piece])
            road = Road(
                start=piece[0],
                end=piece[-1],
                line=line,
                type=kind,
                is_ring=way.tags.get("junction") in ("roundabout", "circular"),
            )
            roads += _within(road, area, cuts)
    tracks = [
        part
        for way in osm.ways.values()
        if is_undriven(way.tags) and len(way.nodes) > 1
        for part in _within(_track(way, places), area, cuts)
    ]
    return roads, tracks


def _pieces(nodes: tuple[int, ...], uses: dict[int, int]) -> list[tuple[int, ...]]:
    """Cut a way at the nodes that other ways, or the way itself, use as well."""
    nodes = tuple(node for place, node in enumerate(nodes) if place == 0 or node != nodes[place - 1])
    cuts = [0, *(at for at in range(1, len(nodes) - 1) if uses[nodes[at]] > 2), len(nodes) - 1]
    return [nodes[a : b + 1] for a, b in itertools.pairwise(cuts) if b > a]


def _track(way: Way, places: Places) -> Road:
    kind = UNDRIVEN[way.tags["highway"]]
    return Road(
        start=way.nodes[0],
        end=way.nodes[-1],
        line=np.array([places[node] for node in way.nodes]),
        type=kind,
    )


def _within(road: Road, area: BaseGeometry, cuts: Iterator[int]) -> list[Road]:
    """Return the parts of a road in the area of the map; cut ends get ids of their own."""
    line = LineString(road.line)
    if area.contains(line):
        return [road]
    made = []
    for part in shapely.get_parts(line.intersection(area)):
        if not isinstance(part, LineString) or part.length < 1.0:
            continue
        points = np.asarray(part.coords)[:, :2]
        if line.project(Point(points[1])) < line.project(Point(points[0])):
            points = points[::-1]
        start = road.start if np.array_equal(points[0], road.line[0]) else next(cuts)
        end = road.end if np.array_equal(points[-1], road.line[-1]) else next(cuts)
        made.append(replace(road, start=start, end=end, line=points))
    return made


def _is_built_up(way: Way, places: Places, tree: shapely.STRtree) -> bool:
    """Return whether a building stands along every 90 m of a way."""
    line = LineString([places[node] for node in way.nodes])
    near = tree.query(line, predicate="dwithin", distance=_BUILT_UP_M)
    return len(near) > max(line.length * _BUILT_UP_PER_M, 1.0)
