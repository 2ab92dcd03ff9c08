"""Buildings of a map: footprints as mapped, heights by height or building:levels, styles by kind and size.

What the map does not say is drawn for each building from its id (wiki.openstreetmap.org/wiki/Key:building,
Simple 3D Buildings for heights and roofs). Footprints with courtyards are cut into parts without holes.
"""

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
import shapely
from numpy.typing import NDArray
from shapely.geometry import LineString, Polygon, box
from shapely.geometry.base import BaseGeometry

from echoscape.scenes.assets.buildings import facade, roof
from echoscape.scenes.assets.buildings.builder import BuildingBuilder
from echoscape.scenes.assets.buildings.building import Style, building
from echoscape.scenes.core.scene import Mesh
from echoscape.scenes.geometry.meshes import merge
from echoscape.scenes.io.osm.elements.footprints import Shape
from echoscape.scenes.io.osm.elements.map_data import Tags
from echoscape.scenes.io.osm.elements.tag_values import count, length_m

STOREY_M = 3.0
"""Height of a level [m], as building:levels is usually converted (Simple 3D Buildings)."""
_ROOF_LEVEL_M = 2.5
_LOWEST_M, _HIGHEST_M = 2.2, 300.0
_SMALLEST_M2 = 3.0
_PARTY_M = 0.3
_SHORTEST_M = 0.05
_SKIN_M = 0.002
_SLOPE = (0.65, 0.95)
_HALL_SLOPE = 0.12
_MANSARD_M = 1.2
_STYLES: dict[str, Style] = {
    **dict.fromkeys(("house", "detached", "bungalow", "semidetached_house", "farm", "cabin", "hut"), "house"),
    **dict.fromkeys(("terrace", "pub"), "terrace"),
    **dict.fromkeys(
        ("apartments", "residential", "dormitory", "hotel", "office", "commercial", "school", "university"),
        "block",
    ),
    **dict.fromkeys(("college", "hospital", "civic", "public", "government", "kindergarten"), "block"),
    **dict.fromkeys(
        ("industrial", "warehouse", "barn", "hangar", "supermarket", "retail", "garage", "garages", "shed"),
        "hall",
    ),
    **dict.fromkeys(("greenhouse", "stable", "farm_auxiliary", "sports_hall", "service"), "hall"),
}  # type: ignore[assignment]
_LEVELS: dict[str, tuple[float, float]] = {
    "terrace": (2.0, 3.0),
    "house": (1.6, 2.2),
    "block": (3.0, 5.0),
    "hall": (2.0, 3.5),
    "tower": (10.0, 14.0),
}
"""Levels that are drawn where the map gives neither height nor levels, by style."""
_LOW_KINDS = ("garage", "garages", "shed", "carport", "roof", "hut", "greenhouse", "service")
_FLAT = ("flat", "skillion", "round", "dome", "sawtooth")
_ROOFS = {"gabled": "gabled", "hipped": "hipped", "half-hipped": "hipped", "pyramidal": "hipped"}


@dataclass(frozen=True, kw_only=True)
class MappedBuilding:
    """A building that stands.

    Attributes:
        shape: Its element and footprint.
        style: Its style.
        wall_m: Height of its walls, up to the eaves or the deck of a flat roof [m].
        roof: "flat", "gabled", "hipped" or "mansard"; "" lets the style decide.
        rise_m: Height of the roof above the walls [m], None where it is drawn.
    """

    shape: Shape
    style: Style
    wall_m: float
    roof: str
    rise_m: float | None


def is_building(tags: Tags) -> bool:
    """Check whether an element is a building that stands on the ground.

    Args:
        tags: Its tags.

    Returns:
        Whether it is one.
    """
    kind = tags.get("building", "no")
    lifted = (length_m(tags, "min_height") or 0.0) > 2.0 or (count(tags, "building:min_level") or 0.0) >= 1
    below = tags.get("location") == "underground" or (tags.get("layer", "0").startswith("-"))
    standing = kind not in ("no", "roof", "carport", "ruins", "construction", "proposed")
    return standing and not (lifted or below)


def mapped_buildings(
    shapes: list[Shape], *, rng_of: Callable[[Shape], np.random.Generator]
) -> list[MappedBuilding]:
    """Decide style and height of every building, leaving out those that stand in another one.

    Args:
        shapes: Their footprints.
        rng_of: Returns the random generator of an element.

    Returns:
        The buildings, in order.
    """
    shapes = [shape for shape in shapes if shape.polygon.area > _SMALLEST_M2]
    polygons = [shape.polygon for shape in shapes]
    tree = shapely.STRtree(polygons)
    made = []
    for row, shape in enumerate(shapes):
        others = [
            other for other in tree.query(shape.polygon, predicate="intersects").tolist() if other != row
        ]
        larger = [
            polygons[other] for other in others if (polygons[other].area, other) > (shape.polygon.area, row)
        ]
        if shapely.area(shapely.intersection(larger, shape.polygon)).sum() < 0.5 * shape.polygon.area:
            attached = any(_share_wall(shape.polygon, polygons[other]) for other in others)
            made.append(_mapped(shape, attached, rng_of(shape)))
    return made


def _share_wall(one: Polygon, other: Polygon) -> bool:
    return one.buffer(0.05).intersection(other.exterior).length > 3.0


def _mapped(shape: Shape, attached: bool, rng: np.random.Generator) -> MappedBuilding:
    tags = shape.tags
    drawn_levels, drawn_slope = rng.uniform(), rng.uniform(*_SLOPE)
    style = _style(shape, attached)
    levels, height = count(tags, "building:levels"), length_m(tags, "height", "building:height", "est_height")
    if levels is not None and levels >= 9 and style == "block":
        style = "tower"
    shape_of_roof = _roof(tags, style, shape.polygon)
    rise = _rise_m(tags, style, shape_of_roof, shape.polygon, drawn_slope)
    if height is not None:
        wall = max(height - rise, 0.5 * height)
        rise = height - wall
    else:
        low, high = _LEVELS[style] if tags.get("building") not in _LOW_KINDS else (0.8, 1.0)
        wall = STOREY_M * (levels if levels else low + drawn_levels * (high - low))
    return MappedBuilding(
        shape=shape,
        style=style,
        wall_m=float(np.clip(wall, _LOWEST_M, _HIGHEST_M)),
        roof=shape_of_roof,
        rise_m=rise if rise > 0 else None,
    )


def _style(shape: Shape, attached: bool) -> Style:
    """Return the style by kind, and of a kind that is not told by size."""
    kind, area = shape.tags["building"], shape.polygon.area
    if kind in _STYLES:
        style = _STYLES[kind]
        if kind == "residential" and area < 250.0:
            return "terrace" if attached else "house"
        return style
    if area < 30.0:
        return "hall"
    if area < 260.0:
        return "terrace" if attached else "house"
    return "block" if area < 2500.0 else "hall"


def _roof(tags: Tags, style: Style, polygon: Polygon) -> str:
    """Return the shape of the roof; only houses have others than their style's."""
    given = tags.get("roof:shape", "")
    if style not in ("house", "terrace"):
        return "flat" if style != "hall" else ""
    if given in _FLAT:
        return "flat"
    if len(polygon.exterior.coords) != 5 or polygon.interiors:
        return "mansard" if _mansard_fits(polygon) else "flat"
    return _ROOFS.get(given, "mansard" if given == "mansard" else "gabled" if style == "terrace" else "")


def _mansard_fits(polygon: Polygon) -> bool:
    """Return whether the slopes of a mansard roof meet nowhere."""
    if polygon.interiors:
        return False
    outline = np.asarray(polygon.exterior.coords)[:-1, :2]
    inner = Polygon(roof.offset_outline(outline, -1.4))
    outer = Polygon(roof.offset_outline(outline, 0.3))
    return inner.is_valid and outer.is_valid and polygon.contains(inner) and inner.area > 0.15 * polygon.area


def _rise_m(tags: Tags, style: Style, shape_of_roof: str, polygon: Polygon, slope: float) -> float:
    """Return the height of the ridge above the walls [m], 0 for flat roofs."""
    if shape_of_roof == "mansard":
        return _MANSARD_M
    if shape_of_roof == "flat" or style not in ("house", "terrace", "hall"):
        return 0.0
    sides = np.hypot(*np.diff(np.asarray(polygon.exterior.coords)[:, :2], axis=0).T)
    if len(sides) != 4:
        return 0.0
    half = min(sides[0] + sides[2], sides[1] + sides[3]) / 4
    if style == "hall":
        return _HALL_SLOPE * half
    given = length_m(tags, "roof:height")
    if given is None and (roof_levels := count(tags, "roof:levels")):
        given = _ROOF_LEVEL_M * roof_levels
    return float(np.clip(slope * half if given is None else given, 0.3, 1.3 * half))


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
