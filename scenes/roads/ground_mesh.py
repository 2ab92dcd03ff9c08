"""The ground as meshes: carriageways, kerbs, pavements and the soil between, cut from plane polygons.

A carriageway is the union of what its lanes sweep, with rounded corners; everything else is offset from it,
so that nothing overlaps and no gap remains.
"""

from dataclasses import dataclass

import numpy as np
import shapely
from numpy.typing import NDArray
from shapely.geometry import LinearRing, LineString, MultiPolygon, Point, Polygon, box
from shapely.geometry.base import BaseGeometry

from echoscape.scenes.core.lane_graph import RoadGraph
from echoscape.scenes.core.scene import Mesh
from echoscape.scenes.geometry.curves import section
from echoscape.scenes.roads.junctions import ROUNDABOUT_RADIUS_M, TrimLengths
from echoscape.scenes.roads.street_network import Network

WALKING_OFFSET_M = 0.38
"""Distance at which people walk beside their footpath line [m]."""

PEDESTRIAN_WIDTH_M = 0.64
"""Width of a person [m]."""

_STRIP_POINTS = 6

KERB_WIDTH_M = 0.14
_CORNER_M = 5.0
_CHORD_M = 0.005
"""Greatest deviation of the chords of a centre line from it [m]."""
_BACK_GARDENS_M = 40.0
"""Width of the land behind the outermost streets, of those that are not driven [m]."""
_SKIN_M = 0.02


@dataclass(frozen=True, kw_only=True)
class Ground:
    """Plan of the ground.

    Attributes:
        carriageway: All carriageways.
        corridor: Carriageways and pavements.
        land: The whole area of the scene.
        streets: Carriageway of each street.
        junctions: Carriageway of each junction; streets and junctions do not overlap.
        driven: The driven streets with their pavements and all that they enclose.
        outskirts: Carriageways of the streets beyond `driven`.
    """

    carriageway: BaseGeometry
    corridor: BaseGeometry
    land: BaseGeometry
    streets: tuple[BaseGeometry, ...]
    junctions: tuple[BaseGeometry, ...]
    driven: BaseGeometry
    outskirts: tuple[BaseGeometry, ...] = ()


def ground_plan(network: Network, roads: RoadGraph, trims: TrimLengths, *, margin_m: float) -> Ground:
    """Make the plan of the ground of a street network.

    Args:
        network: The street network.
        roads: Its lanes.
        trims: Trimmed lengths of its streets.
        margin_m: Least distance from the driven streets to the edge of the land [m].

    Returns:
        The plan.
    """
    middles = [_middle(street.line) for street in network.streets]
    swept = [
        _middle(
            section(street.line, _end_m(network, street.start), street.length_m - _end_m(network, street.end))
        ).buffer(street.type.half_width_m, cap_style="flat")
        for street in network.streets
    ]
    turns = [
        LineString(lane.centre[:: max(len(lane.centre) // 24, 1)]).buffer(lane.width_m / 2 + 0.4, quad_segs=4)
        for lane in roads.lanes
        if lane.kind != "street"
    ]
    outer = [_middle(street.line) for street in network.outskirts]
    beyond = [
        middle.buffer(street.type.half_width_m, quad_segs=6)
        for middle, street in zip(outer, network.outskirts, strict=True)
    ]
    carriageway = _rounded(shapely.union_all(swept + turns + beyond), _CORNER_M)
    paved = [
        middle.buffer(street.type.half_width_m + street.type.pavement_m)
        for middle, street in zip(middles, network.streets, strict=True)
    ]
    driven = _filled(shapely.union_all([*paved, *turns]))
    paved += [
        middle.buffer(street.type.half_width_m + street.type.pavement_m)
        for middle, street in zip(outer, network.outskirts, strict=True)
    ]
    narrowest = min(street.type.pavement_m for street in network.streets)
    corridor = _rounded(shapely.union_all([*paved, carriageway.buffer(narrowest)]), 3.0)
    streets, crossings = _pieces(network, trims, carriageway.intersection(driven) if beyond else carriageway)
    return Ground(
        carriageway=carriageway,
        corridor=corridor,
        land=_land(driven, corridor, margin_m, has_outskirts=bool(beyond)),
        streets=streets,
        junctions=crossings,
        driven=driven,
        outskirts=tuple(polygons(carriageway.difference(driven))) if beyond else (),
    )


def _middle(line: NDArray[np.float64]) -> BaseGeometry:
    """Return a centre line with no more points than its bends need."""
    return LineString(line).simplify(_CHORD_M)


def _filled(shape: BaseGeometry) -> BaseGeometry:
    """Return a shape with all that it encloses."""
    return shapely.union_all([Polygon(polygon.exterior) for polygon in polygons(shape)])


def _land(
    driven: BaseGeometry, corridor: BaseGeometry, margin_m: float, *, has_outskirts: bool
) -> BaseGeometry:
    """Return the ground up to `margin_m` beyond the driven streets, in the country a rectangle."""
    if not has_outskirts and margin_m > 100.0:
        return box(*_filled(corridor).buffer(margin_m).bounds)
    land = driven.buffer(margin_m).union(_filled(corridor).buffer(min(margin_m, _BACK_GARDENS_M)))
    return _filled(land.simplify(0.5))


def _end_m(network: Network, junction: int) -> float:
    """Return how far from a junction the straight sides of its streets end [m]."""
    if junction in network.roundabouts:
        return ROUNDABOUT_RADIUS_M
    return 6.0 if len(network.arms(junction)) == 1 else 0.0


def polygons(shape: BaseGeometry) -> list[Polygon]:
    """Return the polygons of a shape, without slivers.

    Args:
        shape: Any geometry.

    Returns:
        Its polygons larger than 0.05 m^2.
    """
    parts = shapely.get_parts(shape)
    return [p for p in parts if isinstance(p, Polygon) and p.area > 0.05]


def _rounded(shape: BaseGeometry, radius_m: float) -> BaseGeometry:
    """Round the inward corners of a shape, as a kerb rounds the corner of two streets."""
    closed = shape.buffer(radius_m, quad_segs=8).buffer(-radius_m, quad_segs=8)
    return MultiPolygon(polygons(closed.simplify(_SKIN_M)))


def _pieces(
    network: Network, trims: TrimLengths, carriageway: BaseGeometry
) -> tuple[tuple[BaseGeometry, ...], tuple[BaseGeometry, ...]]:
    """Cut the carriageway into one piece per street and one per junction."""
    shapely.prepare(carriageway)
    streets = []
    for street, cut in zip(network.streets, trims, strict=True):
        line = LineString(section(street.line, cut[0], street.length_m - cut[1]))
        streets.append(
            line.buffer(street.type.half_width_m + 0.5, cap_style="flat").intersection(carriageway)
        )
    rest = carriageway.difference(shapely.union_all(streets))
    pieces = polygons(rest)
    tree = shapely.STRtree([Point(xy) for xy in network.junctions])
    owner = tree.nearest(pieces) if pieces else np.zeros(0, dtype=np.intp)
    crossings = tuple(
        MultiPolygon([piece for piece, index in zip(pieces, owner, strict=True) if index == j])
        for j in range(len(network.junctions))
    )
    return tuple(streets), crossings


def level_mesh(shape: BaseGeometry, height_m: float) -> Mesh | None:
    """Make a level mesh that faces up.

    Args:
        shape: Shape in the plane.
        height_m: Height [m].

    Returns:
        The mesh, None if the shape is empty.
    """
    triangles = [
        triangle
        for polygon in polygons(shape)
        for triangle in shapely.get_parts(shapely.constrained_delaunay_triangles(polygon))
    ]
    if not triangles:
        return None
    corners = shapely.get_coordinates(shapely.orient_polygons(triangles)).reshape(-1, 4, 2)[:, :3]
    edges = np.diff(corners.astype(np.float32).astype(np.float64), axis=1)
    double_area = edges[:, 0, 0] * edges[:, 1, 1] - edges[:, 0, 1] * edges[:, 1, 0]
    corners = corners[double_area > 1e-3]  # thinner triangles have no accurate normal in single precision
    raised = np.concatenate([corners, np.full((*corners.shape[:2], 1), height_m)], axis=-1)
    faces = np.arange(corners.shape[0] * 3, dtype=np.uint32).reshape(-1, 3)
    return Mesh(vertices=raised.reshape(-1, 3).astype(np.float32), faces=faces)


def boundaries(shape: BaseGeometry) -> list[NDArray[np.float64]]:
    """Return the closed boundaries of a shape.

    Args:
        shape: Shape in the plane.

    Returns:
        Boundaries (P, 2) [m] with the shape to their left.
    """
    lines = []
    for polygon in polygons(shape):
        turned = shapely.orient_polygons(polygon)
        lines += [turned.exterior, *turned.interiors]
    return [np.asarray(line.coords)[:, :2] for line in lines]


def kerb_runs(carriageway: BaseGeometry, *, height_m: float, run_m: float = 60.0) -> list[Mesh]:
    """Make kerbs along the boundary of the carriageway, each with a face and a top.

    Args:
        carriageway: The carriageway.
        height_m: Height of the kerb [m].
        run_m: Approximate length of a mesh [m].

    Returns:
        The meshes.
    """
    runs = []
    for rim in boundaries(carriageway):
        away = _away(rim) * KERB_WIDTH_M
        along = np.cumsum(np.hypot(*np.diff(rim, axis=0).T)) // run_m
        starts = np.flatnonzero(np.diff(along, prepend=-1.0))
        for first, last in zip(starts, [*starts[1:], len(rim) - 1], strict=True):
            if last > first:
                runs.append(_kerb(rim[first : last + 1], away[first : last + 1], height_m))
    return runs


def _away(rim: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return mitred normals (P, 2) of a closed ring that point to its right, out of the carriageway."""
    step = np.diff(rim, axis=0)
    step /= np.linalg.norm(step, axis=1, keepdims=True)
    normal = np.stack([step[:, 1], -step[:, 0]], axis=-1)
    before = np.roll(normal, 1, axis=0)
    mitre = (normal + before) / np.maximum(1.0 + np.sum(normal * before, axis=1, keepdims=True), 0.4)
    return np.concatenate([mitre, mitre[:1]])


def _kerb(front: NDArray[np.float64], away: NDArray[np.float64], height_m: float) -> Mesh:
    """Make the face and top of a kerb along `front` (P, 2)."""
    count = len(front)

    def level(line: NDArray[np.float64], height: float) -> NDArray[np.float64]:
        return np.concatenate([line, np.full((count, 1), height)], axis=1)

    back = front + away
    vertices = np.concatenate([level(front, 0.0), level(front, height_m), level(back, height_m)])
    here = np.arange(count - 1)
    faces = []
    for low, high in ((0, count), (count, 2 * count)):
        a, b, c, d = here + low, here + low + 1, here + high + 1, here + high
        faces += [np.stack([a, c, b], axis=-1), np.stack([a, d, c], axis=-1)]
    return Mesh(vertices=vertices.astype(np.float32), faces=np.concatenate(faces).astype(np.uint32))


def footpath_lines(ground: Ground, *, inside_m: float = 1.48) -> tuple[NDArray[np.float64], ...]:
    """Return closed lines around the blocks, on the pavement, on both sides of which people walk.

    They lie between the strip at the kerb, where street furniture stands, and the facades.

    Args:
        ground: Plan of the ground.
        inside_m: Distance from the kerb [m].

    Returns:
        Lines (P, 2) [m].
    """
    if ground.corridor.area - ground.carriageway.area < 1000.0:
        return ()
    lines = []
    corridor = ground.corridor.buffer(0.01)
    shapely.prepare(corridor)
    for rim in boundaries(ground.carriageway.buffer(inside_m).simplify(0.05)):
        ring = LinearRing(rim)
        if ring.length > 90.0 and corridor.contains(ring):
            lines.append(np.asarray(ring.segmentize(2.0).coords)[::1, :2])
    return tuple(lines)


def footpath_strips(footpaths: tuple[NDArray[np.float64], ...]) -> list[shapely.Polygon]:
    """Return the ground that people sweep on both sides of footpath lines, in short pieces.

    Args:
        footpaths: Lines (P, 2) [m].

    Returns:
        Polygons.
    """
    pieces = [
        shapely.LineString(path[first : first + _STRIP_POINTS + 1])
        for path in footpaths
        for first in range(0, len(path) - 1, _STRIP_POINTS)
    ]
    return [piece.buffer(WALKING_OFFSET_M + PEDESTRIAN_WIDTH_M / 2, quad_segs=4) for piece in pieces]
