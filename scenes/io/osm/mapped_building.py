"""What a map says of its buildings: heights by height or building:levels, roofs, styles by kind and size.

What it does not say is drawn for each building from its id (wiki.openstreetmap.org/wiki/Key:building,
wiki.openstreetmap.org/wiki/Simple_3D_Buildings for heights and roofs).
"""

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
import shapely
from shapely.geometry import Polygon

from echoscape.scenes.assets.buildings import roof
from echoscape.scenes.assets.buildings.building import Style
from echoscape.scenes.io.osm.elements.footprints import Shape
from echoscape.scenes.io.osm.elements.map_data import Tags
from echoscape.scenes.io.osm.elements.tag_values import count, length_m

STOREY_M = 3.0
"""Height of a level [m], as building:levels is usually converted (Simple 3D Buildings)."""
_ROOF_LEVEL_M = 2.5
_LOWEST_M, _HIGHEST_M = 2.2, 300.0
_SMALLEST_M2 = 3.0
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
