"""Land use: each block between streets gets a use, buildings along its sides, and open spaces inside.

One block near the centre is a square and one a park; sides along avenues are shops.
"""

import numpy as np
import shapely
from shapely.geometry import Polygon
from shapely.geometry.base import BaseGeometry

from echoscape.scenes.geometry.curves import Line, points_at
from echoscape.scenes.roads.ground_mesh import Ground, polygons
from echoscape.scenes.roads.street_network import Network
from echoscape.scenes.town.building_pool import BuildingPool
from echoscape.scenes.town.gardens import enclose_front, enclose_gardens, plant_garden
from echoscape.scenes.town.open_spaces import lay_car_park, lay_open_space, lay_yard
from echoscape.scenes.town.parcels import CityBlock, build_along, frontages
from echoscape.scenes.town.placement import OccupiedArea, SceneBuilder
from echoscape.scenes.town.presets import PARCEL_RULES, Preset, Use

_SMALLEST_M2 = 500.0


def fill_blocks(
    builder: SceneBuilder,
    occupied: OccupiedArea,
    ground: Ground,
    network: Network,
    pool: BuildingPool,
    preset: Preset,
    *,
    seeds: np.random.SeedSequence,
) -> dict[int, Use]:
    """Build on every block between the driven streets.

    Args:
        builder: The scene.
        occupied: Occupied ground, which is extended.
        ground: Plan of the ground.
        network: The streets.
        pool: Designs of buildings.
        preset: The preset.
        seeds: Seeds of this stage.

    Returns:
        Use of each block that is large enough, by its index among these blocks in `blocks_of`.
    """
    shapely.prepare(ground.driven)
    blocks = [block for block in blocks_of(ground) if ground.driven.contains(block.representative_point())]
    uses = _uses(blocks, network, preset, np.random.default_rng(seeds.spawn(1)[0]))
    avenues = shapely.union_all(
        [
            shapely.LineString(street.line).buffer(street.type.half_width_m + street.type.pavement_m + 3)
            for street in network.streets
            if street.type.lanes > 1
        ]
    )
    for number, child in enumerate(seeds.spawn(len(blocks))):
        rng = np.random.default_rng(child)
        if number in uses:
            reach = shapely.maximum_inscribed_circle(blocks[number]).length
            block = CityBlock(
                outline=blocks[number], occupied=occupied, base_m=preset.kerb_height_m, inradius_m=reach
            )
            if not lay_open_space(builder, block, uses[number], parked=preset.parked, rng=rng):
                _build_up(builder, block, uses[number], ground, avenues, pool, rng)
    return uses


def blocks_of(ground: Ground) -> list[Polygon]:
    """Return the land between the streets.

    Args:
        ground: Plan of the ground.

    Returns:
        Blocks in descending order of area.
    """
    rest = polygons(ground.land.difference(ground.corridor))
    return sorted(rest, key=lambda block: -block.area)


def _uses(
    blocks: list[Polygon], network: Network, preset: Preset, rng: np.random.Generator
) -> dict[int, Use]:
    """Choose a use for each block that is large enough."""
    middle = shapely.Point(network.junctions.mean(axis=0))
    names: list[Use] = [use for use, _ in preset.uses]
    weights = np.array([weight for _, weight in preset.uses])
    uses: dict[int, Use] = {}
    for number, block in enumerate(blocks):
        drawn: Use = names[int(rng.choice(len(names), p=weights / weights.sum()))]
        if block.area > _SMALLEST_M2:
            uses[number] = drawn

    def nearest(low_m2: float, high_m2: float) -> list[int]:
        fit = [n for n, b in enumerate(blocks) if low_m2 < b.area < high_m2 and not b.interiors]
        return sorted(fit, key=lambda n: blocks[n].centroid.distance(middle))[:1]

    centre: tuple[tuple[Use, float, float], ...] = (("square", 1500.0, 6000.0), ("park", 9000.0, 60000.0))
    for use, low, high in centre:
        for number in nearest(low, high):
            uses[number] = use
    return uses


def _build_up(
    builder: SceneBuilder,
    block: CityBlock,
    use: Use,
    ground: Ground,
    avenues: BaseGeometry,
    pool: BuildingPool,
    rng: np.random.Generator,
) -> None:
    """Add buildings along the sides of a block, their gardens, and the open space inside."""
    sides = sorted(frontages(block.outline, ground.corridor), key=lambda side: -len(side))
    kinds = [_side_use(side, use, avenues) for side in sides]
    gardens: list[tuple[Polygon, str]] = []
    for side, kind in zip(sides, kinds, strict=True):
        behind = build_along(builder, side, PARCEL_RULES[kind], pool.designs[kind], block, rng=rng)
        gardens += [(garden, kind) for garden in behind]
    for side, kind in zip(sides, kinds, strict=True):
        enclose_front(builder, side, PARCEL_RULES[kind], block, rng=rng)
    for kind in dict.fromkeys(kinds):
        of_kind = [garden for garden, other in gardens if other == kind]
        enclose_gardens(builder, of_kind, PARCEL_RULES[kind], block, rng=rng)
    if use == "flats":
        lay_car_park(builder, block, filled_share=0.15, rng=rng, inset_m=24.0)
    if use == "works":
        lay_yard(builder, block, rng=rng, density=0.5)
    for garden, kind in gardens:
        plant_garden(builder, garden, block, chance=0.35 if kind == "houses" else 0.12, rng=rng)


def _side_use(side: Line, use: Use, avenues: BaseGeometry) -> str:
    """Return the use of one side: shops where it faces an avenue."""
    middle = points_at(side, np.array([0.5 * np.hypot(*np.diff(side, axis=0).T).sum()]))[0]
    on_avenue = not avenues.is_empty and avenues.contains(shapely.Point(middle))
    return "shops" if on_avenue and use in ("terrace", "flats") else use
