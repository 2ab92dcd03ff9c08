"""Street furniture as prototypes: lamps, signs, bollards, shelters, bins, barriers, containers, tanks.

Sizes follow common European street furniture. The arm of a lamp and the open side of a shelter point to +x,
which is to be turned towards the road.
"""

import numpy as np
from numpy.typing import NDArray

from echoscape.scenes.assets.vehicle_bodies import bevelled_box
from echoscape.scenes.core.scene import Mesh, Prototype
from echoscape.scenes.geometry.meshes import merge, moved, prototype
from echoscape.scenes.geometry.primitives import box, circle, cylinder, ellipsoid, loft, prism, tube
from echoscape.scenes.geometry.smooth_normals import smoothed

_STAND_UP = np.array([[0.0, 0.0, 1.0], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0]])  # z to x, x to y, y to z


def furniture_prototypes() -> tuple[Prototype, ...]:
    """Make all street furniture.

    Returns:
        The prototypes.
    """
    bench, frame = _bench()
    return (
        prototype("lamp_arm", "lamp_post", {"metal": _arm_lamp()}),
        prototype("lamp_lantern", "lamp_post", _lantern_lamp()),
        *_signs(),
        prototype("traffic_light", "sign", {"metal": _traffic_light()}),
        prototype("bollard_metal", "bollard", {"metal": _bollard()}),
        prototype(
            "bollard_concrete", "bollard", {"concrete": cylinder(0.19, 0.75, sides=10, top_radius_m=0.15)}
        ),
        prototype("bus_shelter", "bus_shelter", _bus_shelter()),
        prototype("bin_round", "bin", {"metal": _round_bin()}),
        prototype("bin_wheeled", "bin", _wheeled_bin()),
        prototype("bench", "bin", {"wood": bench, "metal": frame}),
        prototype("guard_rail", "barrier", {"metal": _guard_rail(4.0)}),
        prototype("barrier_concrete", "barrier", {"concrete": _concrete_barrier(3.0)}),
        prototype("container_20ft", "container", {"metal": _container(6.06)}),
        prototype("container_40ft", "container", {"metal": _container(12.19)}),
        prototype("tank_storage", "tank", {"metal": _storage_tank()}),
    )


def _arm_lamp() -> Mesh:
    """Make an 8 m tapered pole with a bent arm of 1.2 m and a flat luminaire at its end."""
    pole = cylinder(0.1, 7.6, sides=10, top_radius_m=0.05)
    arm = [
        tube((0, 0, 7.55), (0.4, 0, 7.9), 0.04, sides=8),
        tube((0.4, 0, 7.9), (1.2, 0, 8.0), 0.04, 0.03, sides=8),
    ]
    lantern = bevelled_box((0.6, 0.26, 0.12), (1.4, 0, 8.0), bevel_m=0.04)
    foot = cylinder(0.14, 1.0, sides=10)
    return merge([pole, foot, *arm, lantern])


def _lantern_lamp() -> dict[str, Mesh]:
    """Make a 4.5 m post with a glass lantern on top and a metal hood."""
    post = [cylinder(0.12, 0.9, sides=10, top_radius_m=0.08), cylinder(0.05, 3.9, sides=8, top_radius_m=0.04)]
    bars = [box((0.5, 0.03, 0.03), (0, 0, 3.3)), box((0.34, 0.34, 0.04), (0, 0, 3.9))]
    glass = moved(cylinder(0.15, 0.45, sides=6, top_radius_m=0.22), (0, 0, 3.92))
    hood = moved(cylinder(0.27, 0.22, sides=6, top_radius_m=0.04), (0, 0, 4.37))
    return {"metal": merge([*post, *bars, hood]), "glass": glass}


def _signs() -> tuple[Prototype, ...]:
    """Make round, triangular, rectangular and direction signs, their faces towards +x."""
    triangle = circle(0.4, 3) @ np.array([[0.0, 1.0], [-1.0, 0.0]])
    rectangle = np.array([[-0.3, -0.42], [0.3, -0.42], [0.3, 0.42], [-0.3, 0.42]])
    wide = np.array([[-1.1, -0.7], [1.1, -0.7], [1.1, 0.7], [-1.1, 0.7]])
    plates = {
        "sign_round": (_plate(circle(0.3, 12), 2.4), (0.0,), 2.7),
        "sign_triangle": (_plate(triangle, 2.3), (0.0,), 2.6),
        "sign_rectangle": (_plate(rectangle, 2.6), (0.0,), 2.95),
        "sign_direction": (_plate(wide, 2.9), (-0.7, 0.7), 3.5),
    }
    return tuple(
        prototype(name, "sign", {"metal": merge([plate, *(_sign_post(y, top) for y in places)])})
        for name, (plate, places, top) in plates.items()
    )


def _sign_post(y_m: float, top_m: float) -> Mesh:
    """Make a sign post."""
    return moved(cylinder(0.038, top_m, sides=8), (-0.05, y_m, 0))


def _plate(outline: NDArray[np.float64], height_m: float, thickness_m: float = 0.012) -> Mesh:
    """Make an upright plate with the outline (N, 2) in y and z about `height_m`, and two rails behind it."""
    plate = moved(prism(outline, bottom_m=0.0, top_m=thickness_m), (0, 0, height_m), rotation=_STAND_UP)
    span = 0.6 * float(np.ptp(outline[:, 0]))
    rails = [box((0.03, span, 0.04), (-0.015, 0, height_m + z)) for z in (-0.12, 0.12)]
    return merge([plate, *rails])


def _traffic_light() -> Mesh:
    """Make a signal post: three hooded lamps in front of a backing board, and a push-button box."""
    post = cylinder(0.057, 3.3, sides=10)
    board = box((0.02, 0.5, 1.15), (0.09, 0, 2.75))
    head = bevelled_box((0.2, 0.3, 0.95), (0.18, 0, 2.75), bevel_m=0.05)
    hoods = [tube((0.26, 0, z), (0.46, 0, z), 0.11, 0.12, sides=8) for z in (2.45, 2.75, 3.05)]
    button = bevelled_box((0.12, 0.12, 0.25), (0.09, 0, 1.1), bevel_m=0.02)
    return merge([post, board, head, *hoods, button])


def _bollard() -> Mesh:
    """Make a metal bollard with a collar and a domed head."""
    collar = moved(cylinder(0.085, 0.06, sides=10), (0, 0, 0.78))
    return merge(
        [
            cylinder(0.07, 0.95, sides=10),
            collar,
            ellipsoid((0.07, 0.07, 0.06), (0, 0, 0.95), sides=10, rows=4),
        ]
    )


def _bus_shelter() -> dict[str, Mesh]:
    """Make a shelter of 4.2 m by 1.6 m, open to +x: panes on three sides, a bench, a curved roof."""
    length, depth, height = 4.2, 1.6, 2.4
    y, back, front = 0.5 * length, -0.5 * depth, 0.5 * depth
    posts = [box((0.08, 0.08, height), (back, place, 0.5 * height)) for place in np.linspace(-y, y, 4)]
    posts += [box((0.08, 0.08, height), (0.35, side * y, 0.5 * height)) for side in (-1, 1)]
    rails = [box((0.05, length, 0.05), (back, 0, z)) for z in (0.3, 2.1)]
    rails += [box((1.15, 0.05, 0.05), (-0.22, side * y, z)) for side in (-1, 1) for z in (0.3, 2.1)]
    arch = [
        (front + 0.1, height),
        (front, height + 0.14),
        (0.0, height + 0.24),
        (back - 0.1, height + 0.14),
        (back - 0.1, height),
    ]
    rings = [[(x, place, z) for x, z in arch] for place in (y + 0.1, -y - 0.1)]
    bench = [box((0.32, 2.6, 0.05), (back + 0.3, 0, 0.5)), box((0.06, 0.06, 0.5), (back + 0.3, -1, 0.25)),
             box((0.06, 0.06, 0.5), (back + 0.3, 1, 0.25))]  # fmt: skip
    centres = np.linspace(-y, y, 4)[:-1] + length / 6
    panes = [box((0.012, length / 3 - 0.12, 1.76), (back, place, 1.2)) for place in centres]
    panes += [box((1.02, 0.012, 1.76), (-0.22, side * y, 1.2)) for side in (-1, 1)]
    roof = smoothed(loft(rings), crease_rad=np.radians(40.0))
    return {"metal": merge([*posts, *rails, roof, *bench]), "glass": merge(panes)}


def _round_bin() -> Mesh:
    """Make a litter bin with a rim and a domed lid."""
    rim = moved(cylinder(0.29, 0.05, sides=10), (0, 0, 0.85))
    lid = moved(cylinder(0.27, 0.18, sides=10, top_radius_m=0.1), (0, 0, 0.98))
    stays = [tube((x, 0, 0.85), (x, 0, 1.0), 0.015, sides=4) for x in (-0.24, 0.24)]
    return merge([cylinder(0.23, 0.9, sides=10, top_radius_m=0.27), rim, lid, *stays])


def _wheeled_bin() -> dict[str, Mesh]:
    """Make a 240 l bin on wheels; wood stands in for its plastic, as the nearest permittivity."""
    low = np.array([[-0.26, -0.23], [0.24, -0.23], [0.24, 0.23], [-0.26, 0.23]])
    levels = ((0.05, 1.0), (0.95, 1.22), (0.97, 1.32), (1.02, 1.32), (1.07, 1.1))
    body = loft(np.stack([np.c_[low * share, np.full(4, z)] for z, share in levels]))
    handle = tube((-0.38, -0.2, 0.98), (-0.38, 0.2, 0.98), 0.018)
    tyres = [tube((-0.28, side * 0.24, 0.1), (-0.28, side * 0.3, 0.1), 0.1, sides=10) for side in (-1, 1)]
    return {"wood": merge([body, handle]), "rubber": merge(tyres)}


def _bench() -> tuple[Mesh, Mesh]:
    """Make the slats and the cast frame of a bench that faces +x."""
    slats = [box((0.09, 1.7, 0.035), (x, 0, 0.45)) for x in (-0.17, -0.05, 0.07, 0.19)]
    slats += [box((0.035, 1.7, 0.09), (-0.26 - 0.06 * i, 0, 0.58 + 0.14 * i)) for i in range(3)]
    legs = []
    for y in (-0.75, 0.0, 0.75):
        legs += [box((0.05, 0.05, 0.43), (0.18, y, 0.215)), box((0.05, 0.05, 0.43), (-0.2, y, 0.215)),
                 box((0.46, 0.05, 0.04), (0, y, 0.41)),
                 tube((-0.22, y, 0.42), (-0.43, y, 0.92), 0.025, sides=4)]  # fmt: skip
    return merge(slats), merge(legs)


def _guard_rail(length_m: float) -> Mesh:
    """Make a W-beam of `length_m` along x, its waves to -y, on posts 2 m apart."""
    wave = [(0.0, 0.44), (-0.02, 0.46), (-0.083, 0.5), (-0.083, 0.53), (0.0, 0.585), (0.0, 0.615),
            (-0.083, 0.67), (-0.083, 0.7), (-0.02, 0.74), (0.0, 0.76)]  # fmt: skip
    outline = np.array(wave + [(y + 0.004, z) for y, z in wave[::-1]])
    beam = prism(outline[::-1], bottom_m=-0.5 * length_m, top_m=0.5 * length_m)
    beam = smoothed(beam, crease_rad=np.radians(65.0))
    places = np.arange(-0.5 * length_m + 1.0, 0.5 * length_m, 2.0)
    posts = [box((0.06, 0.1, 0.72), (x, 0.16, 0.36)) for x in places]
    blocks = [box((0.1, 0.12, 0.2), (x, 0.06, 0.6)) for x in places]
    return merge([moved(beam, rotation=_STAND_UP), *posts, *blocks])


def _concrete_barrier(length_m: float) -> Mesh:
    """Make a New Jersey barrier, 0.81 m high, along x."""
    half = [(0.3, 0.0), (0.3, 0.08), (0.18, 0.33), (0.08, 0.81)]
    outline = np.array(half + [(-y, z) for y, z in half[::-1]])
    return moved(prism(outline, bottom_m=-0.5 * length_m, top_m=0.5 * length_m), rotation=_STAND_UP)


def _container(length_m: float) -> Mesh:
    """Make an ISO container along x: sides corrugated 36 mm deep, frame, doors with locking bars."""
    width, height, deep = 2.44, 2.59, 0.036
    pitch = (length_m - 0.3) / round((length_m - 0.3) / 0.42)
    start = np.arange(-0.5 * length_m + 0.15, 0.5 * length_m - 0.15 - 1e-6, pitch)
    along = (start[:, None] + pitch * np.array([0.0, 0.25, 0.5, 0.75])).ravel()
    into = np.tile([0.0, 0.0, deep, deep], len(start))
    side = 0.5 * width - 0.03 - into
    outline = np.concatenate([np.c_[along, -side], np.c_[along[::-1], side[::-1]]])
    rings = np.stack([np.c_[outline, np.full(len(outline), z)] for z in (0.16, height - 0.1)])
    x, y = 0.5 * length_m - 0.08, 0.5 * width - 0.08
    posts = [box((0.16, 0.16, height), (a * x, b * y, 0.5 * height)) for a in (-1, 1) for b in (-1, 1)]
    beams = [
        box((length_m, 0.1, 0.16), (0, b * (y + 0.03), z)) for b in (-1, 1) for z in (0.08, height - 0.08)
    ]
    sills = [box((0.14, width, 0.16), (a * (x + 0.01), 0, z)) for a in (-1, 1) for z in (0.08, height - 0.08)]
    roof = box((length_m - 0.1, width - 0.1, 0.04), (0, 0, height - 0.07))
    bars = [
        tube((-0.5 * length_m, b, 0.2), (-0.5 * length_m, b, height - 0.2), 0.02, sides=5)
        for b in (-0.85, -0.3, 0.3, 0.85)
    ]
    ends = [box((0.05, width - 0.2, height - 0.2), (a * (x - 0.0), 0, 0.5 * height)) for a in (-1, 1)]
    return merge([loft(rings, caps=False), *posts, *beams, *sills, roof, *bars, *ends])


def _storage_tank() -> Mesh:
    """Make an upright tank of 6 m diameter and 6 m height with rings, a shallow roof and a ladder."""
    shell = cylinder(3.0, 6.0, sides=24)
    rings = [moved(cylinder(3.05, 0.08, sides=24), (0, 0, z)) for z in (1.9, 3.9, 5.9)]
    roof = moved(cylinder(3.0, 0.6, sides=24, top_radius_m=0.3), (0, 0, 6.0))
    hatch = moved(cylinder(0.3, 0.35, sides=8), (0, 0, 6.55))
    ladder = [box((0.05, 0.05, 6.6), (3.2, y, 3.4)) for y in (-0.22, 0.22)]
    ladder += [box((0.03, 0.44, 0.03), (3.2, 0, z)) for z in np.arange(0.4, 6.6, 0.4)]
    pipe = [
        tube((3.0, 1.2, 0.6), (3.5, 1.2, 0.6), 0.1, sides=8),
        tube((3.5, 1.2, 0.0), (3.5, 1.2, 0.7), 0.1, sides=8),
    ]
    return merge([shell, *rings, roof, hatch, *ladder, *pipe])
