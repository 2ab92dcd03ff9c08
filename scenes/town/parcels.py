"""Parcels along the sides of a block: buildings side by side behind the pavement, and their gardens.

The side of a block is a line with the block to its left. Footprints are quadrilaterals; neighbours in a row
share party walls.
"""

from dataclasses import dataclass

import numpy as np
import shapely
from numpy.typing import NDArray
from shapely.geometry import Polygon
from shapely.geometry.base import BaseGeometry

from echoscape.scenes.core.headings import unwrapped_headings
from echoscape.scenes.geometry.curves import Line, arc_length, left_normals, points_at, resampled
from echoscape.scenes.town.building_pool import Designs
from echoscape.scenes.town.placement import OccupiedArea, SceneBuilder
from echoscape.scenes.town.presets import ParcelRule

_NEXT = np.array([1, 2, 3, 0])


@dataclass(frozen=True, kw_only=True)
class CityBlock:
    """A block that is built on.

    Attributes:
        outline: Its polygon [m].
        occupied: Occupied ground.
        base_m: Height of the ground [m].
        inradius_m: Radius of the largest circle inside [m].
    """

    outline: Polygon
    occupied: OccupiedArea
    base_m: float
    inradius_m: float


def frontages(block: Polygon, streets: BaseGeometry) -> list[Line]:
    """Return the sides of a block that lie along streets, split at corners.

    Args:
        block: Polygon of the block [m].
        streets: Ground of the streets.

    Returns:
        Lines (P, 2) [m] with the block to their left.
    """
    shapely.prepare(streets)
    turned = shapely.orient_polygons(block)
    sides = []
    for ring in (turned.exterior, *turned.interiors):
        rim = resampled(np.asarray(ring.coords)[:, :2], 2.0)
        step = np.diff(rim, axis=0)
        heading = unwrapped_headings(step)
        turn = np.abs(np.roll(heading, -3) - np.roll(heading, 3))[:-3]
        corner = np.flatnonzero(turn % (2 * np.pi) > 0.5)
        near = np.asarray(shapely.dwithin(streets, shapely.points(rim), 0.6))
        near[corner] = False
        edges = np.flatnonzero(np.diff(np.concatenate([[False], near, [False]]).astype(int)))
        sides += [rim[a:b] for a, b in zip(edges[::2], edges[1::2], strict=True) if b - a > 5]
    return sides


def build_along(
    builder: SceneBuilder,
    side: Line,
    rule: ParcelRule,
    designs: Designs,
    block: CityBlock,
    *,
    rng: np.random.Generator,
) -> list[Polygon]:
    """Add buildings along one side of a block.

    Args:
        builder: The scene.
        side: The side (P, 2) [m].
        rule: How its buildings are laid out.
        designs: Designs of its buildings.
        block: The city block.
        rng: Random generator.

    Returns:
        The gardens behind the buildings.
    """
    along, normals = arc_length(side), left_normals(side)
    length = along[-1]
    shapely.prepare(block.outline)
    place, left_in_row, gardens = 0.0, 0, []
    setback = depth = height = 0.0
    while place < length - 0.7 * rule.width_m[0]:
        if left_in_row == 0:
            left_in_row = int(rng.integers(1, rule.max_row + 1))
            setback, depth, height = (rng.uniform(*r) for r in (rule.setback_m, rule.depth_m, rule.height_m))
        width = min(rng.uniform(*rule.width_m), length - place)
        gap = rng.uniform(*rule.side_gap_m)
        ends = np.array([place + gap, place + width - gap])
        front, normal = (
            np.stack([np.interp(ends, along, line[:, axis]) for axis in (0, 1)], axis=-1)
            for line in (side, normals)
        )
        footprint = _footprint(front, normal, setback, depth)
        if _fits(footprint, block):
            _build(builder, footprint, height, rule, designs, block, rng)
            gardens += _garden(footprint, side, place, width, block)
            place += width
            left_in_row -= 1
            if rng.random() < rule.alley_chance:
                place += rng.uniform(*rule.alley_m)
        else:
            place += 2.5
    return gardens


def _footprint(
    front: NDArray[np.float64], normal: NDArray[np.float64], setback: float, depth: float
) -> NDArray[np.float64]:
    """Return the footprint (4, 2), counter-clockwise, front edge first, behind two points of the pavement."""
    normal = normal / np.sqrt((normal**2).sum(axis=1, keepdims=True))
    return np.concatenate([front + setback * normal, (front + (setback + depth) * normal)[::-1]])


def _fits(footprint: NDArray[np.float64], block: CityBlock) -> bool:
    """Return whether a footprint has a sound shape and lies inside its block on free ground."""
    step = footprint[_NEXT] - footprint
    length = np.hypot(step[:, 0], step[:, 1])
    turn = step[:, 0] * step[_NEXT, 1] - step[:, 1] * step[_NEXT, 0]
    if (turn < 0.5 * length * length[_NEXT]).any() or length.min() < 3.0:
        return False
    shape = Polygon(footprint)
    return block.outline.contains(shape) and block.occupied.is_free(shape.buffer(-0.1))


def _build(
    builder: SceneBuilder,
    footprint: NDArray[np.float64],
    height: float,
    rule: ParcelRule,
    designs: Designs,
    block: CityBlock,
    rng: np.random.Generator,
) -> None:
    """Add a building on a footprint."""
    detached = rule.side_gap_m[1] > 0
    high = height if not detached else height + float(rng.uniform(-0.4, 0.4))
    builder.add("building", designs.fitted(footprint, height_m=high, rng=rng))
    block.occupied.add(Polygon(footprint))


def _garden(
    footprint: NDArray[np.float64], side: Line, place: float, width: float, block: CityBlock
) -> list[Polygon]:
    """Return the free ground behind a building."""
    back = block.inradius_m - float(np.linalg.norm(footprint[3] - footprint[0])) - 2.0
    if back < 3.5:
        return []
    ends = points_at(side, np.array([place, place + width]))
    inward = footprint[3] - footprint[0] + footprint[2] - footprint[1]
    inward = inward / np.linalg.norm(inward)
    start = [
        end + inward * float((corner - end) @ inward)
        for end, corner in zip(ends, footprint[3:1:-1], strict=True)
    ]
    quad = Polygon(
        [start[0], start[1], start[1] + inward * min(back, 18.0), start[0] + inward * min(back, 18.0)]
    )
    if not quad.is_valid:
        return []
    near = np.array(block.occupied.near(quad), dtype=object)
    taken = shapely.union_all(near[shapely.intersects(quad, near)])
    rest = shapely.difference(quad.intersection(block.outline), taken)
    pieces = [p for p in shapely.get_parts(rest) if isinstance(p, Polygon) and p.area > 25.0]
    return [max(pieces, key=lambda p: p.area)] if pieces else []
