"""Pedestrians and cyclists in a few poses: limbs, torso and head as tapered tubes and ellipsoids."""

from collections.abc import Sequence

import numpy as np

from echoscape.scenes.core.scene import Mesh, Prototype
from echoscape.scenes.geometry.meshes import merge, moved, prototype
from echoscape.scenes.geometry.primitives import circle, ellipsoid, loft, tube
from echoscape.scenes.geometry.smooth_normals import ring_normals

Point = tuple[float, float, float]


def pedestrian_prototypes() -> tuple[Prototype, ...]:
    """Make a walking adult, a standing adult with a bag, and a child.

    Returns:
        The prototypes.
    """
    adult = _walker(stride_m=0.34, size=1.0)
    standing = merge([_walker(stride_m=0.04, size=1.03), ellipsoid((0.13, 0.17, 0.24), (-0.2, 0, 1.28))])
    child = _walker(stride_m=0.25, size=0.72)
    return (
        prototype("pedestrian_walking", "pedestrian", {"person": adult}),
        prototype("pedestrian_standing", "pedestrian", {"person": standing}),
        prototype("pedestrian_child", "pedestrian", {"person": child}),
    )


def cyclist_prototypes() -> tuple[Prototype, ...]:
    """Make an upright and a stooped rider, each on a bicycle.

    Returns:
        The prototypes.
    """
    return (
        prototype("cyclist_upright", "cyclist", {**_bicycle(), "person": _rider(lean_m=0.15)}),
        prototype("cyclist_racer", "cyclist", {**_bicycle(), "person": _rider(lean_m=0.42)}),
    )


def _limb(joints: Sequence[Point], radii_m: Sequence[float], size: float = 1.0) -> Mesh:
    """Make tapered tubes along `joints` with the radius `radii_m` at each joint."""
    points = size * np.array(joints)
    bones = [
        tube(a, b, size * ra, size * rb, sides=6)
        for a, b, ra, rb in zip(points[:-1], points[1:], radii_m[:-1], radii_m[1:], strict=True)
    ]
    return merge(bones)


def _torso(hips: Point, shoulders: Point, size: float = 1.0) -> Mesh:
    """Make a torso between the middles of hips and shoulders, wider than deep."""
    low, high = size * np.array(hips), size * np.array(shoulders)
    axis = (high - low) / np.linalg.norm(high - low)
    forward = np.array([axis[2], 0.0, -axis[0]])
    rings = []
    for share, deep, wide in (
        (-0.12, 0.07, 0.1),
        (0.05, 0.11, 0.17),
        (0.4, 0.1, 0.15),
        (0.85, 0.12, 0.2),
        (1.05, 0.07, 0.13),
    ):
        ring = circle(size, 8) * [deep, wide]
        rings.append(low + share * (high - low) + ring[:, :1] * forward + ring[:, 1:] * [0.0, 1.0, 0.0])
    return loft(np.stack(rings), normals=ring_normals(np.stack(rings)))


def _walker(*, stride_m: float, size: float) -> Mesh:
    """Make a person of height 1.75 m times `size`, facing x, with `stride_m` from the hips to each heel."""
    s = stride_m
    legs = [
        _limb([(0, y, 0.92), (0.45 * d + 0.06, y, 0.5), (d, y, 0.07)], [0.085, 0.06, 0.042], size)
        for y, d in ((0.1, s), (-0.1, -s))
    ]
    sole = (size * 0.14, size * 0.05, size * 0.05)
    feet = [
        ellipsoid(sole, (size * (d + 0.06), size * y, size * 0.05), rows=4) for y, d in ((0.1, s), (-0.1, -s))
    ]
    arms = [
        _limb(
            [(0, y, 1.42), (0.3 * d, 1.25 * y, 1.15), (0.6 * d + 0.12, 1.2 * y, 0.95)],
            [0.055, 0.042, 0.035],
            size,
        )
        for y, d in ((0.21, -s), (-0.21, s))
    ]
    trunk = _torso((0, 0, 0.93), (0.02, 0, 1.45), size)
    return merge([*legs, *feet, *arms, trunk, _head((0.03, 0, 1.63), size)])


def _head(middle: Point, size: float = 1.0) -> Mesh:
    """Make a head and neck."""
    x, y, z = (size * value for value in middle)
    neck = tube((x - 0.02, y, z - 0.2 * size), (x, y, z - 0.06 * size), size * 0.055)
    return merge([neck, ellipsoid((size * 0.1, size * 0.08, size * 0.12), (x, y, z))])


def _rider(*, lean_m: float) -> Mesh:
    """Make a rider on the saddle at x = -0.2, z = 0.95, whose shoulders are `lean_m` ahead of it."""
    shoulder = -0.2 + lean_m
    high = 0.97 + float(np.sqrt(0.55**2 - lean_m**2))
    legs = [
        _limb([(-0.2, y, 0.95), (0.2, y, pedal + 0.42), (0.02, y, pedal)], [0.09, 0.06, 0.045])
        for y, pedal in ((0.11, 0.2), (-0.11, 0.46))
    ]
    feet = [ellipsoid((0.13, 0.045, 0.045), (0.06, y, pedal - 0.03), sides=6, rows=4)
            for y, pedal in ((0.11, 0.2), (-0.11, 0.46))]  # fmt: skip
    elbow = 0.5 * (shoulder + 0.4), 0.5 * (high + 1.0) - 0.08
    arms = [
        _limb(
            [(shoulder, y, high - 0.04), (elbow[0], 1.2 * y, elbow[1]), (0.42, y, 1.02)],
            [0.055, 0.042, 0.035],
        )
        for y in (0.21, -0.21)
    ]
    trunk = _torso((-0.2, 0, 0.97), (shoulder, 0, high))
    return merge([*legs, *feet, *arms, trunk, _head((shoulder + 0.08, 0, high + 0.18))])


def _bicycle() -> dict[str, Mesh]:
    """Make tyres of rubber, rims, spokes and frame of metal, and fittings; the wheels measure 0.68 m.

    Fittings are hubs, chain, lamps, a wire basket in front and a loaded carrier behind.
    """
    radius, front, back = 0.34, 0.52, -0.52
    tyres = [moved(_ring(radius - 0.02, 0.02), (x, 0, radius)) for x in (front, back)]
    rims = [moved(_ring(radius - 0.05, 0.012), (x, 0, radius)) for x in (front, back)]
    turns = np.arange(6) * np.pi / 3
    spokes = [
        tube((x, 0, radius), (x + 0.29 * np.cos(a), 0, radius + 0.29 * np.sin(a)), 0.006, sides=3)
        for x in (front, back)
        for a in turns
    ]
    crank, saddle, neck = (-0.08, 0, 0.3), (-0.2, 0, 0.9), (0.36, 0, 0.85)
    bars = [
        (crank, saddle), (crank, neck), ((-0.17, 0, 0.78), neck), (crank, (back, 0, radius)),
        ((-0.17, 0, 0.78), (back, 0, radius)), ((front, 0, radius), (0.33, 0, 1.0)),
        ((0.38, -0.27, 1.0), (0.38, 0.27, 1.0)), ((-0.08, -0.13, 0.2), (-0.08, 0.13, 0.45)),
    ]  # fmt: skip
    frame = [tube(a, b, 0.017, sides=6) for a, b in bars]
    seat = ellipsoid((0.13, 0.07, 0.03), (-0.2, 0, 0.91), sides=6, rows=4)
    hubs = [ellipsoid((0.05, 0.06, 0.05), (x, 0, radius)) for x in (front, back)]
    chain = ellipsoid((0.1, 0.02, 0.1), crank)
    lamps = [ellipsoid((0.04, 0.04, 0.04), place) for place in ((0.45, 0, 0.8), (-0.55, 0, 0.72))]
    basket = tube((0.5, 0, 0.78), (0.5, 0, 1.03), 0.13, 0.18, sides=8)
    carrier = ellipsoid((0.2, 0.19, 0.14), (-0.5, 0, 0.68))
    fittings = merge([*hubs, chain, *lamps, basket, carrier])
    return {
        "rubber": merge([*tyres, seat]),
        "metal": merge([*rims, *spokes, *frame]),
        "fittings": fittings,
    }


def _ring(radius_m: float, thickness_m: float, *, sides: int = 12) -> Mesh:
    """Make an upright hoop about the origin in the x-z plane, its lowest point a vertex."""
    across = circle(thickness_m, 4)
    section = np.concatenate([across, across[:1]])
    points = -circle(1.0, sides)
    rings = [
        np.stack([(radius_m + r) * points[:, 1], np.full(sides, y), (radius_m + r) * points[:, 0]], axis=1)
        for r, y in section
    ]
    return loft(np.stack(rings), caps=False)
