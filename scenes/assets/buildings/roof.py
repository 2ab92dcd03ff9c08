"""Roofs over footprints: gable and hip over quadrilaterals, mansard and flat with a parapet over any outline.

All return quads (N, 4, 3) [m] in the world, counter-clockwise seen from outside; a triangle repeats a corner.
"""

import numpy as np
from numpy.typing import ArrayLike, NDArray

from echoscape.scenes.geometry.triangulation import polygon_triangles

Quads = NDArray[np.float64]


def offset_outline(outline: NDArray[np.float64], distance_m: ArrayLike) -> NDArray[np.float64]:
    """Move the edges of a polygon outwards.

    Args:
        outline: Counter-clockwise polygon (N, 2) [m].
        distance_m: Distance [m], one for all edges or one per edge (N,); negative inwards.

    Returns:
        The offset polygon (N, 2) [m].
    """
    step = np.roll(outline, -1, axis=0) - outline
    along = step / np.hypot(step[:, 0], step[:, 1])[:, None]
    normal = along[:, ::-1] * [1.0, -1.0]
    shift = (normal * outline).sum(axis=1) + distance_m
    before, shift_before = np.roll(normal, 1, axis=0), np.roll(shift, 1)
    cross = before[:, 0] * normal[:, 1] - before[:, 1] * normal[:, 0]
    straight = np.abs(cross) < 1e-3
    cross = np.where(straight, 1.0, cross)
    x = (shift_before * normal[:, 1] - shift * before[:, 1]) / cross
    y = (shift * before[:, 0] - shift_before * normal[:, 0]) / cross
    plain = outline + normal * np.broadcast_to(distance_m, len(outline))[:, None]
    return np.where(straight[:, None], plain, np.stack([x, y], axis=1))


def signed_area(outline: NDArray[np.float64]) -> float:
    """Return the area of a polygon.

    Args:
        outline: Polygon (N, 2) [m].

    Returns:
        Area [m^2], positive if counter-clockwise.
    """
    x, y = outline.T
    return 0.5 * float((x * np.roll(y, -1) - np.roll(x, -1) * y).sum())


def raised(outline: NDArray[np.float64], height_m: float) -> NDArray[np.float64]:
    """Give an outline a height.

    Args:
        outline: Points (N, 2) [m].
        height_m: Height [m].

    Returns:
        Points (N, 3) [m].
    """
    return np.concatenate([outline, np.full((len(outline), 1), height_m)], axis=1)


def lid(outline: NDArray[np.float64], height_m: float) -> Quads:
    """Make a level surface over a polygon, facing up.

    Args:
        outline: Counter-clockwise polygon (N, 2) [m].
        height_m: Height [m].

    Returns:
        Quads (M, 4, 3).
    """
    corners = raised(outline, height_m)
    if len(outline) == 4 and _is_convex(outline):
        return corners[None]
    return corners[polygon_triangles(outline)[:, [0, 1, 2, 0]]]


def _is_convex(outline: NDArray[np.float64]) -> bool:
    step = np.roll(outline, -1, axis=0) - outline
    after = np.roll(step, -1, axis=0)
    return bool(np.all(step[:, 0] * after[:, 1] - step[:, 1] * after[:, 0] > 0))


def skirt(lower: NDArray[np.float64], upper: NDArray[np.float64]) -> Quads:
    """Make the quads between two rings; they face outwards if `upper` is above or inside `lower`.

    Args:
        lower: Lower ring (N, 3) [m].
        upper: Upper ring (N, 3) [m].

    Returns:
        Quads (N, 4, 3).
    """
    return np.stack([lower, np.roll(lower, -1, axis=0), np.roll(upper, -1, axis=0), upper], axis=1)


def flat_roof(outline: NDArray[np.float64], *, height_m: float, parapet_m: float) -> tuple[Quads, Quads]:
    """Make a flat roof behind a parapet, for walls that end at `height_m + parapet_m`.

    Args:
        outline: Counter-clockwise footprint (N, 2) [m].
        height_m: Height of the deck [m].
        parapet_m: Height of the parapet above the deck [m].

    Returns:
        Quads of the deck with the inner face of the parapet, and quads of the coping.
    """
    inner, outer = offset_outline(outline, -0.25), offset_outline(outline, 0.05)
    top = height_m + parapet_m
    inside = skirt(raised(inner, top), raised(inner, height_m))
    coping = [
        skirt(raised(outer, top), raised(outer, top + 0.06)),
        skirt(raised(outer, top + 0.06), raised(inner, top + 0.06)),
        skirt(raised(outline, top), raised(outer, top)),
        skirt(raised(inner, top + 0.06), raised(inner, top)),
    ]
    return np.concatenate([lid(inner, height_m), inside]), np.concatenate(coping)


def mansard_roof(outline: NDArray[np.float64], *, height_m: float, inset_m: float, rise_m: float) -> Quads:
    """Make a mansard roof closed by a level top.

    Args:
        outline: Counter-clockwise footprint (N, 2) [m].
        height_m: Height of the walls [m].
        inset_m: Horizontal extent of the slopes [m].
        rise_m: Vertical extent of the slopes [m].

    Returns:
        Quads (M, 4, 3).
    """
    eaves, top = offset_outline(outline, 0.3), offset_outline(outline, -inset_m)
    drop = height_m - 0.3 * rise_m / inset_m
    slopes = skirt(raised(eaves, drop), raised(top, height_m + rise_m))
    soffit = skirt(raised(outline, drop), raised(eaves, drop))
    return np.concatenate([slopes, lid(top, height_m + rise_m), soffit])


def pitched_roof(
    outline: NDArray[np.float64], overhang_m: NDArray[np.float64], *, height_m: float, slope: float, hip: bool
) -> tuple[Quads, Quads, NDArray[np.float64]]:
    """Make a gable or hip roof over a quadrilateral, with eaves on edges 0 and 2.

    Args:
        outline: Counter-clockwise footprint (4, 2) [m].
        overhang_m: Overhang beyond each edge (4,) [m].
        height_m: Height of the walls [m].
        slope: Rise over run of the roof.
        hip: Whether it is a hip roof, which has no gables.

    Returns:
        Quads of the surfaces, quads of the gable walls, and the ends of the ridge (2, 3) [m].
    """
    outer = offset_outline(outline, overhang_m)
    ridge = 0.5 * (outline + np.roll(outline, -1, axis=0))[[3, 1]]  # over edges 3 and 1
    run = half_span_m(outline)
    top, drop = height_m + slope * run, height_m - slope * float(max(overhang_m[[0, 2]]))
    if hip:
        span = ridge[1] - ridge[0]
        share = min(0.42, run / max(1e-6, float(np.linalg.norm(span))))
        ridge = ridge + share * np.array([span, -span])
    wall_ridge = raised(ridge, top)
    if not hip:
        ridge = 0.5 * (outer + np.roll(outer, -1, axis=0))[[3, 1]]
    a, b, c, d = raised(outer, drop)
    r0, r1 = raised(ridge, top + 0.12)
    thick = np.array([0.0, 0.0, 0.15])
    surfaces = [np.stack([[a, b, r1, r0], [c, d, r0, r1]])]
    low = raised(outer, drop) - thick
    soffit = skirt(raised(outline, float(low[0, 2])), low)
    if hip:
        surfaces += [np.stack([[b, c, r1, b], [d, a, r0, d]]), skirt(low, raised(outer, drop)), soffit]
        return np.concatenate(surfaces), np.zeros((0, 4, 3)), wall_ridge
    la, lb, lc, ld = low
    s0, s1 = r0 - thick, r1 - thick
    verge = [
        [la, lb, b, a],
        [lc, ld, d, c],
        [lb, s1, r1, b],
        [s1, lc, c, r1],
        [ld, s0, r0, d],
        [s0, la, a, r0],
    ]
    surfaces += [np.array(verge), soffit[[0, 2]]]
    pa, pb, pc, pd = raised(outline, height_m)
    gables = np.stack([[pb, pc, wall_ridge[1], pb], [pd, pa, wall_ridge[0], pd]])
    return np.concatenate(surfaces), gables, wall_ridge


def half_span_m(outline: NDArray[np.float64]) -> float:
    """Return half the mean distance between the eaves of a pitched roof.

    Args:
        outline: Counter-clockwise footprint (4, 2) with eaves on edges 0 and 2 [m].

    Returns:
        The run of its slopes [m].
    """
    return 0.25 * float(np.linalg.norm(outline[0] - outline[3]) + np.linalg.norm(outline[1] - outline[2]))


def upright_box(
    centre: ArrayLike, size_m: tuple[float, float], *, bottom_m: float, top_m: float, yaw_rad: float = 0.0
) -> Quads:
    """Make a box without underside, as for chimneys and equipment on roofs.

    Args:
        centre: Centre (2,) [m].
        size_m: Length and width [m].
        bottom_m: Height of the bottom [m].
        top_m: Height of the top [m].
        yaw_rad: Heading of its length [rad].

    Returns:
        Quads (5, 4, 3).
    """
    cos, sin = np.cos(yaw_rad), np.sin(yaw_rad)
    corner = 0.5 * np.array([[-1, -1], [1, -1], [1, 1], [-1, 1]]) * size_m
    outline = corner @ np.array([[cos, sin], [-sin, cos]]) + np.asarray(centre)
    foot, head = raised(outline, bottom_m), raised(outline, top_m)
    return np.concatenate([skirt(foot, head), head[None]])
