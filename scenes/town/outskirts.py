"""The town beyond the driven streets: plots, gardens, trees and parked vehicles from ready-made pieces.

Rows of buildings follow the same rules as those along the driven streets, `PARCEL_RULES`, but stand as copies
from a pool, which a radar cannot tell from buildings made one by one. All of a block is tested at once.
"""

from typing import NamedTuple

import numpy as np
import shapely
from numpy.typing import NDArray
from shapely.geometry import Polygon

from echoscape.scenes.geometry.curves import (
    Line,
    arc_length,
    headings,
    left_normals,
    offset,
    points_at,
    section,
)
from echoscape.scenes.roads.ground_mesh import Ground, polygons
from echoscape.scenes.roads.street_network import Network, StreetType
from echoscape.scenes.town.building_pool import BOUNDARY_M, BuildingPool, ReadyBuilding
from echoscape.scenes.town.open_spaces import CARS, PARK_TREES, lay_open_space, lay_yard
from echoscape.scenes.town.parcels import CityBlock, frontages
from echoscape.scenes.town.placement import OccupiedArea, SceneBuilder
from echoscape.scenes.town.presets import PARCEL_RULES, ParcelRule, Preset, Use
from echoscape.scenes.town.streetscape import base_extent

_SMALLEST_M2 = 500.0
_MOUTH_M = 14.0
_GARDEN_M = 11.0
_GARDEN_TREES = ("tree_broadleaf", "tree_street", "tree_conifer", "tree_shrub", "tree_shrub")
_BEHIND_KERB_M = 0.45
"""Distance of lamp posts and trunks of street trees behind the kerb [m]: people walk a metre behind it."""
_CROWN_M = 3.0
"""Distance of trees from the edge of their block [m]."""
_TREE_SPACING_M = 19.0
_CAR_SPACE_M = 6.0


class _Plot(NamedTuple):
    """A building of a row: where its front is, and what encloses its gardens."""

    ready: ReadyBuilding
    front: NDArray[np.float64]
    yaw_rad: float
    rule: ParcelRule
    kind: str


def fill_outskirts(
    builder: SceneBuilder,
    occupied: OccupiedArea,
    ground: Ground,
    network: Network,
    pool: BuildingPool,
    preset: Preset,
    *,
    seeds: np.random.SeedSequence,
) -> None:
    """Build on all land beyond the driven streets, and dress its streets.

    Args:
        builder: The scene, whose prototypes include those of the pool.
        occupied: Occupied ground, which is extended.
        ground: Plan of the ground.
        network: The streets.
        pool: Buildings to choose from.
        preset: The preset.
        seeds: Seeds of this stage.
    """
    beyond = polygons(ground.land.difference(ground.corridor).difference(ground.driven))
    blocks = sorted((block for block in beyond if block.area > _SMALLEST_M2), key=lambda b: -b.area)
    names: list[Use] = [use for use, _ in preset.uses]
    weights = np.array([weight for _, weight in preset.uses])
    shapely.prepare(ground.carriageway)
    for outline, child in zip(blocks, seeds.spawn(len(blocks)), strict=True):
        rng = np.random.default_rng(child)
        use = names[int(rng.choice(len(names), p=weights / weights.sum()))]
        if outline.interiors:  # the land behind the last streets
            use = names[0]
        block = CityBlock(outline=outline, occupied=occupied, base_m=preset.kerb_height_m, inradius_m=0.0)
        if not lay_open_space(builder, block, use, parked=preset.parked, rng=rng):
            _build_up(builder, block, use, ground, pool, rng)
    rng = np.random.default_rng(seeds.spawn(1)[0])
    for street in network.outskirts:
        length = arc_length(street.line)[-1]
        if length > 3 * _MOUTH_M:
            line = section(street.line, _MOUTH_M, length - _MOUTH_M)
            for side in (line, line[::-1]):
                _dress(builder, side, street.type, ground, preset, rng)


def _build_up(
    builder: SceneBuilder,
    block: CityBlock,
    use: Use,
    ground: Ground,
    pool: BuildingPool,
    rng: np.random.Generator,
) -> None:
    """Add rows of buildings along the streets, with gardens, and the open space behind them."""
    shapely.prepare(block.outline)
    sides = sorted(frontages(block.outline, ground.corridor), key=lambda side: -len(side))
    rule = PARCEL_RULES[use]
    plots = [plot for side in sides for plot in _row(side, use, pool, rng)]
    plots, shapes = _free_plots(plots, block)
    for plot, shape in zip(plots, shapes, strict=True):
        x, y = plot.ready.middle_m
        ahead, inward = _axes(plot.yaw_rad)
        builder.place(
            plot.ready.name, plot.front + x * ahead + y * inward, base_m=block.base_m, yaw_rad=plot.yaw_rad
        )
        block.occupied.add(shape)
    built = shapely.STRtree(shapes)
    for side in sides:
        _enclose_front(builder, side, rule, block, built, pool, rng)
    _enclose_back(builder, plots, block, built, pool, rng)
    _plant(builder, plots, block, built, 0.35 if use == "houses" else 0.12, rng)
    if block.outline.interiors:
        _scatter(builder, block, built, rng)
    if use == "works":
        lay_yard(builder, block, rng=rng, density=0.5)


def _row(side: Line, use: str, pool: BuildingPool, rng: np.random.Generator) -> list[_Plot]:
    """Draw buildings side by side along one side of a block, which lies to the left."""
    rule = PARCEL_RULES[use]
    along, heading, normal = arc_length(side), headings(side), left_normals(side)
    plots: list[_Plot] = []
    place, left_in_row = 0.0, 0
    row: list[ReadyBuilding] = []
    setback = gap = 0.0
    while True:
        if left_in_row == 0:
            left_in_row = int(rng.integers(1, rule.max_row + 1))
            row = pool.rows[use][int(rng.integers(len(pool.rows[use])))]
            setback, gap = rng.uniform(*rule.setback_m), rng.uniform(*rule.side_gap_m)
        ready = row[int(rng.integers(len(row)))]
        width = ready.width_m + 2 * gap
        ends = np.interp([place, place + width], along, heading)
        width += (setback + ready.depth_m) * max(float(ends[1] - ends[0]), 0.0)  # narrower at the back
        if place + width > along[-1]:
            return plots
        at = place + width / 2
        front = np.array([np.interp(at, along, side[:, axis] + setback * normal[:, axis]) for axis in (0, 1)])
        plots.append(_Plot(ready, front, float(np.interp(at, along, heading)), rule, use))
        left_in_row -= 1
        place += width + (rng.uniform(*rule.alley_m) if rng.random() < rule.alley_chance else 0.0)


def _axes(yaw_rad: float) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Return the unit vectors along a front and away from it."""
    ahead = np.array([np.cos(yaw_rad), np.sin(yaw_rad)])
    return ahead, np.array([-ahead[1], ahead[0]])


def _rectangles(
    front: NDArray[np.float64],
    yaw: NDArray[np.float64],
    width: NDArray[np.float64],
    depth: NDArray[np.float64],
) -> NDArray[np.object_]:
    """Return rectangles (N,) from the middles (N, 2) of their fronts, `depth` (N,) to the left of `yaw`."""
    ahead = np.stack([np.cos(yaw), np.sin(yaw)], axis=-1)
    inward = np.stack([-ahead[:, 1], ahead[:, 0]], axis=-1) * depth[:, None]
    half = ahead * width[:, None] / 2
    corners = np.stack([front - half, front + half, front + half + inward, front - half + inward], axis=1)
    return np.atleast_1d(np.asarray(shapely.polygons(corners)))


def _free_plots(plots: list[_Plot], block: CityBlock) -> tuple[list[_Plot], list[Polygon]]:
    """Return the plots whose buildings are inside the block and clear of those before them."""
    if not plots:
        return [], []
    width, depth = (
        np.array([getattr(plot.ready, name) for plot in plots]) for name in ("width_m", "depth_m")
    )
    front, yaw = np.array([plot.front for plot in plots]), np.array([plot.yaw_rad for plot in plots])
    shapes = _rectangles(front, yaw, width, depth)
    inner = _rectangles(front + 0.1 * _normal(yaw), yaw, width - 0.2, depth - 0.2)
    inside = np.flatnonzero(shapely.contains_properly(block.outline, shapes))
    first, second = shapely.STRtree(inner[inside]).query(inner[inside], predicate="intersects")
    rivals: dict[int, list[int]] = {}
    for one, other in zip(first.tolist(), second.tolist(), strict=True):
        if other < one:
            rivals.setdefault(one, []).append(other)
    kept: set[int] = set()
    for row in range(len(inside)):
        if not kept.intersection(rivals.get(row, ())):
            kept.add(row)
    rows = inside[sorted(kept)].tolist()
    return [plots[row] for row in rows], shapes[rows].tolist()


def _normal(yaw: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return the unit vectors (N, 2) to the left of headings (N,)."""
    return np.stack([-np.sin(yaw), np.cos(yaw)], axis=-1)


def _enclose_front(
    builder: SceneBuilder,
    side: Line,
    rule: ParcelRule,
    block: CityBlock,
    built: shapely.STRtree,
    pool: BuildingPool,
    rng: np.random.Generator,
) -> None:
    """Add boundaries along the back of the pavement, with gaps for paths and driveways."""
    kind = str(rng.choice(rule.front_boundaries))
    along, heading = arc_length(side), headings(side)
    at = np.arange(3.0, along[-1] - 3.0, BOUNDARY_M)
    at = at[rng.random(len(at)) < 0.7]
    if kind and len(at):
        place = points_at(offset(side, 0.45), at)
        _stand_free(
            builder,
            rng.choice(pool.boundaries[kind, "front"], len(at)),
            place,
            np.interp(at, along, heading),
            block,
            built,
        )


def _enclose_back(
    builder: SceneBuilder,
    plots: list[_Plot],
    block: CityBlock,
    built: shapely.STRtree,
    pool: BuildingPool,
    rng: np.random.Generator,
) -> None:
    """Add boundaries on two sides of some gardens behind the buildings."""
    places, yaws, names = [], [], []
    for plot in plots:
        if rng.random() >= plot.rule.back_fence_chance:
            continue
        kind = str(rng.choice(["wall"] * 6 + ["hedge"] * 2 + ["boards"]))
        ahead, inward = _axes(plot.yaw_rad)
        half, back = plot.ready.width_m / 2, plot.ready.depth_m
        corner = plot.front + half * ahead
        steps = np.arange(BOUNDARY_M / 2 + 0.3, _GARDEN_M, BOUNDARY_M)
        places += [corner + (back + step) * inward for step in steps]
        yaws += [plot.yaw_rad + np.pi / 2] * len(steps)
        across = np.arange(BOUNDARY_M / 2, 2 * half, BOUNDARY_M)
        places += [corner - step * ahead + (back + _GARDEN_M) * inward for step in across]
        yaws += [plot.yaw_rad] * len(across)
        names += [str(rng.choice(pool.boundaries[kind, "back"]))] * (len(steps) + len(across))
    if places:
        _stand_free(builder, np.array(names), np.array(places), np.array(yaws), block, built)


def _stand_free(
    builder: SceneBuilder,
    names: NDArray[np.str_],
    places: NDArray[np.float64],
    yaws: NDArray[np.float64],
    block: CityBlock,
    built: shapely.STRtree,
) -> None:
    """Place those pieces of boundaries (N,) that are inside the block and clear of its buildings."""
    count = len(places)
    strips = _rectangles(places - 0.35 * _normal(yaws), yaws, np.full(count, BOUNDARY_M), np.full(count, 0.7))
    free = shapely.contains_properly(block.outline, strips)
    free[built.query(strips, predicate="intersects")[0]] = False
    for row in np.flatnonzero(free).tolist():
        builder.place(str(names[row]), places[row], base_m=block.base_m, yaw_rad=float(yaws[row]))
        block.occupied.add(strips[row])


def _plant(
    builder: SceneBuilder,
    plots: list[_Plot],
    block: CityBlock,
    built: shapely.STRtree,
    chance: float,
    rng: np.random.Generator,
) -> None:
    """Plant trees and shrubs in gardens."""
    chosen = [plot for plot in plots if rng.random() < chance]
    if chosen:
        aside = rng.uniform(-0.4, 0.4, len(chosen))
        behind = rng.uniform(2.5, _GARDEN_M - 1.5, len(chosen))
        axes = [_axes(plot.yaw_rad) for plot in chosen]
        places = np.array(
            [
                plot.front + share * plot.ready.width_m * ahead + (plot.ready.depth_m + reach) * inward
                for plot, (ahead, inward), share, reach in zip(chosen, axes, aside, behind, strict=True)
            ]
        )
        _plant_free(builder, places, _GARDEN_TREES, block, built, rng)


def _scatter(
    builder: SceneBuilder, block: CityBlock, built: shapely.STRtree, rng: np.random.Generator
) -> None:
    """Plant trees at random on what is not built on."""
    low, high = np.array(block.outline.bounds[:2]), np.array(block.outline.bounds[2:])
    count = int(np.prod(high - low) / _TREE_SPACING_M**2)
    places = low + rng.uniform(0, 1, (count, 2)) * (high - low)
    _plant_free(builder, places, PARK_TREES, block, built, rng)


def _plant_free(
    builder: SceneBuilder,
    places: NDArray[np.float64],
    kinds: tuple[str, ...],
    block: CityBlock,
    built: shapely.STRtree,
    rng: np.random.Generator,
) -> None:
    """Plant trees at those places (N, 2) that have space for a trunk."""
    places = places[shapely.contains_xy(block.outline, places)]
    room = shapely.buffer(shapely.points(places), 1.5, quad_segs=2)
    # Low crowns must not reach over the pavement.
    free = np.ones(len(places), dtype=bool)
    free[shapely.dwithin(block.outline.boundary, shapely.points(places), _CROWN_M)] = False
    free[built.query(room, predicate="intersects")[0]] = False
    for place in places[free]:
        scale, yaw = float(rng.uniform(0.75, 1.3)), float(rng.uniform(0, 2 * np.pi))
        builder.place(str(rng.choice(kinds)), place, base_m=block.base_m, yaw_rad=yaw, scale=scale)
        block.occupied.add(shapely.Point(place).buffer(1.0, quad_segs=2))


def _dress(
    builder: SceneBuilder,
    line: Line,
    kind: StreetType,
    ground: Ground,
    preset: Preset,
    rng: np.random.Generator,
) -> None:
    """Add lamp posts, street trees and parked vehicles to the right of a line, clear of junctions."""
    along, heading = arc_length(line), headings(line)
    lamps = np.arange(rng.uniform(0.0, preset.lamps_m), along[-1], preset.lamps_m)
    trees = np.arange(rng.uniform(3.0, 9.0), along[-1], 11.0)
    trees = trees[rng.random(len(trees)) < 0.45 * preset.street_trees]
    extents = {name: base_extent(builder[name]) for name in ("lamp_arm", "tree_street")}
    behind_kerb = offset(line, -(kind.half_width_m + _BEHIND_KERB_M))
    at = np.concatenate([lamps, trees])
    places = points_at(behind_kerb, at)
    clear = ~shapely.dwithin(ground.carriageway, shapely.points(places), 0.5 * _BEHIND_KERB_M)
    for number in np.flatnonzero(clear).tolist():
        lamp = number < len(lamps)
        yaw = float(np.interp(at[number], along, heading)) + np.pi / 2
        scale = 1.0 if lamp else float(rng.uniform(1.1, 1.5))
        name = "lamp_arm" if lamp else "tree_street"
        extent = extents[name]
        x, y = scale * (extent.low_m + extent.high_m) / 2
        ahead, inward = _axes(yaw)
        foot = places[number] - x * ahead - y * inward
        builder.place(name, foot, base_m=preset.kerb_height_m, yaw_rad=yaw, scale=scale)
    if kind.parking_m > 0:
        cars = np.arange(rng.uniform(3.0, 8.0), along[-1] - 3.0, _CAR_SPACE_M)
        cars = cars[rng.random(len(cars)) < preset.parked * rng.uniform(0.4, 1.3)]
        places = points_at(offset(line, -(kind.lane_edge_m + 1.35)), cars)
        for place, distance in zip(places, cars, strict=True):
            yaw = float(np.interp(distance, along, heading)) + np.pi * (rng.random() < 0.15)
            builder.place(str(rng.choice(CARS)), place, base_m=0.0, yaw_rad=yaw)
