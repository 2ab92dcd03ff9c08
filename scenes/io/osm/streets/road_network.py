"""Streets of a map: its roads as smooth lines with lanes, clear of buildings and connected with each other.

Buildings stand where the map says. A road gets as wide as they let it; turns, dead ends and roads for which
there is no space are not driven, and neither is what cannot be reached from everywhere else.
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace

import numpy as np
import shapely
from numpy.typing import NDArray
from shapely.geometry import LineString, Point
from shapely.geometry.base import BaseGeometry

from echoscape.scenes.core.lane_graph import RoadGraph
from echoscape.scenes.driving.route import LaneNetwork
from echoscape.scenes.geometry.curves import Line, resampled
from echoscape.scenes.io.osm.elements.map_data import OsmMap
from echoscape.scenes.io.osm.streets.fitting import CLEAR_M, fitted, has_space
from echoscape.scenes.io.osm.streets.road_graph import simplified
from echoscape.scenes.io.osm.streets.ways import Places, cut_roads
from echoscape.scenes.roads.junctions import TrimLengths, road_graph
from echoscape.scenes.roads.street_network import Network, OuterStreet, Street, StreetType


@dataclass(frozen=True, kw_only=True)
class Streets:
    """The streets of a map with their lanes.

    Attributes:
        network: The driven streets, and in its outskirts the carriageways on which nothing drives.
        roads: The lanes; each can be reached from every other.
        trims: Trimmed lengths of the driven streets.
        exits: Ends of driven streets at the edge of the map: the last 20 m of their line (P, 2) [m] and their
            cross-section.
    """

    network: Network
    roads: RoadGraph
    trims: TrimLengths
    exits: tuple[tuple[Line, StreetType], ...]


def street_plan(
    osm: OsmMap,
    places: Places,
    area: BaseGeometry,
    solid: Sequence[BaseGeometry],
    *,
    rng_of: Callable[[int], np.random.Generator],
) -> Streets | None:
    """Lay out the streets of a map.

    Args:
        osm: The map.
        places: Place of every node (2,) [m].
        area: The area of the map.
        solid: Footprints of its buildings.
        rng_of: Returns the random generator of a way from its id.

    Returns:
        The streets, None where there is no road that can be driven for ever.
    """
    tree = shapely.STRtree(solid)
    roads, tracks = cut_roads(osm, places, area, tree, rng_of)
    graph = simplified(roads)
    streets, dropped = fitted(graph, tree)
    junctions = {node: row for row, node in enumerate(graph.places)}
    points = np.array(list(graph.places.values())).reshape(-1, 2)
    rings = frozenset(junctions[node] for node in graph.roundabouts if has_space(graph, streets, node, tree))
    numbered = [
        Street(start=junctions[road.start], end=junctions[road.end], line=road.line, type=road.type)
        for road in streets
    ]
    found = _connected(points, numbered, rings, tree)
    if found is None:
        return None
    network, lanes, trims, lost = found
    outer = [OuterStreet(line=street.line, type=street.type) for street in lost]
    outer += [OuterStreet(line=road.line, type=road.type) for road in (*dropped, *tracks)]
    return Streets(
        network=replace(network, outskirts=tuple(_clear(outer, solid))),
        roads=lanes,
        trims=trims,
        exits=tuple(_exits(network, area)),
    )


def _connected(
    points: NDArray[np.float64], streets: list[Street], rings: frozenset[int], tree: shapely.STRtree
) -> tuple[Network, RoadGraph, TrimLengths, list[Street]] | None:
    """Drop streets until every lane of the rest can be reached from every other; None if none is left."""
    lost: list[Street] = []
    while streets:
        network = _renumbered(points, streets, rings)
        roads, trims = road_graph(network)
        free = ~_blocked(roads, tree)
        loop = np.zeros(len(roads.lanes), dtype=np.bool_)
        try:
            loop[free] = LaneNetwork(_without(roads, ~free)).connected
        except ValueError:  # no loop of lanes
            return None
        gone = {street for lane, street in enumerate(_street_of_lanes(network)) if not loop[lane]}
        if not gone:
            return network, _without(roads, ~loop), trims, lost
        lost += [streets[number] for number in sorted(gone)]
        streets = [street for number, street in enumerate(streets) if number not in gone]
    return None


def _renumbered(points: NDArray[np.float64], streets: list[Street], rings: frozenset[int]) -> Network:
    """Return the network of the junctions in use; a roundabout with fewer than three arms is a crossing."""
    ends = [end for street in streets for end in (street.start, street.end)]
    used = sorted(set(ends))
    row = {junction: number for number, junction in enumerate(used)}
    return Network(
        junctions=points[used],
        streets=tuple(replace(street, start=row[street.start], end=row[street.end]) for street in streets),
        roundabouts=frozenset(row[each] for each in rings if ends.count(each) > 2),
    )


def _street_of_lanes(network: Network) -> list[int]:
    """Return the street of each street lane: these have the first ids, in the order of the streets."""
    return [
        number
        for number, street in enumerate(network.streets)
        for _ in range(street.type.lanes * (1 if street.type.oneway else 2))
    ]


def _blocked(roads: RoadGraph, tree: shapely.STRtree) -> NDArray[np.bool_]:
    """Return the lanes (N,) on which a car would touch a building."""
    swept = [LineString(lane.centre[::3]).buffer(lane.width_m / 2 + CLEAR_M) for lane in roads.lanes]
    blocked = np.zeros(len(swept), dtype=np.bool_)
    blocked[tree.query(swept, predicate="intersects")[0]] = True
    return blocked


def _without(roads: RoadGraph, removed: NDArray[np.bool_]) -> RoadGraph:
    """Return a road graph without some lanes (N,)."""
    number = np.cumsum(~removed) - 1

    def kept(lanes: tuple[int, ...]) -> tuple[int, ...]:
        return tuple(int(number[lane]) for lane in lanes if not removed[lane])

    return replace(
        roads,
        lanes=tuple(
            replace(
                lane,
                id=int(number[lane.id]),
                successors=kept(lane.successors),
                opposite=None if lane.opposite is None else (*kept((lane.opposite,)), None)[0],
            )
            for lane in roads.lanes
            if not removed[lane.id]
        ),
    )


def _clear(streets: list[OuterStreet], solid: Sequence[BaseGeometry]) -> list[OuterStreet]:
    """Return the parts of undriven streets that are clear of buildings."""
    whole = shapely.union_all(solid)
    made = []
    for street in streets:
        room = whole.buffer(street.type.half_width_m + CLEAR_M, quad_segs=3)
        for part in shapely.get_parts(LineString(street.line).difference(room)):
            if isinstance(part, LineString) and part.length > 3.0:
                line = resampled(np.asarray(part.coords)[:, :2], 1.0)
                made.append(OuterStreet(line=line, type=replace(street.type, parking_m=0.0, pavement_m=0.0)))
    return made


def _exits(network: Network, area: BaseGeometry) -> list[tuple[Line, StreetType]]:
    """Return the ends of streets that leave the map."""
    edge = area.boundary
    found = []
    for street in network.streets:
        for junction, line in ((street.start, street.line[::-1]), (street.end, street.line)):
            if len(network.arms(junction)) == 1 and edge.distance(Point(line[-1])) < 1.0:
                found.append((line[-20:], street.type))
    return found
