"""Plan and meshes of the ground of a map, the lines on which people walk, and the streets beyond its edge."""

from dataclasses import replace

import numpy as np
import shapely
from shapely.geometry import LineString, Polygon
from shapely.geometry.base import BaseGeometry

from echoscape.scenes.core.gaussian import gaussian_filter1d
from echoscape.scenes.geometry.curves import Line, offset, resampled
from echoscape.scenes.io.osm.areas import LandCover, soil_without
from echoscape.scenes.io.osm.streets.fitting import CLEAR_M
from echoscape.scenes.io.osm.streets.road_network import Streets
from echoscape.scenes.roads.ground_mesh import (
    KERB_WIDTH_M,
    PEDESTRIAN_WIDTH_M,
    WALKING_OFFSET_M,
    Ground,
    boundaries,
    ground_plan,
    kerb_runs,
    level_mesh,
    polygons,
)
from echoscape.scenes.roads.street_network import PLAIN, Network, OuterStreet
from echoscape.scenes.town.placement import OccupiedArea, SceneBuilder
from echoscape.scenes.town.presets import SIGHT_M

_LEAVE_M = 340.0
_RINGS_M = (95.0, 200.0)
_WINDING_M, _WAVE_M = 14.0, 45.0
_SHORTEST_WALK_M = 10.0
_WALK_M = 1.48
"""Distance of walking lines from the kerb [m], as in `footpath_lines`."""


def map_ground(network: Network, streets: Streets, area: Polygon, solid: BaseGeometry) -> Ground:
    """Make the plan of the ground, from which the buildings are cut out.

    Args:
        network: The streets, with those that are not driven.
        streets: The driven streets and their lanes.
        area: The area of the map.
        solid: Footprints of the buildings.

    Returns:
        The plan: it holds the map, and all land within sight of the driven streets.
    """
    ground = ground_plan(network, streets.roads, streets.trims, margin_m=SIGHT_M)
    land = shapely.union_all([ground.driven.buffer(SIGHT_M).simplify(0.5), area, ground.corridor])
    swept = [LineString(lane.centre[::3]).buffer(lane.width_m / 2) for lane in streets.roads.lanes]
    room = solid.buffer(0.5 * CLEAR_M, join_style="mitre").difference(shapely.union_all(swept))
    return Ground(
        carriageway=ground.carriageway.difference(room),
        corridor=ground.corridor.difference(solid),
        land=shapely.union_all([Polygon(each.exterior) for each in polygons(land)]),
        streets=tuple(piece.difference(room) for piece in ground.streets),
        junctions=tuple(piece.difference(room) for piece in ground.junctions),
        driven=ground.driven,
        outskirts=tuple(piece.difference(room) for piece in ground.outskirts),
    )


def lay_map_ground(builder: SceneBuilder, ground: Ground, covers: list[LandCover], *, high: float) -> None:
    """Add carriageways, kerbs, pavements, water, paved areas and soil, each an object of its own.

    Args:
        builder: The scene.
        ground: Plan of the ground.
        covers: Land cover of the map.
        high: Height of the kerbs [m], 0 for none.
    """
    for piece in (*ground.streets, *ground.junctions, *ground.outskirts):
        _level(builder, "road", "asphalt", piece, 0.0)
    inner = ground.carriageway
    if high > 0:
        for run in kerb_runs(ground.carriageway, height_m=high):
            builder.add("kerb", {"paving": run})
        inner = inner.buffer(KERB_WIDTH_M, join_style="mitre", mitre_limit=2.0)
    for piece in polygons(ground.corridor.difference(inner)):
        _level(builder, "pavement", "paving", piece, high)
    for each in covers:
        if each.cover == "water":
            _level(builder, "ground", "water", each.area, high)
        elif each.cover == "car_park":
            _level(builder, "road", "asphalt", each.area, high)
        elif each.cover == "paved":
            _level(builder, "pavement", "paving", each.area, high)
    for block in polygons(ground.land.difference(shapely.union_all([ground.corridor, inner]))):
        _level(builder, "ground", "soil", soil_without(block, covers), high)


def _level(
    builder: SceneBuilder, class_name: str, material: str, shape: BaseGeometry, height_m: float
) -> None:
    mesh = level_mesh(shape, height_m)
    if mesh is not None and len(mesh.faces):
        builder.add(class_name, {material: mesh})


def walking_lines(ground: Ground, occupied: OccupiedArea) -> tuple[Line, ...]:
    """Return the lines along the kerbs on which people can walk, on both sides of each line.

    Args:
        ground: Plan of the ground.
        occupied: What stands there.

    Returns:
        Lines (P, 2) [m], closed where nothing interrupts them.
    """
    swept = WALKING_OFFSET_M + PEDESTRIAN_WIDTH_M / 2
    paved = ground.corridor.buffer(0.01 - swept, quad_segs=4).intersection(ground.driven)
    shapely.prepare(paved)
    made: list[Line] = []
    for rim in boundaries(ground.carriageway.buffer(_WALK_M).simplify(0.05)):
        line = LineString(rim).segmentize(2.0)
        things = occupied.near(line.buffer(swept))
        blocked = (
            shapely.union_all(shapely.buffer(things, swept + 0.05, quad_segs=3)) if things else Polygon()
        )
        rest = line.intersection(paved).difference(blocked)
        if rest.equals_exact(line, 1e-6):
            made.append(np.asarray(line.coords)[:, :2])
            continue
        parts = shapely.get_parts(shapely.line_merge(rest) if rest.geom_type != "LineString" else rest)
        made += [
            resampled(np.asarray(part.coords)[:, :2], 2.0)
            for part in parts
            if isinstance(part, LineString) and part.length > _SHORTEST_WALK_M
        ]
    return tuple(made)


def streets_beyond(
    streets: Streets, area: Polygon, *, ringed: bool, rng: np.random.Generator
) -> list[OuterStreet]:
    """Return streets beyond the map: those that leave it lead on, and around a built-up map go winding ones.

    Args:
        streets: The streets of the map.
        area: The area of the map.
        ringed: Whether streets go round the map.
        rng: Random generator.

    Returns:
        The streets, on which nothing drives.
    """
    made: list[OuterStreet] = []
    for line, kind in streets.exits:
        ahead = line[-1] - line[0]
        ahead = ahead / np.hypot(*ahead)
        far = LineString([line[-1] + ahead, line[-1] + _LEAVE_M * ahead]).difference(area)
        part = max(shapely.get_parts(far), key=lambda each: each.length, default=None)
        if isinstance(part, LineString) and part.length > 40.0:
            points = resampled(np.asarray(part.coords)[:, :2], 1.0)
            made.append(OuterStreet(line=points, type=replace(kind, parking_m=0.0)))
    for distance in _RINGS_M if ringed else ():
        made.append(OuterStreet(line=_winding(area, distance, rng), type=PLAIN))
    return made


def _winding(area: Polygon, distance_m: float, rng: np.random.Generator) -> Line:
    """Return a closed line around the map, at a distance that varies smoothly."""
    ring = resampled(np.asarray(area.buffer(distance_m, quad_segs=8).exterior.coords)[:, :2], 1.0)
    noise = gaussian_filter1d(rng.normal(size=len(ring) - 1), _WAVE_M, mode="wrap")
    aside = _WINDING_M * noise / noise.std()
    smooth = gaussian_filter1d(ring[:-1], 20.0, axis=0, mode="wrap")
    moved = offset(np.concatenate([smooth, smooth[:1]]), 1.0) - np.concatenate([smooth, smooth[:1]])
    line = np.concatenate([smooth, smooth[:1]]) + np.append(aside, aside[0])[:, None] * moved
    line[-1] = line[0]
    return line
