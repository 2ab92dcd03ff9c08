"""Roads between buildings: as wide as these let them be, smooth, with space to turn round at dead ends.

Buildings stand where the map says; roads make way for them.
"""

import itertools
from collections.abc import Iterator
from dataclasses import replace

import numpy as np
import shapely
from shapely.geometry import LineString, Point

from echoscape.scenes.core import portable_math
from echoscape.scenes.core.gaussian import gaussian_filter1d
from echoscape.scenes.geometry.curves import Line, arc_length, resampled, section
from echoscape.scenes.io.osm.streets.road_graph import SHORTEST_END_M, Road, RoadMap
from echoscape.scenes.io.osm.streets.road_types import LANE_RANGE_M
from echoscape.scenes.roads.junctions import ROUNDABOUT_RADIUS_M
from echoscape.scenes.roads.street_network import StreetType

CLEAR_M = 0.4
"""Least distance of a carriageway from a building [m]."""
_SMOOTH_M = 4.0
"""Standard deviation of the Gaussian that rounds the corners of lines [m]: radius 6.4 m at a right angle."""
_TURN_ROOM_M = 10.5
_TURN_BACK_M = 5.0
_STEP_BACK_M = 5.0
_MOST_STEPS = 20


def fitted(graph: RoadMap, tree: shapely.STRtree) -> tuple[list[Road], list[Road]]:
    """Fit roads between buildings.

    Args:
        graph: The roads; nodes of dead ends that are shortened are moved.
        tree: Footprints of the buildings.

    Returns:
        The roads that fit, as wide as they can be, and those that do not.
    """
    fitting, dropped = [], []
    for road in graph.roads:
        smooth = replace(road, line=smooth_line(road.line))
        fit = next((each for each in _shortened(smooth, graph) if _has_room(each, graph, tree)), None)
        wide = None if fit is None else _widest(fit, tree)
        if fit is None or wide is None:
            dropped.append(smooth)
            continue
        # A junction keeps its place; only a node without other roads moves with the shortened end.
        for node, place in ((wide.start, wide.line[0]), (wide.end, wide.line[-1])):
            if len(graph.arms(node)) == 1:
                graph.places[node] = place
        fitting.append(wide)
    return fitting, dropped


def smooth_line(line: Line) -> Line:
    """Round the corners of a line, keeping its ends.

    Args:
        line: Line (P, 2) [m].

    Returns:
        The line (N, 2) with points 1 m apart [m].
    """
    fine = resampled(line, 1.0)
    step = float(arc_length(fine)[-1]) / (len(fine) - 1)
    reach = min(len(fine) - 1, int(4 * _SMOOTH_M / step) + 1)
    before = 2 * fine[0] - fine[reach:0:-1]
    after = 2 * fine[-1] - fine[-2 : -reach - 2 : -1]
    long = gaussian_filter1d(np.concatenate([before, fine, after]), _SMOOTH_M / step, axis=0, mode="nearest")
    smooth = long[reach : reach + len(fine)]
    smooth[0], smooth[-1] = line[0], line[-1]
    return resampled(smooth, 1.0)


def _narrower(kind: StreetType) -> list[StreetType]:
    """Return a cross-section and narrower ones, the widest first."""
    lean = replace(kind, parking_m=0.0)
    slim = replace(lean, lane_width_m=LANE_RANGE_M[0])
    return [kind, lean, slim, replace(slim, lanes=1)]


def _is_free(line: Line, kind: StreetType, tree: shapely.STRtree) -> bool:
    strip = LineString(line).buffer(kind.half_width_m + CLEAR_M, cap_style="flat")
    return len(tree.query(strip, predicate="intersects")) == 0


def _widest(road: Road, tree: shapely.STRtree) -> Road | None:
    """Return a road as wide as the buildings let it be, None where it is too narrow for its lanes."""
    kind = next((kind for kind in _narrower(road.type) if _is_free(road.line, kind, tree)), None)
    return None if kind is None else replace(road, type=kind)


def _dead_ends(road: Road, graph: RoadMap) -> tuple[bool, bool]:
    """Return whether a car has to turn round at the start and at the end of a road."""
    first, last = (len(graph.arms(node)) == 1 and not road.type.oneway for node in (road.start, road.end))
    return first, last


def _shortened(road: Road, graph: RoadMap) -> Iterator[Road]:
    """Yield a road and, where it has dead ends, shorter ones, the longest first."""
    yield road
    length = road.length_m
    steps = np.arange(0.0, max(length - SHORTEST_END_M, 0.0) + 1e-6, _STEP_BACK_M)[:_MOST_STEPS].tolist()
    first, last = (steps if dead else [0.0] for dead in _dead_ends(road, graph))
    cuts = sorted(itertools.product(first, last), key=lambda cut: (sum(cut), cut))
    for start, end in cuts[1:]:
        if length - start - end >= SHORTEST_END_M:
            yield replace(road, line=section(road.line, start, length - end))


def _has_room(road: Road, graph: RoadMap, tree: shapely.STRtree) -> bool:
    """Return whether a road fits at its narrowest, with space to turn round at its dead ends."""
    if not _is_free(road.line, _narrower(road.type)[-1], tree):
        return False
    for is_dead, line in zip(_dead_ends(road, graph), (road.line, road.line[::-1]), strict=True):
        at = section(line, 0.0, _TURN_BACK_M)[-1]
        if is_dead and len(tree.query(Point(at).buffer(_TURN_ROOM_M), predicate="intersects")):
            return False
    return True


def has_space(graph: RoadMap, streets: list[Road], node: int, tree: shapely.STRtree) -> bool:
    """Check whether a roundabout of the standard size fits, with its arms apart.

    Args:
        graph: The roads.
        streets: The roads that fit between the buildings.
        node: The node of the roundabout.
        tree: Footprints of the buildings.

    Returns:
        Whether there is space for it.
    """
    arms = [
        road.line if end == road.start else road.line[::-1]
        for road in streets
        for end in (road.start, road.end)
        if end == node
    ]
    if len(arms) < 3 or min(float(arc_length(arm)[-1]) for arm in arms) < 2.5 * ROUNDABOUT_RADIUS_M:
        return False
    ahead = [arm[min(15, len(arm) - 1)] - arm[0] for arm in arms]
    angles = np.sort([portable_math.arctan2(step[1], step[0]) for step in ahead])
    gaps = np.diff(np.append(angles, angles[0] + 2 * np.pi))
    disc = Point(graph.places[node]).buffer(ROUNDABOUT_RADIUS_M + 3.0)
    return bool(gaps.min() > 0.6) and len(tree.query(disc, predicate="intersects")) == 0
