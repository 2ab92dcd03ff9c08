"""Gardens and their boundaries: hedges, walls and fences, trees, and vehicles parked off the street."""

import numpy as np
import shapely
from numpy.typing import NDArray
from shapely.geometry import LineString, Point, Polygon
from shapely.geometry.base import BaseGeometry

from echoscape.scenes.assets.vegetation import hedge
from echoscape.scenes.assets.walls_fences import fence, wall
from echoscape.scenes.geometry.curves import Line, arc_length, left_normals, points_at
from echoscape.scenes.town.parcels import CityBlock
from echoscape.scenes.town.placement import SceneBuilder, rectangle
from echoscape.scenes.town.presets import ParcelRule
from echoscape.scenes.town.streetscape import base_extent

_TRUNK_ROOM_M = 1.0


def enclose_gardens(
    builder: SceneBuilder,
    gardens: list[Polygon],
    rule: ParcelRule,
    block: CityBlock,
    *,
    rng: np.random.Generator,
) -> None:
    """Add boundaries between gardens; edges that have a boundary or a building are left out.

    Args:
        builder: The scene.
        gardens: The gardens.
        rule: How the buildings of these gardens are laid out.
        block: The city block.
        rng: Random generator.
    """
    done: BaseGeometry = Polygon()
    for garden in gardens:
        if rng.random() >= rule.back_fence_chance:
            continue
        near = block.occupied.near(garden.buffer(1.0))
        blocked = shapely.union_all([*shapely.buffer(near, 0.35, quad_segs=2), done])
        lines = garden.exterior.simplify(0.3).difference(blocked)
        kind = str(rng.choice(["wall"] * 6 + ["hedge"] * 2 + ["boards"]))
        for line in _runs(lines):
            add_boundary(builder, line, kind, block, rng=rng, height_m=float(rng.uniform(1.5, 1.9)))
        done = done.union(garden.buffer(0.6, quad_segs=2))


def _runs(shape: BaseGeometry) -> list[LineString]:
    """Return the lines of a shape that are longer than 2 m, joined where they meet."""
    merged = shapely.line_merge(shape) if shape.geom_type == "MultiLineString" else shape
    return [part for part in shapely.get_parts(merged) if isinstance(part, LineString) and part.length > 2.0]


def add_boundary(
    builder: SceneBuilder,
    line: LineString,
    kind: str,
    block: CityBlock,
    *,
    rng: np.random.Generator,
    height_m: float,
) -> None:
    """Add a wall, hedge or fence along a line.

    A hedge becomes a wall where there is no free space for it.

    Args:
        builder: The scene.
        line: The line [m].
        kind: "wall", "hedge", "boards", "railing" or "chain_link".
        block: The city block.
        rng: Random generator.
        height_m: Height [m].
    """
    points = np.asarray(line.coords)[:, :2]
    strip = line.buffer(0.5 if kind == "hedge" else 0.22, cap_style="flat")
    if not block.occupied.is_free(strip) and kind == "hedge":
        kind, strip = "wall", line.buffer(0.2, cap_style="flat")
    if kind == "hedge":
        mesh = hedge(points, height_m=height_m, thickness_m=0.65, rng=rng, step_m=1.0)
        builder.add("hedge", {"foliage": mesh}, base_m=block.base_m)
    elif kind == "wall":
        material = str(rng.choice(["brick", "brick", "concrete"]))
        mesh = wall(points, height_m=height_m, thickness_m=0.22)
        builder.add("wall", {material: mesh}, base_m=block.base_m)
    elif kind in ("boards", "railing", "chain_link"):
        builder.add("fence", fence(points, height_m=height_m, kind=kind), base_m=block.base_m)
    block.occupied.add(strip)


def enclose_front(
    builder: SceneBuilder, side: Line, rule: ParcelRule, block: CityBlock, *, rng: np.random.Generator
) -> None:
    """Add low boundaries along the back of the pavement, with gaps for paths and driveways.

    Args:
        builder: The scene.
        side: Side of the block along the street (P, 2) [m], block to the left.
        rule: How the buildings of this side are laid out.
        block: The city block.
        rng: Random generator.
    """
    kind = str(rng.choice(rule.front_boundaries))
    height = float(rng.uniform(1.8, 2.4)) if kind == "chain_link" else float(rng.uniform(0.7, 1.3))
    normal, along = left_normals(side), arc_length(side)
    inner = side + 0.45 * normal
    place = rng.uniform(0.5, 4.0)
    while kind and place < along[-1] - 3.0:
        run = float(rng.uniform(0.45, 0.95) * rule.width_m[1])
        stop = min(place + run, along[-1] - 0.5)
        line = LineString(points_at(inner, np.linspace(place, stop, max(int(run / 4.0), 1) + 1)))
        strip = line.buffer(0.35, cap_style="flat")
        if line.length > 1.5 and block.outline.contains(strip) and block.occupied.is_free(strip):
            add_boundary(builder, line, kind, block, rng=rng, height_m=height)
        place = stop + rng.uniform(1.2, 3.4)


def plant_garden(
    builder: SceneBuilder, garden: Polygon, block: CityBlock, *, chance: float, rng: np.random.Generator
) -> None:
    """Plant a tree or shrub in a garden if its trunk, and its crown below head height, have free space.

    Args:
        builder: The scene.
        garden: The garden.
        block: The city block.
        chance: Probability that something is planted.
        rng: Random generator.
    """
    if rng.random() >= chance:
        return
    low, high = np.array(garden.bounds[:2]), np.array(garden.bounds[2:])
    middle = Point(place := low + rng.uniform(0.2, 0.8, 2) * (high - low))
    if garden.contains(middle) and block.occupied.is_free(middle.buffer(_TRUNK_ROOM_M)):
        name = str(rng.choice(["tree_broadleaf", "tree_street", "tree_conifer", "tree_shrub", "tree_shrub"]))
        yaw, scale = rng.uniform(0, 6.28), rng.uniform(0.7, 1.2)
        reach = scale * float(np.abs(base_extent(builder[name])).max())
        if block.occupied.claim(middle.buffer(max(_TRUNK_ROOM_M, reach))):
            builder.place(name, place, base_m=block.base_m, yaw_rad=yaw, scale=scale)


def park_vehicle(
    builder: SceneBuilder,
    name: str,
    place: NDArray[np.float64],
    block: CityBlock,
    *,
    yaw_rad: float,
    base_m: float | None = None,
) -> bool:
    """Park a vehicle where the ground is free.

    Args:
        builder: The scene.
        name: Name of its prototype.
        place: Position (2,) [m].
        block: The city block.
        yaw_rad: Heading [rad].
        base_m: Height of the ground [m]; None for that of the block.

    Returns:
        Whether the ground was free.
    """
    length, width, _ = builder[name].extent_m
    free = block.occupied.claim(rectangle(place, yaw_rad, length + 0.3, width + 0.1))
    if free:
        height = block.base_m if base_m is None else base_m
        builder.place(name, place, base_m=height, yaw_rad=yaw_rad)
    return free
