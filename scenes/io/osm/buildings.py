"""Meshes of the buildings of a map over their footprints; courtyards are cut open, so that none is left."""

import numpy as np
import shapely
from numpy.typing import NDArray
from shapely.geometry import LineString, Polygon, box
from shapely.geometry.base import BaseGeometry

from echoscape.scenes.assets.buildings import facade, roof
from echoscape.scenes.assets.buildings.builder import BuildingBuilder
from echoscape.scenes.assets.buildings.building import building
from echoscape.scenes.core.scene import Mesh
from echoscape.scenes.geometry.meshes import merge
from echoscape.scenes.io.osm.mapped_building import MappedBuilding

_PARTY_M = 0.3
_SHORTEST_M = 0.05
_SKIN_M = 0.002


def building_parts(
    mapped: MappedBuilding, neighbours: BaseGeometry, *, visible: BaseGeometry, rng: np.random.Generator
) -> dict[str, Mesh]:
    """Make the meshes of a building.

    Args:
        mapped: The building.
        neighbours: The other buildings near it; walls along them are party walls without windows.
        visible: Where facades can be seen from: walls out of it are plain.
        rng: Random generator of this building.

    Returns:
        Meshes by name of the material.
    """
    parts: dict[str, list[Mesh]] = {}
    whole = mapped.shape.polygon
    for outline in _without_holes(whole):
        corners = _corners(outline)
        is_open = _open_edges(corners, whole, neighbours, visible)
        for material, mesh in _one(mapped, corners, is_open, rng).items():
            parts.setdefault(material, []).append(mesh)
    return {material: merge(meshes) for material, meshes in sorted(parts.items())}


def _corners(outline: Polygon) -> NDArray[np.float64]:
    """Return the corners (N, 2) of an outline, counter-clockwise, those that coincide once [m]."""
    corners = np.asarray(shapely.orient_polygons(outline).exterior.coords)[:-1, :2]
    return corners[np.hypot(*(np.roll(corners, -1, axis=0) - corners).T) > _SKIN_M]


def _without_holes(polygon: Polygon) -> list[Polygon]:
    """Cut a polygon through its holes into polygons without any."""
    if not polygon.interiors:
        return [polygon]
    hole = Polygon(polygon.interiors[0])
    x0, y0, x1, y1 = polygon.bounds
    middle = hole.centroid
    wide = x1 - x0 > y1 - y0
    halves = (
        (box(x0 - 1, y0 - 1, middle.x, y1 + 1), box(middle.x, y0 - 1, x1 + 1, y1 + 1))
        if wide
        else (box(x0 - 1, y0 - 1, x1 + 1, middle.y), box(x0 - 1, middle.y, x1 + 1, y1 + 1))
    )
    pieces = [part for half in halves for part in shapely.get_parts(polygon.intersection(half))]
    sound = [part for part in pieces if isinstance(part, Polygon) and part.area > 1e-6]
    return [part for piece in sound for part in _without_holes(piece)]


def _open_edges(
    corners: NDArray[np.float64], whole: Polygon, neighbours: BaseGeometry, visible: BaseGeometry
) -> list[bool]:
    """Return which edges have windows: those with free ground before them that can be seen."""
    ends = np.roll(corners, -1, axis=0)
    step = ends - corners
    normal = np.stack([step[:, 1], -step[:, 0]], axis=-1) / np.maximum(np.hypot(*step.T), 1e-9)[:, None]
    before = shapely.points((corners + ends) / 2 + _PARTY_M * normal)
    free = ~shapely.intersects(before, whole) & ~shapely.intersects(before, neighbours)
    return (free & shapely.intersects(before, visible)).tolist()


def _one(
    mapped: MappedBuilding, corners: NDArray[np.float64], is_open: list[bool], rng: np.random.Generator
) -> dict[str, Mesh]:
    """Make a building over an outline without holes; a plain one where its parapet would cross itself."""
    inner = Polygon(roof.offset_outline(corners, -0.25))
    shortest = np.hypot(*(np.roll(corners, -1, axis=0) - corners).T).min()
    sound = inner.is_valid and Polygon(corners).contains(inner) and shortest > _SHORTEST_M
    if not sound:
        return _plain(mapped, corners, rng)
    flat = "flat" if len(corners) != 4 and mapped.roof in ("", "gabled", "hipped") else mapped.roof
    shape_of_roof = "" if mapped.style not in ("house", "terrace") else flat
    return building(
        corners,
        height_m=mapped.wall_m,
        style=mapped.style,
        rng=rng,
        facades=is_open,
        roof_shape=shape_of_roof,
        roof_rise_m=mapped.rise_m,
    )


def _plain(mapped: MappedBuilding, corners: NDArray[np.float64], rng: np.random.Generator) -> dict[str, Mesh]:
    """Make walls and a flat roof without any detail."""
    made = BuildingBuilder(
        outline=corners, open_edges=[False] * len(corners), height_m=mapped.wall_m, rng=rng
    )
    for frame in made.frames:
        made.add("brick", frame.to_world(facade.panels(0.0, frame.length_m, 0.0, mapped.wall_m)))
    made.add("concrete", roof.lid(corners, mapped.wall_m))
    return made.meshes()


def seen_from(lines: list[LineString], *, reach_m: float) -> BaseGeometry:
    """Return the ground from which facades are seen closely enough to need windows.

    Args:
        lines: Middles of the driven streets.
        reach_m: Distance from them [m].

    Returns:
        The area.
    """
    area = shapely.union_all([line.simplify(1.0).buffer(reach_m, quad_segs=4) for line in lines])
    shapely.prepare(area)
    return area
