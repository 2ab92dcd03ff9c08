"""Facades as quads: pierced walls, reveals, panes, sills, balconies, ribs, pipes, all tiled over whole walls.

A facade has its own axes (s, z, d): along the wall to the right as seen from outside, up, and outwards; they
are right-handed. A quad is (4, 3), counter-clockwise from its outer side; lists of quads are (N, 4, 3) [m].
"""

from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import ArrayLike, NDArray

Quads = NDArray[np.float64]


@dataclass(frozen=True, kw_only=True)
class Frame:
    """Where a facade stands: `origin` (2,) its left foot, `along` (2,) a unit vector, its length."""

    origin: NDArray[np.float64]
    along: NDArray[np.float64]
    length_m: float

    @cached_property
    def _basis(self) -> NDArray[np.float64]:
        (x, y), up = self.along, (0.0, 0.0, 1.0)
        return np.array([[x, y, 0.0], up, [y, -x, 0.0]])

    def to_world(self, local: Quads) -> Quads:
        """Return `local` (N, 4, 3) (s, z, d) as (N, 4, 3) world x, y, z."""
        world = local.reshape(-1, 3) @ self._basis
        world[:, :2] += self.origin
        return world.reshape(-1, 4, 3)


@dataclass(frozen=True, kw_only=True)
class Grid:
    """Openings in rows and columns: `low`, `high` (R,) heights; `left`, `right` (C,) along the wall.

    `bottom` (R, C) is where each opening begins, at `low` or above; rows and columns do not overlap.
    """

    low: NDArray[np.float64]
    high: NDArray[np.float64]
    left: NDArray[np.float64]
    right: NDArray[np.float64]
    bottom: NDArray[np.float64]
    depth_m: float

    @cached_property
    def rects(self) -> tuple[NDArray[np.float64], ...]:
        """Left, right, bottom and top of every opening, each (R * C,), row by row."""
        shape = self.bottom.shape
        left, right = (np.broadcast_to(value, shape).ravel() for value in (self.left, self.right))
        return left, right, self.bottom.ravel(), np.broadcast_to(self.high[:, None], shape).ravel()


def grid(
    *,
    low: ArrayLike,
    high: ArrayLike,
    left: ArrayLike,
    right: ArrayLike,
    depth_m: float,
    bottom: ArrayLike | None = None,
) -> Grid:
    """Return a `Grid`; without `bottom` all openings of a row begin at its `low`."""
    lows, lefts = np.atleast_1d(np.asarray(low, float)), np.atleast_1d(np.asarray(left, float))
    start = lows[:, None] if bottom is None else np.asarray(bottom, float)
    return Grid(
        low=lows,
        high=np.atleast_1d(np.asarray(high, float)),
        left=lefts,
        right=np.atleast_1d(np.asarray(right, float)),
        bottom=np.broadcast_to(start, (len(lows), len(lefts))),
        depth_m=depth_m,
    )


def panels(left: ArrayLike, right: ArrayLike, low: ArrayLike, high: ArrayLike, out: ArrayLike = 0.0) -> Quads:
    """Return upright quads that face outwards at `out`; the arguments broadcast."""
    return _between((left, low, out), (right, high, out), _BOX_ENDS[:1])


def boxes(
    left: ArrayLike, right: ArrayLike, low: ArrayLike, high: ArrayLike, out: ArrayLike, back: ArrayLike = 0.0
) -> Quads:
    """Return boxes that stand out from `back` to `out`, open at the back: 5 quads each."""
    return _between((left, low, back), (right, high, out), _BOX_ENDS)


def _between(least: tuple[ArrayLike, ...], most: tuple[ArrayLike, ...], ends: NDArray[np.int64]) -> Quads:
    """Return the faces whose corners take `ends` (K, 4, 3) of the boxes from `least` to `most` (s, z, d)."""
    arrays = [np.asarray(value, dtype=np.float64) for value in (*least, *most)]
    shape = np.broadcast(*arrays).shape
    pairs = np.empty((*shape, 2, 3))
    for number, value in enumerate(arrays):
        pairs[..., number // 3, number % 3] = value
    return pairs[..., ends, _AXES].reshape(-1, 4, 3)


_AXES = np.arange(3)
_BOX_ENDS = np.array(
    [
        [[0, 0, 1], [1, 0, 1], [1, 1, 1], [0, 1, 1]],
        [[0, 1, 1], [1, 1, 1], [1, 1, 0], [0, 1, 0]],
        [[0, 0, 0], [1, 0, 0], [1, 0, 1], [0, 0, 1]],
        [[0, 0, 0], [0, 0, 1], [0, 1, 1], [0, 1, 0]],
        [[1, 0, 1], [1, 0, 0], [1, 1, 0], [1, 1, 1]],
    ]
)
"""Which end of the box each corner takes on (s, z, d): front, top, underside, left, right."""


def pierced_wall(length_m: float, top_m: float, grids: list[Grid]) -> Quads:
    """Return the wall from the ground to `top_m` less the `grids`' openings, and the openings' reveals."""
    grids = [g for g in grids if g.bottom.size]
    if not grids:
        return panels(0.0, length_m, 0.0, top_m)
    lows, highs = (np.concatenate([getattr(g, name) for g in grids]) for name in ("low", "high"))
    order = np.argsort(lows)
    bands = panels(0.0, length_m, np.r_[0.0, highs[order]], np.r_[lows[order], top_m])
    return np.concatenate([bands, *(piece for g in grids for piece in (_piers(g, length_m), _reveals(g)))])


def _piers(openings: Grid, length_m: float) -> Quads:
    """Return what stands between the openings of each row, and below those that begin above it."""
    left, right = np.r_[0.0, openings.right], np.r_[openings.left, length_m]
    piers = panels(left, right, openings.low[:, None], openings.high[:, None])
    raised = (openings.bottom > openings.low[:, None] + 1e-6).ravel()
    if not raised.any():
        return piers
    s0, s1, z0, _ = (value[raised] for value in openings.rects)
    foot = np.broadcast_to(openings.low[:, None], openings.bottom.shape).ravel()[raised]
    return np.concatenate([piers, panels(s0, s1, foot, z0)])


def _reveals(openings: Grid) -> Quads:
    """Return the four inner faces of each opening, from the wall's face back to its pane."""
    s0, s1, z0, z1 = openings.rects
    front, back = np.zeros_like(s0), np.full_like(s0, -openings.depth_m)
    corners = np.array(
        [
            [[s0, z0, front], [s1, z0, front], [s1, z0, back], [s0, z0, back]],
            [[s0, z1, back], [s1, z1, back], [s1, z1, front], [s0, z1, front]],
            [[s0, z0, front], [s0, z0, back], [s0, z1, back], [s0, z1, front]],
            [[s1, z0, back], [s1, z0, front], [s1, z1, front], [s1, z1, back]],
        ]
    )  # (4, 4, 3, N)
    return corners.transpose(3, 0, 1, 2).reshape(-1, 4, 3)


def panes(openings: Grid) -> Quads:
    """Return what closes each opening, set back by its depth."""
    s0, s1, z0, z1 = openings.rects
    return panels(s0, s1, z0, z1, -openings.depth_m)


def sills(openings: Grid) -> Quads:
    """Return a sill under each opening: 0.06 m out, 0.07 m high, 0.06 m wider to both sides."""
    s0, s1, z0, _ = openings.rects
    return boxes(s0 - 0.06, s1 + 0.06, z0 - 0.07, z0, 0.06)


def mullions(openings: Grid) -> Quads:
    """Return an upright bar of 0.07 m before the middle of each pane."""
    s0, s1, z0, z1 = openings.rects
    middle, back = 0.5 * (s0 + s1), -openings.depth_m
    bars = boxes(middle - 0.035, middle + 0.035, z0, z1, back + 0.05, back)
    return bars.reshape(-1, 5, 4, 3)[:, [0, 3, 4]].reshape(-1, 4, 3)


def balconies(
    left: ArrayLike, right: ArrayLike, floor_m: ArrayLike, *, out_m: float, solid: bool
) -> tuple[Quads, Quads]:
    """Return slabs (with parapets if `solid`) and open railings (none if `solid`), (N, 4, 3) each."""
    s0, s1, z = np.broadcast_arrays(*(np.atleast_1d(np.asarray(v, float)) for v in (left, right, floor_m)))
    slab = boxes(s0, s1, z - 0.2, z, out_m)
    if solid:
        front = boxes(s0, s1, z, z + 1.0, out_m, out_m - 0.1)
        sides = [boxes(s, s + 0.1, z, z + 1.0, out_m - 0.1) for s in (s0, s1 - 0.1)]
        return np.concatenate([slab, front, *sides]), np.zeros((0, 4, 3))
    rail = boxes(s0, s1, z + 1.02, z + 1.08, out_m, out_m - 0.06)
    ends = [boxes(s, s + 0.05, z + 1.02, z + 1.08, out_m - 0.06) for s in (s0, s1 - 0.05)]
    share = np.linspace(0.0, 1.0, 5)
    place = (s0[:, None] + 0.02 + share * (s1 - s0 - 0.06)[:, None]).ravel()
    posts = boxes(place, place + 0.03, np.repeat(z, 5), np.repeat(z, 5) + 1.02, out_m - 0.02, out_m - 0.05)
    return slab, np.concatenate([rail, *ends, posts])


def ribs(
    left_m: float, right_m: float, low_m: float, high_m: float, *, pitch_m: float, depth_m: float
) -> Quads:
    """Return profiled sheet: upright trapezoid ribs `depth_m` proud, about `pitch_m` apart."""
    if right_m - left_m < 0.05 or high_m - low_m < 0.05:
        return np.zeros((0, 4, 3))
    count = max(1, round((right_m - left_m) / pitch_m))
    pitch = (right_m - left_m) / count
    slope = min(0.6 * depth_m, 0.1 * pitch)
    knots = np.array([0.0, 0.3 * pitch, 0.3 * pitch + slope, 0.7 * pitch - slope, 0.7 * pitch])
    s = np.r_[(left_m + pitch * np.arange(count)[:, None] + knots).ravel(), right_m]
    d = np.r_[np.tile([0.0, 0.0, depth_m, depth_m, 0.0], count), 0.0]
    low, high = np.full(len(s) - 1, low_m), np.full(len(s) - 1, high_m)
    corners = np.array([s[:-1], low, d[:-1], s[1:], low, d[1:], s[1:], high, d[1:], s[:-1], high, d[:-1]])
    return corners.reshape(4, 3, -1).transpose(2, 0, 1)


def slats(
    left_m: float, right_m: float, low_m: float, high_m: float, out_m: float, *, pitch_m: float = 0.4
) -> Quads:
    """Return a roller shutter: level slats, each leaning out to 0.04 m and back."""
    count = max(2, round((high_m - low_m) / pitch_m))
    z = np.linspace(low_m, high_m, 2 * count + 1)
    d = out_m + np.where(np.arange(len(z)) % 2, 0.04, 0.0)
    s0, s1 = np.full(2 * count, left_m), np.full(2 * count, right_m)
    corners = np.array([s0, z[:-1], d[:-1], s1, z[:-1], d[:-1], s1, z[1:], d[1:], s0, z[1:], d[1:]])
    return corners.reshape(4, 3, -1).transpose(2, 0, 1)


def downpipe(place_m: ArrayLike, top_m: float, *, radius_m: float = 0.045) -> Quads:
    """Return rainwater pipes at places (N,) along the wall: the five outer sides of an octagon."""
    angle = np.pi * (np.arange(6) - 1) / 4 - np.pi / 8 + np.pi / 4
    across, out = -radius_m * np.cos(angle), 0.03 + radius_m + radius_m * np.sin(angle)
    place = np.atleast_1d(np.asarray(place_m, float))[:, None]
    s0, s1 = (place + across[:-1]).ravel(), (place + across[1:]).ravel()
    d0, d1 = (np.tile(value, len(place)) for value in (out[:-1], out[1:]))
    z0, z1 = np.zeros_like(s0), np.full_like(s0, top_m)
    corners = np.array([s0, z0, d0, s1, z0, d1, s1, z1, d1, s0, z1, d0])
    return corners.reshape(4, 3, -1).transpose(2, 0, 1)
