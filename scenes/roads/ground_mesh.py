"""The ground as meshes: carriageways, kerbs, pavements and the soil between, cut from plane polygons.

Every carriageway is the union of what its lanes sweep, with corners rounded as kerbs are; all else is offset
from it, so that nothing overlaps and no gap is left.
"""

from dataclasses import dataclass

import numpy as np
import shapely
from numpy.typing import NDArray
from shapely.geometry import LinearRing, LineString, MultiPolygon, Point, Polygon, box
from shapely.geometry.base import BaseGeometry

from echoscape.scenes.core.lane_graph import RoadGraph
from echoscape.scenes.core.scene import Mesh
from echoscape.scenes.geometry.curves import part
from echoscape.scenes.roads.junctions import RING_RADIUS_M, Room
from echoscape.scenes.roads.street_network import Network

ASIDE_M = 0.38

SHOULDERS_M = 0.64

_STRIP_POINTS = 6

KERB_WIDTH_M = 0.14
_CORNER_M = 5.0
_SKIN_M = 0.02


@dataclass(frozen=True, kw_only=True)
class Ground:
    """The plan of a town: `carriageway`, `corridor` (carriageway and pavements) and all the built-on `land`.

    `streets` holds the carriageway of each street and `crossings` that of each junction, without overlap.
    """

    carriageway: BaseGeometry
    corridor: BaseGeometry
    land: BaseGeometry
    streets: tuple[BaseGeometry, ...]
    crossings: tuple[BaseGeometry, ...]


def ground_plan(network: Network, roads: RoadGraph, room: Room, *, margin_m: float) -> Ground:
    """Return the plan of the streets' ground; the land reaches `margin_m` beyond the outermost streets."""
    middles = [LineString(street.line) for street in network.streets]
    swept = [
        LineString(
            part(street.line, _end_m(network, street.start), street.length_m - _end_m(network, street.end))
        ).buffer(street.type.half_width_m, cap_style="flat")
        for street in network.streets
    ]
    turns = [
        LineString(lane.centre[:: max(len(lane.centre) // 40, 1)]).buffer(lane.width_m / 2 + 0.4)
        for lane in roads.lanes
        if lane.kind != "street"
    ]
    carriageway = _rounded(shapely.union_all(swept + turns), _CORNER_M)
    paved = [
        middle.buffer(street.type.half_width_m + street.type.pavement_m)
        for middle, street in zip(middles, network.streets, strict=True)
    ]
    narrowest = min(street.type.pavement_m for street in network.streets)
    corridor = _rounded(shapely.union_all([*paved, carriageway.buffer(narrowest)]), 3.0)
    outer = shapely.union_all([Polygon(p.exterior) for p in polygons(corridor)])
    land = outer.buffer(margin_m) if margin_m else box(-500.0, -500.0, 500.0, 500.0)
    if margin_m > 100.0:
        land = box(*land.bounds)
    land = shapely.union_all([Polygon(p.exterior) for p in polygons(land.simplify(0.5))])
    streets, crossings = _pieces(network, room, carriageway)
    return Ground(carriageway=carriageway, corridor=corridor, land=land, streets=streets, crossings=crossings)


def _end_m(network: Network, junction: int) -> float:
    """Return how far from a junction the straight sides of its streets end."""
    if junction in network.roundabouts:
        return RING_RADIUS_M
    return 6.0 if len(network.arms(junction)) == 1 else 0.0


def polygons(shape: BaseGeometry) -> list[Polygon]:
    """Return the polygons of a shape that are more than slivers."""
    parts = shapely.get_parts(shape)
    return [p for p in parts if isinstance(p, Polygon) and p.area > 0.05]


def _rounded(shape: BaseGeometry, radius_m: float) -> BaseGeometry:
    """Return `shape` with its inward corners rounded, as a kerb rounds the corner of two streets."""
    closed = shape.buffer(radius_m, quad_segs=6).buffer(-radius_m, quad_segs=6)
    return MultiPolygon(polygons(closed.union(shape).simplify(_SKIN_M)))


def _pieces(
    network: Network, room: Room, carriageway: BaseGeometry
) -> tuple[tuple[BaseGeometry, ...], tuple[BaseGeometry, ...]]:
    """Cut the carriageway into a piece for each street and one for each junction."""
    shapely.prepare(carriageway)
    streets = []
    for street, cut in zip(network.streets, room, strict=True):
        line = LineString(part(street.line, cut[0], street.length_m - cut[1]))
        streets.append(
            line.buffer(street.type.half_width_m + 0.5, cap_style="flat").intersection(carriageway)
        )
    rest = carriageway.difference(shapely.union_all(streets))
    pieces = polygons(rest)
    tree = shapely.STRtree([Point(xy) for xy in network.junctions])
    owner = tree.nearest(pieces) if pieces else np.zeros(0, dtype=np.intp)
    crossings = tuple(
        MultiPolygon([piece for piece, own in zip(pieces, owner, strict=True) if own == j])
        for j in range(len(network.junctions))
    )
    return tuple(streets), crossings


def flat(shape: BaseGeometry, height_m: float) -> Mesh | None:
    """Return `shape` as a level mesh at `height_m` that faces upwards, or None if it is empty."""
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
    corners = corners[double_area > 1e-3]  # thinner ones have no sound normal in single precision
    raised = np.concatenate([corners, np.full((*corners.shape[:2], 1), height_m)], axis=-1)
    faces = np.arange(corners.shape[0] * 3, dtype=np.uint32).reshape(-1, 3)
    return Mesh(vertices=raised.reshape(-1, 3).astype(np.float32), faces=faces)


def rings(shape: BaseGeometry) -> list[NDArray[np.float64]]:
    """Return the closed rims (P, 2) of a shape, each with the shape to its left."""
    lines = []
    for polygon in polygons(shape):
        turned = shapely.orient_polygons(polygon)
        lines += [turned.exterior, *turned.interiors]
    return [np.asarray(line.coords)[:, :2] for line in lines]


def kerb_runs(carriageway: BaseGeometry, *, height_m: float, run_m: float = 60.0) -> list[Mesh]:
    """Return kerbs along the rim of the carriageway in runs of about `run_m`: a face and a top."""
    runs = []
    for rim in rings(carriageway):
        away = _away(rim) * KERB_WIDTH_M
        along = np.cumsum(np.hypot(*np.diff(rim, axis=0).T)) // run_m
        starts = np.flatnonzero(np.diff(along, prepend=-1.0))
        for first, last in zip(starts, [*starts[1:], len(rim) - 1], strict=True):
            if last > first:
                runs.append(_kerb(rim[first : last + 1], away[first : last + 1], height_m))
    return runs


def _away(rim: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return (P, 2) mitred normals of a closed ring that point to its right, out of the carriageway."""
    step = np.diff(rim, axis=0)
    step /= np.linalg.norm(step, axis=1, keepdims=True)
    normal = np.stack([step[:, 1], -step[:, 0]], axis=-1)
    before = np.roll(normal, 1, axis=0)
    mitre = (normal + before) / np.maximum(1.0 + np.sum(normal * before, axis=1, keepdims=True), 0.4)
    return np.concatenate([mitre, mitre[:1]])


def _kerb(front: NDArray[np.float64], away: NDArray[np.float64], height_m: float) -> Mesh:
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


def walking_lines(ground: Ground, *, inside_m: float = 1.48) -> tuple[NDArray[np.float64], ...]:
    """Return closed lines round the blocks, `inside_m` from the kerb on the pavement.

    People walk on both sides of them, between the strip at the kerb where furniture stands and the facades.
    """
    if ground.corridor.area - ground.carriageway.area < 1000.0:
        return ()
    lines = []
    for rim in rings(ground.carriageway.buffer(inside_m).simplify(0.05)):
        ring = LinearRing(rim)
        if ring.length > 90.0 and ground.corridor.buffer(0.01).contains(ring):
            lines.append(np.asarray(ring.segmentize(2.0).coords)[::1, :2])
    return tuple(lines)


def walking_strips(walks: tuple[NDArray[np.float64], ...]) -> list[shapely.Polygon]:
    """Return the ground that people sweep on both sides of `walks`, each (P, 2) [m], in short pieces."""
    pieces = [
        shapely.LineString(walk[first : first + _STRIP_POINTS + 1])
        for walk in walks
        for first in range(0, len(walk) - 1, _STRIP_POINTS)
    ]
    return [piece.buffer(ASIDE_M + SHOULDERS_M / 2, quad_segs=4) for piece in pieces]
