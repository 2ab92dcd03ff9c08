"""The graph of the roads of a map: ways cut at the nodes they share, roundabouts as one node, simplified.

Nodes nearer to each other than a junction is large are merged, and roads of one kind that meet end to end are
one road. Everything is done in the order of the ids, so that the order of the file does not matter.
"""

from dataclasses import dataclass, replace

import numpy as np
import shapely
from numpy.typing import NDArray

from echoscape.scenes.geometry.curves import Line, arc_length
from echoscape.scenes.roads.street_network import StreetType

SHORTEST_M = 20.0
"""Length below which a road between two junctions is taken as part of them [m]."""
SHORTEST_END_M = 32.0
"""Length below which a dead end has no space to turn round [m]."""
_RING_M = (8.0, 26.0)
"""Radii of a ring that becomes a roundabout [m]; smaller ones become a crossing, larger ones stay a ring."""
_ALIKE_M = 6.0


@dataclass(frozen=True, kw_only=True)
class Road:
    """A road between two nodes of the graph.

    Attributes:
        start: Id of the node at its start.
        end: Id of the node at its end.
        line: Its line (P, 2), whose ends are these nodes [m].
        type: Its cross-section.
        is_ring: Whether it is part of a roundabout.
    """

    start: int
    end: int
    line: Line
    type: StreetType
    is_ring: bool = False

    @property
    def length_m(self) -> float:
        """Length of the line [m]."""
        return float(arc_length(self.line)[-1])

    def reversed(self) -> "Road":
        """Return the road from its end to its start."""
        return replace(self, start=self.end, end=self.start, line=self.line[::-1])


@dataclass(kw_only=True)
class RoadMap:
    """Roads and the nodes at their ends.

    Attributes:
        places: Place of each node (2,) [m], by id.
        roads: The roads.
        roundabouts: Nodes that are roundabouts.
    """

    places: dict[int, NDArray[np.float64]]
    roads: list[Road]
    roundabouts: set[int]

    def arms(self, node: int) -> list[int]:
        """Return the indices of the roads at a node, twice where both ends of one are there."""
        found = [number for number, road in enumerate(self.roads) if road.start == node]
        return found + [number for number, road in enumerate(self.roads) if road.end == node]


def simplified(roads: list[Road]) -> RoadMap:
    """Simplify roads that are cut at every shared node.

    Args:
        roads: The roads, in the order of their ways.

    Returns:
        Roads between junctions and dead ends.
    """
    places: dict[int, NDArray[np.float64]] = {}
    for road in roads:
        places[road.start], places[road.end] = road.line[0], road.line[-1]
    graph = RoadMap(places=places, roads=list(roads), roundabouts=set())
    _merge_rings(graph)
    _join_pairs(graph)
    _contract(graph)
    _drop_stubs(graph)
    _join_pairs(graph)
    used = {node for road in graph.roads for node in (road.start, road.end)}
    graph.places = {node: place for node, place in sorted(graph.places.items()) if node in used}
    graph.roundabouts &= used
    return graph


def _merge_rings(graph: RoadMap) -> None:
    """Turn rings of roundabouts into one node at their middle, unless they are large."""
    rings = [road for road in graph.roads if road.is_ring]
    for nodes in _groups([(road.start, road.end) for road in rings]):
        points = np.concatenate([road.line for road in rings if road.start in nodes])
        middle = (points.min(axis=0) + points.max(axis=0)) / 2
        radius = float(np.hypot(*(points - middle).T).mean())
        if radius > _RING_M[1]:
            continue
        graph.roads = [road for road in graph.roads if not (road.is_ring and road.start in nodes)]
        node = min(nodes)
        _move(graph, nodes, node, middle, extend=True)
        if radius >= _RING_M[0]:
            graph.roundabouts.add(node)


def _groups(pairs: list[tuple[int, int]]) -> list[set[int]]:
    """Return the sets of nodes that pairs connect, in order of their lowest node."""
    groups: list[set[int]] = []
    for pair in pairs:
        touched = [group for group in groups if group & set(pair)]
        groups = [group for group in groups if group not in touched]
        groups.append(set(pair).union(*touched))
    return sorted(groups, key=min)


def _move(
    graph: RoadMap, nodes: set[int], node: int, place: NDArray[np.float64], *, extend: bool = False
) -> None:
    """Make several nodes one at a new place; roads are extended to it, or their last point is moved there."""
    moved = []
    for road in graph.roads:
        line = road.line
        if road.start in nodes:
            line = np.concatenate([place[None], line if extend else line[1:]])
            road = replace(road, start=node, line=line)
        if road.end in nodes:
            line = np.concatenate([line if extend else line[:-1], place[None]])
            road = replace(road, end=node, line=line)
        moved.append(road)
    graph.roads = moved
    for each in nodes:
        graph.places.pop(each, None)
    graph.places[node] = place
    if nodes & graph.roundabouts:
        graph.roundabouts = (graph.roundabouts - nodes) | {node}


def _join_pairs(graph: RoadMap) -> None:
    """Join the two roads at nodes where no other road ends and both are of one kind."""
    for node in sorted(graph.places):
        arms = graph.arms(node)
        if len(arms) != 2 or arms[0] == arms[1] or node in graph.roundabouts:
            continue
        first, second = (graph.roads[number] for number in sorted(arms))
        if first.type != second.type:
            continue
        first = first if first.end == node else first.reversed()
        second = second if second.start == node else second.reversed()
        if first.type.oneway:
            original = [graph.roads[number] for number in sorted(arms)]
            if (original[0].end == node) == (original[1].end == node):
                continue  # they lead towards each other
            if original[0].start == node:
                first, second = original[1], original[0]
        joined = replace(first, end=second.end, line=np.concatenate([first.line, second.line[1:]]))
        rest = [road for number, road in enumerate(graph.roads) if number not in arms]
        graph.roads = [*rest, joined]


def _contract(graph: RoadMap) -> None:
    """Merge the ends of short roads, the shortest first, and drop what then leads from a node to itself."""
    while True:
        short = [road for road in graph.roads if road.start != road.end and _is_short(graph, road)]
        if not short:
            break
        road = min(short, key=lambda each: (each.length_m, each.start, each.end))
        nodes = {road.start, road.end}
        fixed = sorted(nodes & graph.roundabouts)
        place = graph.places[fixed[0]] if fixed else (graph.places[road.start] + graph.places[road.end]) / 2
        _remove(graph, road)
        _move(graph, nodes, min(nodes), place)
    graph.roads = [road for road in graph.roads if road.start != road.end or road.length_m > 3 * SHORTEST_M]
    _drop_doubles(graph)


def _remove(graph: RoadMap, road: Road) -> None:
    graph.roads = [each for each in graph.roads if each is not road]


def _is_short(graph: RoadMap, road: Road) -> bool:
    """Return whether a road between two junctions is too short for the junctions at its ends."""
    if min(len(graph.arms(road.start)), len(graph.arms(road.end))) < 2:
        return False
    rings = len({road.start, road.end} & graph.roundabouts)
    return road.length_m < SHORTEST_M + 10.0 * rings


def _drop_doubles(graph: RoadMap) -> None:
    """Keep the first of several roads that join the same nodes on nearly the same line."""
    kept: list[Road] = []
    for road in graph.roads:
        line = shapely.LineString(road.line)
        twins = [each for each in kept if {each.start, each.end} == {road.start, road.end}]
        if all(line.hausdorff_distance(shapely.LineString(each.line)) > _ALIKE_M for each in twins):
            kept.append(road)
    graph.roads = kept


def _drop_stubs(graph: RoadMap) -> None:
    """Drop dead ends that are too short to turn round in, until none is left."""
    while True:
        stubs = [
            road
            for road in graph.roads
            if road.length_m < SHORTEST_END_M
            and min(len(graph.arms(road.start)), len(graph.arms(road.end))) < 2
        ]
        if not stubs:
            return
        for road in stubs:
            _remove(graph, road)
