"""Vehicles as prototypes; the same shapes are parked at the kerb and driven in the lanes.

Sizes are those of common European models of each kind; bodies are made by `scenes.assets.vehicle_bodies`.
"""

from collections.abc import Iterable
from itertools import pairwise

import numpy as np

from echoscape.scenes.assets.people import cyclist_prototypes, pedestrian_prototypes
from echoscape.scenes.assets.vehicle_bodies import Hull, bevelled_box, hull_parts, mirrors, wheels
from echoscape.scenes.core.scene import Mesh, Prototype
from echoscape.scenes.geometry.meshes import merge, mesh, moved, prototype
from echoscape.scenes.geometry.primitives import box, tube

Parts = dict[str, Mesh]
_PLATE_BEND_RAD = 0.06
"""Slope of a number plate at its edges [rad]; calibrated."""
_CORNERS = ((-1, -1), (1, -1), (1, 1), (-1, 1))


def vehicle_prototypes() -> tuple[Prototype, ...]:
    """Make all cars, vans, trucks, buses, cyclists and pedestrians.

    Returns:
        The prototypes.
    """
    return (
        *car_prototypes(),
        *van_prototypes(),
        prototype("truck_box", "truck", _box_truck()),
        prototype("truck_flatbed", "truck", _flatbed_truck()),
        prototype("bus_city", "bus", _bus()),
        *cyclist_prototypes(),
        *pedestrian_prototypes(),
    )


def joined(groups: Iterable[Parts]) -> Parts:
    """Merge meshes by material.

    Args:
        groups: Meshes by name of the material, any number of times.

    Returns:
        One mesh per material.
    """
    together: dict[str, list[Mesh]] = {}
    for group in groups:
        for material, part in group.items():
            together.setdefault(material, []).append(part)
    return {material: merge(parts) for material, parts in together.items()}


def car_prototypes() -> tuple[Prototype, ...]:
    """Make a hatchback, a saloon, an estate and an SUV.

    Returns:
        The prototypes.
    """
    return (
        _car("car_hatchback", 4.05, 1.75, 1.46, cowl=1.05, front=1.85, rear=3.55, deck=3.93, tail=0.92),
        _car("car_saloon", 4.65, 1.82, 1.45, cowl=1.3, front=2.1, rear=3.2, deck=4.0, tail=1.02),
        _car("car_estate", 4.75, 1.82, 1.48, cowl=1.3, front=2.1, rear=4.3, deck=4.65, tail=0.95),
        _car("car_suv", 4.5, 1.88, 1.69, cowl=1.2, front=1.95, rear=3.95, deck=4.38, tail=1.08, wheel=0.36),
    )


def _car(
    name: str,
    length: float,
    width: float,
    height: float,
    *,
    cowl: float,
    front: float,
    rear: float,
    deck: float,
    tail: float,
    wheel: float = 0.315,
) -> Prototype:
    """Make a car; `cowl`, `front`, `rear`, `deck` are where the screens and the roof begin and end [m]."""
    low = 0.5 * wheel
    waist = 0.62 * height
    axles = (0.2 * length, 0.2 * length + 0.585 * length)
    pillar = 0.5 * (front + rear) + 0.05
    hull = Hull(
        length_m=length,
        width_m=width,
        floor=((0, low + 0.2), (0.06, low + 0.1), (0.3, low), (length - 0.3, low + 0.04),
               (length, low + 0.2)),
        belt=((0, 0.36 * height), (0.06, 0.46 * height), (0.25, 0.5 * height), (cowl, waist + 0.02),
              (deck, tail), (length - 0.05, tail - 0.05), (length, tail - 0.25)),
        roof=((0, 0), (cowl - 0.01, 0), (cowl, waist + 0.02), (front, height - 0.03),
              (0.5 * (front + rear), height), (rear, height - 0.05), (deck, tail), (length, 0)),
        plan=((0, 0.72), (0.06, 0.82), (0.3, 0.95), (0.4 * length, 1.0), (0.65 * length, 1.0),
              (length - 0.3, 0.95), (length - 0.05, 0.84), (length, 0.76)),
        roof_share=0.74,
        axles=axles,
        wheel_radius_m=wheel,
        wheel_width_m=0.21,
        windows=((front - 0.35, pillar - 0.05), (pillar + 0.05, rear)),
        screens=((cowl, front), (rear, deck)),
    )  # fmt: skip
    half = 0.5 * length
    middle = [half - x for x in axles]
    groups = [
        hull_parts(hull),
        wheels(middle, track_m=0.985 * width, radius_m=wheel, width_m=0.21),
        {"metal": mirrors(half - front + 0.45, 0.48 * width, waist + 0.06)},
        {"metal": _plates(half + 0.035, low + 0.3)},
        {"metal": box((middle[0] - middle[1], 0.5 * width, 0.06), (sum(middle) / 2, 0, low + 0.06))},
    ]
    return prototype(name, "car", joined(groups))


def _plates(x_m: float, z_m: float) -> Mesh:
    """Make number plates (0.52 m by 0.11 m) at x = +-`x_m`, embossed and bent by some degrees in mounting."""
    y, z = 0.26, 0.055
    front = np.array([(x_m, -y, z_m - z), (x_m, y, z_m - z), (x_m, y, z_m + z), (x_m, -y, z_m + z)])
    bent = np.array([(1.0, a * _PLATE_BEND_RAD, b * _PLATE_BEND_RAD) for a, b in _CORNERS])
    bent /= np.linalg.norm(bent, axis=1, keepdims=True)
    faces = np.array([[0, 1, 2], [0, 2, 3]])
    ahead = mesh(front, faces, bent[faces])
    return merge([ahead, moved(ahead, yaw_rad=np.pi)])


def van_prototypes() -> tuple[Prototype, ...]:
    """Make a small delivery van and a large panel van.

    Returns:
        The prototypes.
    """
    return (
        _van("van_small", 4.5, 1.85, 1.85, cowl=1.0, front=1.75, wheel=0.32),
        _van("van_panel", 5.9, 2.02, 2.6, cowl=0.85, front=1.75, wheel=0.35),
    )


def _van(
    name: str, length: float, width: float, height: float, *, cowl: float, front: float, wheel: float
) -> Prototype:
    """Make a van; `cowl` and `front` are where the windscreen begins and ends [m]."""
    low, waist = 0.55 * wheel, 1.08
    axles = (0.85, length - 1.1)
    hull = Hull(
        length_m=length,
        width_m=width,
        floor=((0, low + 0.2), (0.08, low + 0.08), (0.3, low), (length - 0.2, low + 0.08),
               (length, low + 0.2)),
        belt=((0, 0.62), (0.08, 0.72), (0.25, 0.82), (cowl, waist), (front, waist + 0.05),
              (length - 0.04, waist + 0.05), (length, waist)),
        roof=((0, 0), (cowl - 0.01, 0), (cowl, waist), (front, height - 0.1), (front + 0.5, height),
              (length - 0.1, height - 0.02), (length, height - 0.12)),
        plan=((0, 0.74), (0.08, 0.85), (0.35, 0.96), (1.2, 1.0), (length - 0.1, 1.0), (length, 0.95)),
        roof_share=0.86,
        axles=axles,
        wheel_radius_m=wheel,
        wheel_width_m=0.22,
        windows=((cowl + 0.4, front + 0.55),),
        screens=((cowl, front),),
    )  # fmt: skip
    half = 0.5 * length
    ribs = [
        box((0.05, 0.05, 0.75), (half - x, side * (0.49 * width), waist - 0.2))
        for x in np.arange(front + 0.9, length - 1.7, 1.1)
        for side in (-1, 1)
    ]
    doors = [box((0.03, 0.04, 1.2), (-half - 0.03, y, waist)) for y in (-0.03, 0.6, -0.6)]
    groups = [
        hull_parts(hull),
        wheels([half - x for x in axles], track_m=0.98 * width, radius_m=wheel, width_m=0.22),
        {
            "metal": merge(
                [mirrors(half - cowl - 0.5, 0.49 * width, waist + 0.12, height_m=0.26), *ribs, *doors]
            )
        },
        {"metal": _plates(half + 0.035, low + 0.3)},
    ]
    return prototype(name, "van", joined(groups))


def _cab(*, width_m: float, height_m: float, depth_m: float, front_x_m: float) -> Parts:
    """Make a cab-over-engine cab whose front is at `front_x_m`."""
    top = height_m
    hull = Hull(
        length_m=depth_m,
        width_m=width_m,
        floor=((0, 0.45), (0.1, 0.32), (depth_m, 0.45)),
        belt=((0, 1.25), (0.06, 1.45), (depth_m, 1.5)),
        roof=((0, 0), (0.02, 1.25), (0.1, 1.5), (0.35, top - 0.35), (0.6, top - 0.05), (depth_m, top)),
        plan=((0, 0.82), (0.06, 0.92), (0.25, 1.0), (depth_m, 1.0)),
        roof_share=0.88,
        axles=(0.95,),
        wheel_radius_m=0.48,
        wheel_width_m=0.3,
        windows=((0.45, depth_m - 0.5),),
        screens=((0.06, 0.35),),
    )
    shift = (front_x_m - 0.5 * depth_m, 0.0, 0.0)
    parts = {material: moved(part, shift) for material, part in hull_parts(hull).items()}
    steps = [
        box((0.45, 0.1, 0.05), (front_x_m - 1.75, side * 0.48 * width_m, z))
        for side in (-1, 1)
        for z in (0.45, 0.8)
    ]
    wing = moved(mirrors(0.0, 0.5 * width_m, 2.0, height_m=0.45), (front_x_m - 0.3, 0, 0))
    return joined([parts, {"metal": merge([wing, *steps])}])


def _chassis(front_x_m: float, rear_x_m: float, *, width_m: float, top_m: float = 1.0) -> Mesh:
    """Make two frame rails with cross members, side guards, a fuel tank and a rear underrun bar."""
    middle, length = 0.5 * (front_x_m + rear_x_m), front_x_m - rear_x_m
    rails = [box((length, 0.1, 0.25), (middle, side * 0.42, top_m - 0.14)) for side in (-1, 1)]
    cross = [
        box((0.12, 0.84, 0.2), (x, 0, top_m - 0.14)) for x in np.linspace(rear_x_m + 0.2, front_x_m - 0.2, 5)
    ]
    guards = [
        box((0.3 * length, 0.03, 0.1), (middle, side * 0.47 * width_m, z))
        for side in (-1, 1)
        for z in (0.5, 0.8)
    ]
    tank = tube((middle + 0.6, 0.75, 0.65), (middle - 0.6, 0.75, 0.65), 0.28, sides=10)
    bar = box((0.08, 0.9 * width_m, 0.12), (rear_x_m + 0.1, 0, 0.5))
    return merge([*rails, *cross, *guards, tank, bar])


def _box_truck() -> Parts:
    """Make a rigid truck with a box body, 8.2 m long."""
    half, width = 4.1, 2.5
    body = bevelled_box((6.0, width, 2.45), (half - 5.15, 0, 2.27), bevel_m=0.07)
    rear = -4.05
    bars = [tube((rear - 0.05, y, 1.15), (rear - 0.05, y, 3.4), 0.02) for y in (-0.7, -0.25, 0.25, 0.7)]
    seams = [
        box((0.06, 0.03, 2.3), (x, side * 0.5 * width, 2.27))
        for x in np.linspace(-3.7, 1.6, 7)
        for side in (-1, 1)
    ]
    lights = box((0.06, 2.2, 0.15), (rear, 0, 0.95))
    spoiler = bevelled_box((1.0, 2.1, 0.5), (half - 1.3, 0, 2.95), bevel_m=0.2)
    return joined(
        [
            _cab(width_m=2.4, height_m=2.8, depth_m=2.05, front_x_m=half),
            {
                "metal": merge(
                    [body, *bars, *seams, lights, spoiler, _chassis(half - 1.6, rear, width_m=width)]
                )
            },
            wheels([half - 0.95, -2.4], track_m=2.4, radius_m=0.48, width_m=0.3),
        ]
    )


def _flatbed_truck() -> Parts:
    """Make a tractor with a flatbed semi-trailer, headboard, stakes and a load of pipes."""
    half, width = 7.2, 2.5
    deck_front, deck_rear = half - 2.6, -half
    middle, length = 0.5 * (deck_front + deck_rear), deck_front - deck_rear
    deck = box((length, width, 0.12), (middle, 0, 1.26))
    sides = [box((length, 0.06, 0.22), (middle, side * 0.5 * width, 1.25)) for side in (-1, 1)]
    board = bevelled_box((0.12, width, 1.4), (deck_front - 0.06, 0, 2.0), bevel_m=0.04)
    stakes = [
        box((0.1, 0.07, 0.8), (x, side * 1.2, 1.7))
        for x in np.linspace(deck_rear + 0.6, deck_front - 1.2, 5)
        for side in (-1, 1)
    ]
    places = ((-0.75, 1.6), (0.0, 1.6), (0.75, 1.6), (-0.37, 2.2), (0.37, 2.2))
    pipes = [tube((deck_rear + 0.5, y, z), (deck_front - 1.5, y, z), 0.33, sides=10) for y, z in places]
    return joined(
        [
            _cab(width_m=2.45, height_m=3.2, depth_m=2.2, front_x_m=half),
            {
                "metal": merge(
                    [deck, *sides, board, *stakes, _chassis(half - 1.8, deck_rear, width_m=width, top_m=1.2)]
                )
            },
            {"concrete": merge(pipes)},
            wheels([half - 0.95, half - 3.9, -3.4, -4.75, -6.1], track_m=2.45, radius_m=0.48, width_m=0.3),
        ]
    )


def _bus() -> Parts:
    """Make an 11.8 m city bus with windows, doors and roof units."""
    length, width, height, waist = 11.8, 2.55, 3.05, 1.15
    half = 0.5 * length
    edges = np.linspace(0.95, length - 0.5, 8)
    windows = tuple((a + 0.06, b - 0.06) for a, b in pairwise(edges.tolist()))
    hull = Hull(
        length_m=length,
        width_m=width,
        floor=((0, 0.42), (0.1, 0.32), (length - 0.1, 0.34), (length, 0.45)),
        belt=((0, waist - 0.05), (0.08, waist), (length, waist)),
        roof=((0, waist + 0.05), (0.08, 1.35), (0.3, height - 0.3), (0.6, height - 0.06), (1.2, height),
              (length - 0.3, height), (length, height - 0.3)),
        plan=((0, 0.86), (0.08, 0.95), (0.3, 1.0), (length - 0.2, 1.0), (length, 0.9)),
        roof_share=0.94,
        axles=(2.7, 8.6),
        wheel_radius_m=0.48,
        wheel_width_m=0.3,
        windows=windows,
        screens=((0.08, 0.3),),
    )  # fmt: skip
    units = [bevelled_box((2.2, 1.7, 0.28), (x, 0, height + 0.12), bevel_m=0.08) for x in (2.0, -3.2)]
    doors = [
        box((0.06, 0.05, 1.9), (half - x, -0.495 * width, 1.4)) for x in (0.9, 1.5, 2.05, 5.2, 5.85, 6.5)
    ]
    trim = [box((length - 1.0, 0.04, 0.06), (0, side * 0.495 * width, 0.85)) for side in (-1, 1)]
    rear = [box((0.05, 1.8, 0.8), (-half - 0.02, 0, 1.0)), box((0.05, 1.9, 0.08), (-half - 0.02, 0, 2.2))]
    wing = mirrors(half - 0.1, 0.47 * width, 2.3, height_m=0.35)
    return joined(
        [
            hull_parts(hull),
            {"metal": merge([*units, *doors, *trim, *rear, wing])},
            wheels([half - 2.7, half - 8.6], track_m=0.98 * width, radius_m=0.48, width_m=0.3),
        ]
    )
