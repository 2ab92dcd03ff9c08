"""Vehicle bodies as hulls: cross-sections along the length, rounded in plan and section, with wheel arches.

Like a ship's hull, a body is given by lines (floor, belt, roof, plan) at a few places along the vehicle and
sampled at stations. Curved shoulders matter, since they decide which facet reflects specularly towards the
radar.
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from echoscape.scenes.core.scene import Mesh
from echoscape.scenes.geometry.meshes import merge, mesh, mirrored, moved
from echoscape.scenes.geometry.primitives import box, circle, loft, loft_quads
from echoscape.scenes.geometry.smooth_normals import smoothed

Line = tuple[tuple[float, float], ...]
"""Knots (distance from the front [m], value) of a piecewise linear profile along a vehicle."""

_SIDE_SEGMENTS = (4, 8)  # belt to rail, left and right
_TOP_SEGMENTS = (5, 6, 7)  # rail to crown, crown to crown, crown to rail
_MIN_STATION_M = 0.055
_CREASE_RAD = np.radians(50.0)
"""Faces that meet at less are one curved surface: panels and bumpers; edges of wheel arches stay sharp."""
_FASCIA_M = 0.07
"""Reach of the bumper fascias from both ends [m]: plastic over lamps, grilles and beams."""


@dataclass(frozen=True, kw_only=True)
class Hull:
    """Lines of a vehicle body; distances count from the front bumper backwards, heights from the ground.

    Attributes:
        length_m: Length [m].
        width_m: Width [m].
        floor: Height of the floor along the length [m].
        belt: Height of the belt line along the length [m].
        roof: Height of the roof along the length [m].
        plan: Half width along the length, as a share of the greatest half width.
        roof_share: Half width at the edge of the roof, as a share of the half width below.
        axles: Distances of the axles from the front [m].
        wheel_radius_m: Radius of the wheels [m].
        wheel_width_m: Width of the wheels [m].
        windows: Intervals along the sides that are glass [m].
        screens: Intervals along the top that are glass [m].
    """

    length_m: float
    width_m: float
    floor: Line
    belt: Line
    roof: Line
    plan: Line
    roof_share: float
    axles: tuple[float, ...]
    wheel_radius_m: float
    wheel_width_m: float
    windows: tuple[tuple[float, float], ...] = ()
    screens: tuple[tuple[float, float], ...] = ()


def hull_parts(hull: Hull) -> dict[str, Mesh]:
    """Make the body of a vehicle.

    Args:
        hull: Its lines.

    Returns:
        Meshes of metal, glass and fittings (bumper fascias) by name of the material; x forward, front bumper
        at x = length / 2.
    """
    station = _stations(hull)
    rings = _rings(hull, station)
    count, size = rings.shape[:2]
    corners = loft_quads(count, size)
    glass = _is_glass(hull, station, size)
    fascia = _is_fascia(hull, station, size) & ~glass
    points = rings.reshape(-1, 3)
    ends = [_bowed_cap(rings[0][::-1], -0.03), _bowed_cap(rings[-1], 0.03)]
    parts = {
        "metal": mesh(points, _split(corners[~glass & ~fascia])),
        "fittings": merge([mesh(points, _split(corners[fascia])), *ends]),
        "glass": mesh(points, _split(corners[glass])),
    }
    return _smoothed_together(parts)


def _smoothed_together(parts: dict[str, Mesh]) -> dict[str, Mesh]:
    """Give parts the normals of the one curved surface that they make up; leave out those without faces."""
    normals = smoothed(merge(parts.values()), crease_rad=_CREASE_RAD).normals
    assert normals is not None
    ends = np.cumsum([len(part.faces) for part in parts.values()])[:-1]
    shares = zip(parts.items(), np.split(normals, ends), strict=True)
    return {name: replace(part, normals=share) for (name, part), share in shares if len(part.faces)}


def _stations(hull: Hull) -> NDArray[np.float64]:
    """Return distances (K,) from the front, from tail to nose, with one at every knot and wheel arch."""
    lines = (hull.floor, hull.belt, hull.roof, hull.plan)
    knots = [x for line in lines for x, _ in line]
    knots += [x for pair in hull.windows + hull.screens for x in pair]
    arch = 1.15 * hull.wheel_radius_m
    knots += [axle + share * arch for axle in hull.axles for share in (-1.0, -0.65, 0.65, 1.0)]
    ordered = np.unique(np.round(np.clip(knots, 0.0, hull.length_m), 3))
    kept = [0.0]
    for x in ordered[1:-1].tolist():
        if x - kept[-1] > _MIN_STATION_M and hull.length_m - x > 0.6 * _MIN_STATION_M:
            kept.append(x)
    return np.array([*kept, hull.length_m])[::-1]


def _rings(hull: Hull, station: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return cross-sections (K, 14, 3), counter-clockwise about +x."""
    floor, belt, roof, plan = (
        np.interp(station, *np.array(line).T) for line in (hull.floor, hull.belt, hull.roof, hull.plan)
    )
    roof = np.maximum(roof, belt)
    half = 0.5 * hull.width_m * plan
    arch = np.maximum(floor, _arch_height(hull, station))
    inner = np.minimum(0.5 * hull.width_m - hull.wheel_width_m - 0.06, 0.98 * half)
    bulge = np.maximum(floor + 0.55 * (belt - floor), arch + 0.04)
    belt = np.maximum(belt, bulge + 0.02)
    roof = np.maximum(roof, belt)
    raised = np.clip((roof - belt) / 0.4, 0.0, 1.0)
    rail = half * (0.9 + (hull.roof_share - 0.9) * raised)
    lift = 0.05 * raised + 0.02
    left = np.stack(
        [
            np.stack([inner, floor], 1),
            np.stack([inner, arch], 1),
            np.stack([0.975 * half, arch], 1),
            np.stack([half, bulge], 1),
            np.stack([0.965 * half, belt - 0.03 * (1 - raised)], 1),
            np.stack([rail, roof - lift], 1),
            np.stack([0.78 * rail, roof], 1),
        ],
        axis=1,
    )  # (K, 7, 2)
    right = left[:, ::-1] * [-1.0, 1.0]
    section = np.concatenate([left, right], axis=1)
    along = np.broadcast_to((0.5 * hull.length_m - station)[:, None, None], (*section.shape[:2], 1))
    return np.concatenate([along, section], axis=2)


def _arch_height(hull: Hull, station: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return the height of the wheel arches (K,) [m], 0 between them."""
    radius = 1.15 * hull.wheel_radius_m
    away = station[:, None] - np.array(hull.axles)
    inside = np.abs(away) < 0.99 * radius
    height = hull.wheel_radius_m + np.sqrt(np.maximum(radius**2 - away**2, 0.0))
    return np.where(inside, height, 0.0).max(axis=1)


def _is_glass(hull: Hull, station: NDArray[np.float64], size: int) -> NDArray[np.bool_]:
    """Return which quads between the cross-sections are glass ((K - 1) * size,)."""
    middle = 0.5 * (station[1:] + station[:-1])
    glass = np.zeros((len(middle), size), dtype=bool)
    for intervals, segments in ((hull.windows, _SIDE_SEGMENTS), (hull.screens, _TOP_SEGMENTS)):
        for low, high in intervals:
            rows = (middle > low) & (middle < high)
            glass[np.ix_(rows, np.array(segments))] = True
    return glass.ravel()


def _is_fascia(hull: Hull, station: NDArray[np.float64], size: int) -> NDArray[np.bool_]:
    """Return which quads between the cross-sections belong to the bumper fascias ((K - 1) * size,)."""
    middle = 0.5 * (station[1:] + station[:-1])
    return np.repeat(np.minimum(middle, hull.length_m - middle) < _FASCIA_M, size)


def _split(corners: NDArray[np.int64]) -> NDArray[np.int64]:
    """Split quads (Q, 4) into triangles (2 Q, 3)."""
    return np.concatenate([corners[:, [0, 1, 2]], corners[:, [0, 2, 3]]])


def _bowed_cap(ring: NDArray[np.float64], bow_m: float) -> Mesh:
    """Make a triangle fan over a ring, bowed along x by `bow_m`, so that no bumper is one flat reflector."""
    size = len(ring)
    middle = 0.5 * (ring.min(axis=0) + ring.max(axis=0)) + [bow_m, 0.0, 0.0]
    rim = np.arange(size)
    faces = np.stack([np.full(size, size), rim, (rim + 1) % size], axis=1)
    return mesh(np.concatenate([ring, middle[None]]), faces)


def wheels(axles_x_m: Sequence[float], *, track_m: float, radius_m: float, width_m: float) -> dict[str, Mesh]:
    """Make pairs of wheels.

    Args:
        axles_x_m: x of each axle [m].
        track_m: Distance between the outer faces of a pair [m].
        radius_m: Radius [m].
        width_m: Width [m].

    Returns:
        Meshes of rubber (tyres) and metal (dished rims) by name of the material.
    """
    tyre, rim = _wheel(radius_m, width_m)
    parts: dict[str, Mesh] = {}
    for material, left in (("rubber", tyre), ("metal", rim)):
        both = [
            side
            for x in axles_x_m
            for side in (
                moved(left, (x, 0.5 * track_m, radius_m)),
                mirrored(moved(left, (x, 0.5 * track_m, radius_m))),
            )
        ]
        parts[material] = merge(both)
    return parts


def _wheel(radius_m: float, width_m: float, sides: int = 10) -> tuple[Mesh, Mesh]:
    """Make the tyre and rim of a left wheel, its outer face at y = 0 and its axle at z = 0."""
    ring = -circle(1.0, sides)  # begins straight below the axle: it touches the road
    shoulders = ((0.55, -width_m), (1.0, -width_m), (1.0, -0.03), (0.68, 0.0))
    profile = np.stack([_in_wheel_plane(ring, share * radius_m, y) for share, y in shoulders])
    edge = _in_wheel_plane(ring, 0.68 * radius_m, 0.0)
    rim = np.arange(sides)
    dish = np.stack([np.full(sides, sides), rim, (rim + 1) % sides], axis=1)
    closed = mesh(profile[0], [[0, i + 1, i] for i in range(1, sides - 1)])
    tyre = merge([loft(profile, caps=False), closed])
    disc = mesh(np.concatenate([edge, [[0.0, -0.04, 0.0]]]), dish)
    return smoothed(tyre, crease_rad=_CREASE_RAD), smoothed(disc, crease_rad=_CREASE_RAD)


def _in_wheel_plane(ring: NDArray[np.float64], radius_m: float, y_m: float) -> NDArray[np.float64]:
    """Return `ring` (N, 2) as z and x at `y_m` (N, 3)."""
    return np.stack([radius_m * ring[:, 1], np.full(len(ring), y_m), radius_m * ring[:, 0]], axis=1)


def bevelled_box(size_m: Sequence[float], centre_m: Sequence[float], *, bevel_m: float = 0.06) -> Mesh:
    """Make a box with bevelled ends and bevelled edges along x, like a sheet-metal body.

    Args:
        size_m: Size in x, y, z [m].
        centre_m: Centre x, y, z [m].
        bevel_m: Width of the bevels [m].

    Returns:
        The mesh.
    """
    length, width, height = size_m
    y, z = 0.5 * width, 0.5 * height
    outline = np.array(
        [
            [-y + bevel_m, -z],
            [y - bevel_m, -z],
            [y, -z + bevel_m],
            [y, z - bevel_m],
            [y - bevel_m, z],
            [-y + bevel_m, z],
            [-y, z - bevel_m],
            [-y, -z + bevel_m],
        ]
    )
    small = outline * [(y - bevel_m) / y, (z - bevel_m) / z]
    ends = 0.5 * length
    places = ((-ends, small), (-ends + bevel_m, outline), (ends - bevel_m, outline), (ends, small))
    rings = [np.c_[np.full(8, x), ring] for x, ring in places]
    return moved(loft(np.stack(rings)), centre_m)


def mirrors(x_m: float, half_width_m: float, z_m: float, *, height_m: float = 0.14) -> Mesh:
    """Make two wing mirrors, each a stalk and a housing that tapers forwards.

    Args:
        x_m: Distance ahead of the vehicle's centre [m].
        half_width_m: Half width of the body at the mirrors [m].
        z_m: Height [m].
        height_m: Height of the housing [m].

    Returns:
        The mesh.
    """
    stalk = box((0.05, 0.1, 0.04), (x_m, half_width_m - 0.02, z_m - 0.04))
    middle = np.array([half_width_m + 0.11, z_m + 0.02])
    back = np.array([[-0.09, -0.5], [0.09, -0.5], [0.09, 0.5], [-0.09, 0.5]]) * [1.0, height_m]
    rings = [np.c_[np.full(4, x_m - 0.04), back + middle], np.c_[np.full(4, x_m + 0.06), 0.7 * back + middle]]
    left = merge([stalk, loft(np.stack(rings))])
    return merge([left, mirrored(left)])
