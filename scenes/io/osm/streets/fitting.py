"""Roads between buildings: as wide as these let them be, smooth, with space to turn round at dead ends.

Buildings stand where the map says; roads make way for them.
"""

from dataclasses import replace

import numpy as np
import shapely
from scipy.ndimage import gaussian_filter1d
from shapely.geometry import LineString, Point

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
        kind = next((kind for kind in _narrower(road.type) if _is_free(smooth.line, kind, tree)), None)
        ended = None if kind is None else _with_turning_space(replace(smooth, type=kind), graph, tree)
        if ended is None:
            dropped.append(smooth)
        else:
            fitting.append(ended)
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


def _with_turning_space(road: Road, graph: RoadMap, tree: shapely.STRtree) -> Road | None:
    """Shorten a dead end until a car can turn round in it; None where nowhere is space."""
    if road.type.oneway:
        return road
    for node in dict.fromkeys((road.start, road.end)):
        if len(graph.arms(node)) != 1:
            continue
        length = road.length_m
        for back in np.arange(0.0, max(length - SHORTEST_END_M, 0.0) + 1e-6, _STEP_BACK_M):
            line = (
                section(road.line, back, length)
                if node == road.start
                else section(road.line, 0, length - back)
            )
            end = line if node == road.start else line[::-1]
            at = section(end, 0.0, _TURN_BACK_M)[-1]
            if len(tree.query(Point(at).buffer(_TURN_ROOM_M), predicate="intersects")) == 0:
                road = replace(road, line=line)
                break
        else:
            return None
    # A junction keeps its place; only a node without other roads moves with the shortened end.
    for node, place in ((road.start, road.line[0]), (road.end, road.line[-1])):
        if len(graph.arms(node)) == 1:
            graph.places[node] = place
    return road


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
    angles = np.sort([np.arctan2(step[1], step[0]) for step in ahead])
    gaps = np.diff(np.append(angles, angles[0] + 2 * np.pi))
    disc = Point(graph.places[node]).buffer(ROUNDABOUT_RADIUS_M + 3.0)
    return bool(gaps.min() > 0.6) and len(tree.query(disc, predicate="intersects")) == 0
