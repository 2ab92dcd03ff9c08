"""A motorway: two carriageways of two lanes with hard shoulders, slip roads, and loops at both ends.

All lanes have a lateral offset from one winding middle line. The offset of a slip road changes smoothly, as
on a diverge taper, so that it leaves and joins the outer lane without a kink.
"""

import itertools
from dataclasses import dataclass

import numpy as np
import shapely
from numpy.typing import NDArray
from scipy.interpolate import CubicSpline
from shapely.geometry import LineString

from echoscape.scenes.core import portable_math
from echoscape.scenes.core.lane_graph import RoadGraph
from echoscape.scenes.geometry.curves import (
    Line,
    arc_length,
    left_normals,
    points_at,
    resampled,
    transformed,
    turnaround,
)
from echoscape.scenes.roads.ground_mesh import Ground, polygons
from echoscape.scenes.roads.lane_graph_builder import LaneGraphBuilder

INNER_M, OUTER_M = 4.8, 8.45
"""Distances from the middle line to the centres of the inner and outer lane [m]."""
EDGE_M = 13.6
"""Distance from the middle line to the outer edge of the hard shoulder [m]."""
_TAPER_M = 130.0
_LANE_M = 3.65
_SPEED_MPS = 31.0
_SLIP_MPS = 18.0
_LOOP_M = {INNER_M: 30.0, OUTER_M: 36.0}


@dataclass(frozen=True, kw_only=True)
class Motorway:
    """Lanes and ground of a motorway.

    Attributes:
        middle: Line along the central reservation (P, 2) [m].
        roads: The road graph.
        ground: Plan of the ground.
    """

    middle: Line
    roads: RoadGraph
    ground: Ground


def motorway(*, rng: np.random.Generator, margin_m: float) -> Motorway:
    """Make a motorway about 2.4 km long with one slip road per carriageway.

    Args:
        rng: Random generator.
        margin_m: Width of the land around it [m].

    Returns:
        The motorway.
    """
    middle = _middle(rng)
    builder = LaneGraphBuilder()
    ahead = _carriageway(builder, middle, rng)
    back = _carriageway(builder, middle[::-1], rng)
    for one, other in ((ahead, back), (back, ahead)):
        for place in (0, 1):
            _loop(builder, one[-1][place], other[0][place])
    for first, second in zip(ahead, back[::-1], strict=True):
        for place in (0, 1):
            if builder[first[place]].kind == "street":
                builder.pair_directions(first[place], second[place])
    roads = builder.graph(points_at(middle, np.array([0.0, 650.0, 1600.0, arc_length(middle)[-1]])))
    return Motorway(middle=middle, roads=roads, ground=_ground(middle, roads, margin_m))


def _middle(rng: np.random.Generator) -> Line:
    """Return a winding line of gentle curves along x."""
    x = np.linspace(-1200.0, 1200.0, 6)
    y = np.concatenate([[0.0], rng.uniform(-60.0, 60.0, 4), [0.0]])
    fine = np.linspace(x[0], x[-1], 8001)
    return resampled(np.stack([fine, CubicSpline(x, y, bc_type="natural")(fine)], axis=-1), 0.8)


def _carriageway(builder: LaneGraphBuilder, middle: Line, rng: np.random.Generator) -> list[tuple[int, int]]:
    """Add the carriageway to the right of `middle`; return the (inner, outer) lane ids of its sections."""
    along = arc_length(middle)
    leave, join = 500.0 + rng.uniform(0, 80), 1500.0 + rng.uniform(-80, 80)
    cuts = [0.0, leave, leave + _TAPER_M, join, join + _TAPER_M, along[-1]]
    sections: list[tuple[int, int]] = []
    for number, (first, last) in enumerate(itertools.pairwise(cuts)):
        kind = "street" if number % 2 == 0 else "turn"
        pair = [
            builder.add(
                _beside(middle, first, last, np.full(2, aside)),
                kind,
                width_m=_LANE_M,
                speed_mps=_SPEED_MPS,
                junction=None if kind == "street" else 1 + number // 2,
            )
            for aside in (INNER_M, OUTER_M)
        ]
        sections.append((pair[0], pair[1]))
    for before, after in itertools.pairwise(sections):
        for place in (0, 1):
            builder.join(before[place], after[place])
    for before, after, place in ((0, 2, 0), (0, 2, 1), (2, 4, 0), (2, 4, 1)):  # changes of lane
        builder.connect(sections[before][place], sections[after][1 - place], junction=1 + before // 2)
    _slip(builder, middle, (leave, join), sections)
    return sections


def _slip(
    builder: LaneGraphBuilder, middle: Line, span: tuple[float, float], sections: list[tuple[int, int]]
) -> None:
    """Add a slip road that leaves the outer lane at `span[0]` and joins it again beyond `span[1]`."""
    leave, join = span
    stop = join + _TAPER_M
    share = np.linspace(0.0, 1.0, 2001)
    rise = np.clip(share * (stop - leave) / 420.0, 0, 1)
    fall = np.clip((1 - share) * (stop - leave) / 420.0, 0, 1)
    level = np.minimum(rise, fall)
    aside = OUTER_M + 46.0 * (level * level * level) * (10 - 15 * level + 6 * level**2)
    line = _beside(middle, leave, stop, aside)
    along = arc_length(line)
    cuts = np.searchsorted(along, [0.0, _TAPER_M, along[-1] - _TAPER_M, along[-1]])
    kinds = ("turn", "street", "turn")
    ids = [
        builder.add(line[a : b + 1], kind, width_m=_LANE_M, speed_mps=_SLIP_MPS, junction=junction)
        for a, b, kind, junction in zip(cuts[:-1], cuts[1:], kinds, (1, None, 2), strict=True)
    ]
    builder.set_yield(ids[1])
    for before, after in (
        (sections[0][1], ids[0]),
        (ids[0], ids[1]),
        (ids[1], ids[2]),
        (ids[2], sections[4][1]),
    ):
        builder.join(before, after)


def _beside(middle: Line, first_m: float, last_m: float, aside_m: NDArray[np.float64]) -> Line:
    """Return a section of the line `aside_m` to the right of `middle`."""
    count = int((last_m - first_m) / 0.5) + 1
    distance = np.linspace(first_m, last_m, count)
    along, normal = arc_length(middle), left_normals(middle)
    base = CubicSpline(along, middle)(distance)
    left = CubicSpline(along, normal)(distance)
    left /= np.linalg.norm(left, axis=1, keepdims=True)
    aside = np.interp(np.linspace(0, 1, count), np.linspace(0, 1, len(aside_m)), aside_m)
    return base - aside[:, None] * left


def _loop(builder: LaneGraphBuilder, before: int, after: int) -> None:
    """Connect the end of one carriageway's lane to the start of the other's by a wide loop."""
    end, start = builder[before].centre[-1], builder[after].centre[0]
    outward = start - end
    aside = float(np.linalg.norm(outward)) / 2
    radius = min(_LOOP_M.items(), key=lambda item: abs(item[0] - aside))[1]
    heading = float(portable_math.arctan2(-outward[0], outward[1]))
    line = transformed(turnaround(aside, radius, side_radius_m=70.0), (start + end) / 2, heading)
    line[0], line[-1] = end, start
    lane = builder.add(line, "u_turn", width_m=_LANE_M, speed_mps=_SLIP_MPS, junction=3)
    builder.join(before, lane)
    builder.join(lane, after)


def _ground(middle: Line, roads: RoadGraph, margin_m: float) -> Ground:
    """Return the ground: carriageways with shoulders, slip roads and loops, and the land around them."""
    main = LineString(middle).buffer(EDGE_M, cap_style="flat")
    narrow = [
        LineString(lane.centre[::4]).buffer(2.9)
        for lane in roads.lanes
        if lane.kind == "u_turn" or lane.speed_limit_mps <= _SLIP_MPS
    ]
    carriageway = shapely.union_all([main, *narrow]).buffer(1.0).buffer(-1.0).simplify(0.02)
    rest = polygons(carriageway.difference(main))
    land = shapely.box(*carriageway.buffer(margin_m).bounds)
    return Ground(
        carriageway=carriageway,
        corridor=carriageway,
        land=land,
        streets=(main.intersection(carriageway),),
        junctions=tuple(rest),
        driven=carriageway,
    )
