"""What a map does not say of the land around its buildings, drawn by seed: fences, trees and shrubs.

Each house has the part of its block that is nearer to it than to others, up to a few metres from its walls.
"""

from collections.abc import Callable

import numpy as np
import shapely
from shapely.geometry import Polygon
from shapely.geometry.base import BaseGeometry

from echoscape.scenes.io.osm.mapped_building import MappedBuilding
from echoscape.scenes.roads.ground_mesh import polygons
from echoscape.scenes.town.gardens import enclose_gardens, plant_garden
from echoscape.scenes.town.parcels import CityBlock
from echoscape.scenes.town.placement import SceneBuilder
from echoscape.scenes.town.presets import PARCEL_RULES

_REACH_M = 13.0
_SMALLEST_M2, _LARGEST_M2 = 25.0, 900.0
_PLANTS = 3
_CHANCE = {"house": 0.6, "terrace": 0.35, "block": 0.4}
_RULES = {"house": "houses", "terrace": "terrace", "block": "flats"}


def lay_gardens(
    builder: SceneBuilder,
    buildings: list[MappedBuilding],
    free: BaseGeometry,
    block: CityBlock,
    *,
    rng_of: Callable[[tuple[int, int, int]], np.random.Generator],
) -> None:
    """Add fences, trees and shrubs around houses and blocks of flats.

    Args:
        builder: The scene.
        buildings: The buildings.
        free: Land of no other use.
        block: Occupied ground and height of the ground.
        rng_of: Returns the random generator of an element.
    """
    homes = [each for each in buildings if each.style in _RULES]
    for home, garden in zip(homes, _gardens([each.shape.polygon for each in homes], free), strict=True):
        rng = rng_of((home.shape.kind, home.shape.id, home.shape.part))
        if garden is None:
            continue
        enclose_gardens(builder, [garden], PARCEL_RULES[_RULES[home.style]], block, rng=rng)
        for _ in range(_PLANTS):
            plant_garden(builder, garden, block, chance=_CHANCE[home.style], rng=rng)


def _gardens(homes: list[Polygon], free: BaseGeometry) -> list[Polygon | None]:
    """Return the garden of each home, None where it has no space for one."""
    if not homes:
        return []
    points = shapely.points([each.representative_point().coords[0] for each in homes])
    cells = list(
        shapely.get_parts(shapely.voronoi_polygons(shapely.multipoints(points), extend_to=free.envelope))
    )
    cell_of = shapely.STRtree(cells).query(points, predicate="intersects")[1]
    shapely.prepare(free)
    made: list[Polygon | None] = []
    for home, cell in zip(homes, cell_of.tolist(), strict=True):
        reach = home.buffer(_REACH_M, join_style="mitre").intersection(cells[cell])
        parts = [part for part in polygons(reach.intersection(free)) if part.area > _SMALLEST_M2]
        largest = max(parts, key=lambda part: part.area, default=None)
        made.append(largest if largest is not None and largest.area < _LARGEST_M2 else None)
    return made
