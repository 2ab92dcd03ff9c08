"""Facades as quads: walls with openings, reveals, panes, sills, balconies, ribs and pipes.

Coordinates of a facade are (s, z, d): along the wall to the right as seen from outside, up, and outwards;
they are right-handed. A quad is (4, 3), counter-clockwise seen from its outer side; several are (N, 4, 3)
[m].
"""

from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import ArrayLike, NDArray

Quads = NDArray[np.float64]


@dataclass(frozen=True, kw_only=True)
class Frame:
    """Position of a facade in the world.

    Attributes:
        origin: Its lower left corner (2,) [m], seen from outside.
        along: Unit vector (2,) along the wall.
        length_m: Length of the wall [m].
    """

    origin: NDArray[np.float64]
    along: NDArray[np.float64]
    length_m: float

    @cached_property
    def _basis(self) -> NDArray[np.float64]:
        (x, y), up = self.along, (0.0, 0.0, 1.0)
        return np.array([[x, y, 0.0], up, [y, -x, 0.0]])

    def to_world(self, local: Quads) -> Quads:
        """Convert quads from facade to world coordinates.

        Args:
            local: Quads in (s, z, d) (N, 4, 3) [m].

        Returns:
            Quads in x, y, z (N, 4, 3) [m].
        """
        world = local.reshape(-1, 3) @ self._basis
        world[:, :2] += self.origin
        return world.reshape(-1, 4, 3)


@dataclass(frozen=True, kw_only=True)
class Grid:
    """Openings in R rows and C columns, which do not overlap.

    Attributes:
        low: Lower edge of each row (R,) [m].
        high: Upper edge of each row (R,) [m].
        left: Left edge of each column (C,) [m].
        right: Right edge of each column (C,) [m].
        bottom: Lower edge of each opening (R, C) [m], at `low` or above.
        depth_m: Depth of the reveals [m].
    """

    low: NDArray[np.float64]
    high: NDArray[np.float64]
    left: NDArray[np.float64]
    right: NDArray[np.float64]
    bottom: NDArray[np.float64]
    depth_m: float

    @cached_property
    def rects(self) -> tuple[NDArray[np.float64], ...]:
        """Left, right, bottom and top of each opening, each (R * C,) [m], row by row."""
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
    """Make a grid of openings.

    Args:
        low: Lower edges of the rows (R,) [m].
        high: Upper edges of the rows (R,) [m].
        left: Left edges of the columns (C,) [m].
        right: Right edges of the columns (C,) [m].
        depth_m: Depth of the reveals [m].
        bottom: Lower edges of the openings (R, C) [m]; None for the lower edges of their rows.

    Returns:
        The grid.
    """
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
    """Make upright quads that face outwards; the arguments broadcast.

    Args:
        left: Left edges [m].
        right: Right edges [m].
        low: Lower edges [m].
        high: Upper edges [m].
        out: Distance outwards from the wall [m].

    Returns:
        Quads (N, 4, 3).
    """
    return _between((left, low, out), (right, high, out), _BOX_ENDS[:1])


def boxes(
    left: ArrayLike, right: ArrayLike, low: ArrayLike, high: ArrayLike, out: ArrayLike, back: ArrayLike = 0.0
) -> Quads:
    """Make boxes that stand out from the wall, open at the back; the arguments broadcast.

    Args:
        left: Left edges [m].
        right: Right edges [m].
        low: Lower edges [m].
        high: Upper edges [m].
        out: Distance of the front from the wall [m].
        back: Distance of the back from the wall [m].

    Returns:
        Quads (5 N, 4, 3).
    """
    return _between((left, low, back), (right, high, out), _BOX_ENDS)


def _between(least: tuple[ArrayLike, ...], most: tuple[ArrayLike, ...], ends: NDArray[np.int64]) -> Quads:
    """Return the faces, given by `ends` (K, 4, 3), of boxes from `least` to `most` in (s, z, d)."""
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
"""End of the box (0 least, 1 most) of each corner in s, z, d: front, top, underside, left, right."""


def pierced_wall(length_m: float, top_m: float, grids: list[Grid]) -> Quads:
    """Make a wall with openings and their reveals.

    Args:
        length_m: Length of the wall [m].
        top_m: Height of the wall [m].
        grids: Its openings.

    Returns:
        Quads (N, 4, 3).
    """
    grids = [g for g in grids if g.bottom.size]
    if not grids:
        return panels(0.0, length_m, 0.0, top_m)
    lows, highs = (np.concatenate([getattr(g, name) for g in grids]) for name in ("low", "high"))
    order = np.argsort(lows)
    bands = panels(0.0, length_m, np.r_[0.0, highs[order]], np.r_[lows[order], top_m])
    return np.concatenate([bands, *(piece for g in grids for piece in (_piers(g, length_m), _reveals(g)))])


def _piers(openings: Grid, length_m: float) -> Quads:
    """Return the wall between the openings of each row, and below openings that begin above their row."""
    left, right = np.r_[0.0, openings.right], np.r_[openings.left, length_m]
    piers = panels(left, right, openings.low[:, None], openings.high[:, None])
    raised = (openings.bottom > openings.low[:, None] + 1e-6).ravel()
    if not raised.any():
        return piers
    s0, s1, z0, _ = (value[raised] for value in openings.rects)
    foot = np.broadcast_to(openings.low[:, None], openings.bottom.shape).ravel()[raised]
    return np.concatenate([piers, panels(s0, s1, foot, z0)])


def _reveals(openings: Grid) -> Quads:
    """Return the four inner faces of each opening, from the face of the wall back to its pane."""
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
    """Make the panes that close openings, set back by their depth.

    Args:
        openings: The openings.

    Returns:
        Quads (N, 4, 3).
    """
    s0, s1, z0, z1 = openings.rects
    return panels(s0, s1, z0, z1, -openings.depth_m)


def sills(openings: Grid) -> Quads:
    """Make a sill under each opening: 0.06 m out, 0.07 m high, 0.06 m wider on both sides.

    Args:
        openings: The openings.

    Returns:
        Quads (5 N, 4, 3).
    """
    s0, s1, z0, _ = openings.rects
    return boxes(s0 - 0.06, s1 + 0.06, z0 - 0.07, z0, 0.06)


def mullions(openings: Grid) -> Quads:
    """Make an upright bar, 0.07 m wide, in front of the middle of each pane.

    Args:
        openings: The openings.

    Returns:
        Quads (3 N, 4, 3).
    """
    s0, s1, z0, z1 = openings.rects
    middle, back = 0.5 * (s0 + s1), -openings.depth_m
    bars = boxes(middle - 0.035, middle + 0.035, z0, z1, back + 0.05, back)
    return bars.reshape(-1, 5, 4, 3)[:, [0, 3, 4]].reshape(-1, 4, 3)


def balconies(
    left: ArrayLike, right: ArrayLike, floor_m: ArrayLike, *, out_m: float, solid: bool
) -> tuple[Quads, Quads]:
    """Make balconies.

    Args:
        left: Left edges (N,) [m].
        right: Right edges (N,) [m].
        floor_m: Heights of their floors (N,) [m].
        out_m: Depth [m].
        solid: Whether they have parapets instead of railings.

    Returns:
        Quads of the slabs with any parapets, and quads of the railings, which are none if `solid`; each (M,
        4, 3).
    """
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
    """Make profiled sheet with upright trapezoidal ribs.

    Args:
        left_m: Left edge [m].
        right_m: Right edge [m].
        low_m: Lower edge [m].
        high_m: Upper edge [m].
        pitch_m: Approximate distance between ribs [m].
        depth_m: Height of the ribs above the sheet [m].

    Returns:
        Quads (N, 4, 3); none on a sheet narrower or lower than 0.05 m.
    """
    if right_m - left_m < 0.05 or high_m - low_m < 0.05:
        return np.zeros((0, 4, 3))
    count = max(1, round((right_m - left_m) / pitch_m))
    pitch = (right_m - left_m) / count
    slope = min(0.6 * depth_m, 0.1 * pitch)
    knots = np.array([0.0, 0.3 * pitch, 0.3 * pitch + slope, 0.7 * pitch - slope, 0.7 * pitch])
    s = np.r_[(left_m + pitch * np.arange(count)[:, None] + knots).ravel(), right_m]
    d = np.r_[np.tile([0.0, 0.0, depth_m, depth_m, 0.0], count), 0.0]
    low, high = np.full(len(s) - 1, low_m), np.full(len(s) - 1, high_m)
    return _separate_quads(
        (s[:-1], low, d[:-1]), (s[1:], low, d[1:]), (s[1:], high, d[1:]), (s[:-1], high, d[:-1])
    )


def slats(
    left_m: float, right_m: float, low_m: float, high_m: float, out_m: float, *, pitch_m: float = 0.4
) -> Quads:
    """Make a roller shutter of level slats, each leaning out by 0.04 m and back.

    Args:
        left_m: Left edge [m].
        right_m: Right edge [m].
        low_m: Lower edge [m].
        high_m: Upper edge [m].
        out_m: Distance from the wall, negative inwards [m].
        pitch_m: Approximate height of a slat [m].

    Returns:
        Quads (N, 4, 3).
    """
    count = max(2, round((high_m - low_m) / pitch_m))
    z = np.linspace(low_m, high_m, 2 * count + 1)
    d = out_m + np.where(np.arange(len(z)) % 2, 0.04, 0.0)
    s0, s1 = np.full(2 * count, left_m), np.full(2 * count, right_m)
    return _separate_quads((s0, z[:-1], d[:-1]), (s1, z[:-1], d[:-1]), (s1, z[1:], d[1:]), (s0, z[1:], d[1:]))


def downpipe(place_m: ArrayLike, top_m: float, *, radius_m: float = 0.045) -> Quads:
    """Make rainwater pipes, each the five outer sides of an octagon.

    Args:
        place_m: Places along the wall (N,) [m].
        top_m: Height of their tops [m].
        radius_m: Radius [m].

    Returns:
        Quads (5 N, 4, 3).
    """
    angle = np.pi * (np.arange(6) - 1) / 4 - np.pi / 8 + np.pi / 4
    across, out = -radius_m * np.cos(angle), 0.03 + radius_m + radius_m * np.sin(angle)
    place = np.atleast_1d(np.asarray(place_m, float))[:, None]
    s0, s1 = (place + across[:-1]).ravel(), (place + across[1:]).ravel()
    d0, d1 = (np.tile(value, len(place)) for value in (out[:-1], out[1:]))
    z0, z1 = np.zeros_like(s0), np.full_like(s0, top_m)
    return _separate_quads((s0, z0, d0), (s1, z0, d1), (s1, z1, d1), (s0, z1, d0))


def _separate_quads(*corners: tuple[NDArray[np.float64], ...]) -> Quads:
    """Return quads (N, 4, 3) from the s, z, d (N,) of each of their four corners."""
    return np.array(corners).transpose(2, 0, 1)
