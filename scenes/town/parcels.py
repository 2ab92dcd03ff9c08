"""Lots along a frontage: buildings side by side behind the pavement, their gardens, and what bounds these.

A frontage is a line with its block to the left; lots are four-sided, and neighbours share their party walls.
"""

from dataclasses import dataclass

import numpy as np
import shapely
from numpy.typing import NDArray
from shapely.geometry import LineString, Point, Polygon
from shapely.geometry.base import BaseGeometry

from echoscape.scenes.assets.buildings.building import Style, building
from echoscape.scenes.assets.vegetation import hedge
from echoscape.scenes.assets.walls_fences import fence, wall
from echoscape.scenes.geometry.curves import Line, arc_length, left_normals, points_at, resampled
from echoscape.scenes.town.placement import Assembly, Taken, rectangle
from echoscape.scenes.town.streetscape import foot_of

_TRUNK_ROOM_M = 1.0


@dataclass(frozen=True, kw_only=True)
class ParcelRule:
    """How a kind of building stands along a street; ranges are drawn from evenly, a row or a lot at a time.

    `side_m` is left free beside each building, `gap` the chance of an alley after one; `front` names what
    bounds the front garden ("" for none) and `back` the chance that gardens behind are fenced.
    """

    style: Style
    width_m: tuple[float, float]
    depth_m: tuple[float, float]
    height_m: tuple[float, float]
    setback_m: tuple[float, float]
    side_m: tuple[float, float] = (0.0, 0.0)
    gap: float = 0.0
    gap_m: tuple[float, float] = (1.5, 4.0)
    row: int = 1
    front: tuple[str, ...] = ("",)
    back: float = 0.0
    drive: float = 0.0


RULES: dict[str, ParcelRule] = {
    "terrace": ParcelRule(
        style="terrace",
        width_m=(9.0, 15.0),
        depth_m=(8.5, 11.0),
        height_m=(5.4, 9.0),
        setback_m=(0.8, 3.2),
        gap=0.07,
        row=7,
        front=("wall", "wall", "wall", "railing", "hedge", "", ""),
        back=0.25,
    ),
    "shops": ParcelRule(
        style="terrace",
        width_m=(8.0, 14.0),
        depth_m=(11.0, 14.0),
        height_m=(8.5, 12.0),
        setback_m=(0.8, 1.2),
        gap=0.05,
        row=4,
    ),
    "houses": ParcelRule(
        style="house",
        width_m=(13.0, 20.0),
        depth_m=(8.0, 10.0),
        height_m=(4.8, 6.0),
        setback_m=(4.5, 7.0),
        side_m=(1.5, 3.8),
        gap=0.3,
        row=3,
        front=("hedge", "hedge", "wall", "boards", ""),
        back=0.35,
        drive=0.35,
    ),
    "flats": ParcelRule(
        style="block",
        width_m=(24.0, 44.0),
        depth_m=(12.0, 15.0),
        height_m=(9.0, 18.0),
        setback_m=(2.5, 4.5),
        side_m=(2.0, 5.0),
        row=2,
        front=("hedge", "railing", ""),
    ),
    "works": ParcelRule(
        style="hall",
        width_m=(38.0, 75.0),
        depth_m=(24.0, 42.0),
        height_m=(6.0, 11.0),
        setback_m=(6.0, 14.0),
        side_m=(3.0, 9.0),
        row=1,
        front=("chain_link", "chain_link", "wall", ""),
    ),
}


@dataclass(frozen=True, kw_only=True)
class Parcel:
    """Where lots are laid out: the block that must hold them, what is taken, and the ground's height."""

    block: Polygon
    taken: Taken
    base_m: float
    reach_m: float


def frontages(block: Polygon, streets: BaseGeometry) -> list[Line]:
    """Return the block's sides that lie along `streets`, block to the left, split at corners."""
    turned = shapely.orient_polygons(block)
    sides = []
    for ring in (turned.exterior, *turned.interiors):
        rim = resampled(np.asarray(ring.coords)[:, :2], 2.0)
        step = np.diff(rim, axis=0)
        heading = np.unwrap(np.arctan2(step[:, 1], step[:, 0]))
        turn = np.abs(np.roll(heading, -3) - np.roll(heading, 3))[:-3]
        corner = np.flatnonzero(turn % (2 * np.pi) > 0.5)
        near = np.asarray(shapely.distance(shapely.points(rim), streets)) < 0.6
        near[corner] = False
        edges = np.flatnonzero(np.diff(np.concatenate([[False], near, [False]]).astype(int)))
        sides += [rim[a:b] for a, b in zip(edges[::2], edges[1::2], strict=True) if b - a > 5]
    return sides


def build_along(
    assembly: Assembly, side: Line, rule: ParcelRule, plot: Parcel, *, rng: np.random.Generator
) -> list[Polygon]:
    """Put buildings along one side of a block and return the gardens behind them."""
    length = arc_length(side)[-1]
    place, left_in_row, gardens = 0.0, 0, []
    setback = depth = height = 0.0
    while place < length - 0.7 * rule.width_m[0]:
        if left_in_row == 0:
            left_in_row = int(rng.integers(1, rule.row + 1))
            setback, depth, height = (rng.uniform(*r) for r in (rule.setback_m, rule.depth_m, rule.height_m))
        width = min(rng.uniform(*rule.width_m), length - place)
        lot = _lot(side, place, width, setback, depth, rng.uniform(*rule.side_m))
        if _fits(lot, plot):
            _build(assembly, lot, height, rule, plot, rng)
            gardens += _garden(lot, side, place, width, plot)
            place += width
            left_in_row -= 1
            if rng.random() < rule.gap:
                place += rng.uniform(*rule.gap_m)
        else:
            place += 2.5
    return gardens


def _lot(
    side: Line, place: float, width: float, setback: float, depth: float, aside: float
) -> NDArray[np.float64]:
    """Return the (4, 2) footprint counter-clockwise, its front first."""
    ends = np.array([place + aside, place + width - aside])
    normals = left_normals(side)
    along = arc_length(side)
    front = points_at(side, ends)
    normal = np.stack([np.interp(ends, along, normals[:, axis]) for axis in range(2)], axis=-1)
    normal /= np.linalg.norm(normal, axis=1, keepdims=True)
    return np.concatenate([front + setback * normal, (front + (setback + depth) * normal)[::-1]])


def _fits(lot: NDArray[np.float64], plot: Parcel) -> bool:
    """Tell whether a footprint is a sound shape inside its block and on free ground."""
    step = np.roll(lot, -1, axis=0) - lot
    after = np.roll(step, -1, axis=0)
    turn = step[:, 0] * after[:, 1] - step[:, 1] * after[:, 0]
    sharp = turn < 0.5 * np.linalg.norm(step, axis=1) * np.linalg.norm(after, axis=1)
    if sharp.any() or np.linalg.norm(step, axis=1).min() < 3.0:
        return False
    shape = Polygon(lot)
    return plot.block.contains(shape) and plot.taken.is_free(shape.buffer(-0.1))


def _build(
    assembly: Assembly,
    lot: NDArray[np.float64],
    height: float,
    rule: ParcelRule,
    plot: Parcel,
    rng: np.random.Generator,
) -> None:
    detached = rule.side_m[1] > 0
    high = height if not detached else height + float(rng.uniform(-0.4, 0.4))
    facades = None if detached else [True, False, False, False]  # backs of rows cannot be seen from roads
    made = building(lot, height_m=high, style=rule.style, rng=rng, facades=facades)
    assembly.add("building", made)
    plot.taken.add(Polygon(lot))


def _garden(lot: NDArray[np.float64], side: Line, place: float, width: float, plot: Parcel) -> list[Polygon]:
    """Return the ground behind a building that nobody else has taken."""
    back = plot.reach_m - float(np.linalg.norm(lot[3] - lot[0])) - 2.0
    if back < 3.5:
        return []
    ends = points_at(side, np.array([place, place + width]))
    inward = lot[3] - lot[0] + lot[2] - lot[1]
    inward = inward / np.linalg.norm(inward)
    start = [
        end + inward * float((corner - end) @ inward) for end, corner in zip(ends, lot[3:1:-1], strict=True)
    ]
    quad = Polygon(
        [start[0], start[1], start[1] + inward * min(back, 18.0), start[0] + inward * min(back, 18.0)]
    )
    if not quad.is_valid:
        return []
    rest = shapely.difference(quad.intersection(plot.block), shapely.union_all(plot.taken.near(quad)))
    pieces = [p for p in shapely.get_parts(rest) if isinstance(p, Polygon) and p.area > 25.0]
    return [max(pieces, key=lambda p: p.area)] if pieces else []


def bound_gardens(
    assembly: Assembly, gardens: list[Polygon], rule: ParcelRule, plot: Parcel, *, rng: np.random.Generator
) -> None:
    """Fence gardens off from each other; what is fenced already, or is built on, is left out."""
    done: BaseGeometry = Polygon()
    for garden in gardens:
        if rng.random() >= rule.back:
            continue
        blocked = shapely.union_all([other.buffer(0.35) for other in plot.taken.near(garden.buffer(1.0))])
        lines = garden.exterior.simplify(0.3).difference(blocked).difference(done.buffer(0.6))
        kind = str(rng.choice(["wall"] * 6 + ["hedge"] * 2 + ["boards"]))
        for line in _runs(lines):
            put_boundary(assembly, line, kind, plot, rng=rng, height_m=float(rng.uniform(1.5, 1.9)))
        done = shapely.union_all([done, garden])


def _runs(shape: BaseGeometry) -> list[LineString]:
    merged = shapely.line_merge(shape) if shape.geom_type == "MultiLineString" else shape
    return [part for part in shapely.get_parts(merged) if isinstance(part, LineString) and part.length > 2.0]


def put_boundary(
    assembly: Assembly,
    line: LineString,
    kind: str,
    plot: Parcel,
    *,
    rng: np.random.Generator,
    height_m: float,
) -> None:
    """Put a wall, hedge or fence on a line, if the ground is free."""
    points = np.asarray(line.coords)[:, :2]
    strip = line.buffer(0.5 if kind == "hedge" else 0.22, cap_style="flat")
    if not plot.taken.is_free(strip) and kind == "hedge":
        kind, strip = "wall", line.buffer(0.2, cap_style="flat")
    if kind == "hedge":
        mesh = hedge(points, height_m=height_m, thickness_m=0.65, rng=rng, step_m=1.0)
        assembly.add("hedge", {"foliage": mesh}, base_m=plot.base_m)
    elif kind == "wall":
        material = str(rng.choice(["brick", "brick", "concrete"]))
        mesh = wall(points, height_m=height_m, thickness_m=0.22)
        assembly.add("wall", {material: mesh}, base_m=plot.base_m)
    elif kind in ("boards", "railing", "chain_link"):
        assembly.add("fence", fence(points, height_m=height_m, kind=kind), base_m=plot.base_m)
    plot.taken.add(strip)


def bound_front(
    assembly: Assembly, side: Line, rule: ParcelRule, plot: Parcel, *, rng: np.random.Generator
) -> None:
    """Put low boundaries at the back of the pavement, with gaps for paths and drives."""
    kind = str(rng.choice(rule.front))
    height = float(rng.uniform(1.8, 2.4)) if kind == "chain_link" else float(rng.uniform(0.7, 1.3))
    normal, along = left_normals(side), arc_length(side)
    inner = side + 0.45 * normal
    place = rng.uniform(0.5, 4.0)
    while kind and place < along[-1] - 3.0:
        run = float(rng.uniform(0.45, 0.95) * rule.width_m[1])
        stop = min(place + run, along[-1] - 0.5)
        line = LineString(points_at(inner, np.linspace(place, stop, max(int(run / 4.0), 1) + 1)))
        strip = line.buffer(0.35, cap_style="flat")
        if line.length > 1.5 and plot.block.contains(strip) and plot.taken.is_free(strip):
            put_boundary(assembly, line, kind, plot, rng=rng, height_m=height)
        place = stop + rng.uniform(1.2, 3.4)


def plant(
    assembly: Assembly, garden: Polygon, plot: Parcel, *, chance: float, rng: np.random.Generator
) -> None:
    """Plant a tree or shrub in a garden, where its trunk and what of its crown is low find free ground."""
    if rng.random() >= chance:
        return
    low, high = np.array(garden.bounds[:2]), np.array(garden.bounds[2:])
    middle = Point(place := low + rng.uniform(0.2, 0.8, 2) * (high - low))
    if garden.contains(middle) and plot.taken.is_free(middle.buffer(_TRUNK_ROOM_M)):
        name = str(rng.choice(["tree_broadleaf", "tree_street", "tree_conifer", "tree_shrub", "tree_shrub"]))
        yaw, scale = rng.uniform(0, 6.28), rng.uniform(0.7, 1.2)
        reach = scale * float(np.abs(foot_of(assembly[name])).max())
        if plot.taken.claim(middle.buffer(max(_TRUNK_ROOM_M, reach))):
            assembly.place(name, place, base_m=plot.base_m, yaw_rad=yaw, scale=scale)


def put_vehicle(
    assembly: Assembly,
    name: str,
    place: NDArray[np.float64],
    plot: Parcel,
    *,
    yaw_rad: float,
    base_m: float | None = None,
) -> bool:
    """Park a vehicle where the ground is free and tell whether it was."""
    length, width, _ = assembly[name].extent_m
    free = plot.taken.claim(rectangle(place, yaw_rad, length + 0.3, width + 0.1))
    if free:
        height = plot.base_m if base_m is None else base_m
        assembly.place(name, place, base_m=height, yaw_rad=yaw_rad)
    return free
