"""Blocks without rows of buildings: parks, squares, car parks and industrial yards."""

import numpy as np
import shapely
from numpy.typing import NDArray
from shapely.geometry import LineString, Point, Polygon

from echoscape.scenes.core import portable_math
from echoscape.scenes.geometry.curves import Line, arc_length, headings, points_at, resampled
from echoscape.scenes.town.gardens import add_boundary, park_vehicle
from echoscape.scenes.town.parcels import CityBlock
from echoscape.scenes.town.placement import SceneBuilder, rectangle
from echoscape.scenes.town.presets import Use

CARS: tuple[str, ...] = ("car_hatchback", "car_saloon", "car_estate", "car_suv", "van_small")
_MOST_CARS = 35
PARK_TREES: tuple[str, ...] = ("tree_broadleaf", "tree_tall", "tree_spreading", "tree_conifer", "tree_shrub")


def lay_open_space(
    builder: SceneBuilder, block: CityBlock, use: Use, *, parked: float, rng: np.random.Generator
) -> bool:
    """Fill a block whose use needs no rows of buildings.

    Args:
        builder: The scene.
        block: The city block.
        use: Its use.
        parked: Share of parking spaces along streets that is taken; car parks have 80 % of it [0 to 1].
        rng: Random generator.

    Returns:
        Whether the use is such a one.
    """
    if use == "park":
        lay_park(builder, block, rng=rng)
    elif use == "square":
        lay_square(builder, block, rng=rng)
    elif use == "car_park":
        lay_car_park(builder, block, filled_share=0.8 * parked, rng=rng)
    elif use == "yard":
        lay_yard(builder, block, rng=rng)
    else:
        return False
    return True


def lay_park(builder: SceneBuilder, block: CityBlock, *, rng: np.random.Generator) -> None:
    """Add trees, benches, and a railing or hedge with gates around a park.

    Args:
        builder: The scene.
        block: The city block.
        rng: Random generator.
    """
    kind = str(rng.choice(["railing", "hedge"]))
    for rim in _rims(block.outline, 0.8):
        place, length = 0.0, arc_length(rim)[-1]
        while place < length - 6.0:
            stop = min(place + rng.uniform(25.0, 50.0), length - 2.0)
            line = LineString(points_at(rim, np.linspace(place, stop, 8)))
            add_boundary(builder, line, kind, block, rng=rng, height_m=1.2)
            place = stop + rng.uniform(2.0, 4.0)
    scatter_trees(builder, block, spacing_m=15.0, names=PARK_TREES, rng=rng)
    _furnish(builder, block, inset_m=5.0, spacing_m=40.0, names=("bench", "bin_round"), rng=rng)


def lay_square(builder: SceneBuilder, block: CityBlock, *, rng: np.random.Generator) -> None:
    """Add bollards and trees along the edge of a square, and benches and lamps inside.

    Args:
        builder: The scene.
        block: The city block.
        rng: Random generator.
    """
    _furnish(builder, block, inset_m=0.8, spacing_m=3.2, names=("bollard_metal",), rng=rng)
    _furnish(builder, block, inset_m=4.5, spacing_m=9.0, names=("tree_broadleaf", "tree_street"), rng=rng)
    _furnish(
        builder, block, inset_m=8.0, spacing_m=14.0, names=("bench", "lamp_lantern", "bin_round"), rng=rng
    )


def lay_car_park(
    builder: SceneBuilder,
    block: CityBlock,
    *,
    filled_share: float,
    rng: np.random.Generator,
    inset_m: float = 3.0,
) -> None:
    """Park cars in rows across the longer side of a block's interior.

    Args:
        builder: The scene.
        block: The city block.
        filled_share: Share of the parking spaces that are taken.
        rng: Random generator.
        inset_m: Distance from the edge of the block [m].
    """
    inside = block.outline.buffer(-inset_m)
    if inside.is_empty:
        return
    origin, along, across, size = _frame(inside)
    filled_share = min(filled_share, _MOST_CARS * 20.0 / inside.area)  # a car and its aisle need some 20 m2
    for row, y in enumerate(np.arange(4.0, size[1] - 3.0, 8.2)):
        for x in np.arange(3.0, size[0] - 3.0, 2.6):
            place = origin + x * along + y * across
            if rng.random() < filled_share and inside.contains(Point(place).buffer(2.6)):
                yaw = float(portable_math.arctan2(across[1], across[0])) + np.pi * (rng.random() < 0.5)
                park_vehicle(builder, str(rng.choice(CARS)), place, block, yaw_rad=yaw)
            foot = place + 4.1 * across
            if row % 2 == 0 and rng.random() < 0.02 and inside.contains(Point(foot)):
                _stand(builder, block, "lamp_arm", foot, rng)


def lay_yard(
    builder: SceneBuilder, block: CityBlock, *, rng: np.random.Generator, density: float = 1.0
) -> None:
    """Fill free ground with containers, some stacked, tanks and parked trucks.

    Args:
        builder: The scene.
        block: The city block.
        rng: Random generator.
        density: Density relative to that of an industrial yard.
    """
    inside = block.outline.buffer(-4.0)
    if inside.is_empty:
        return
    origin, along, across, size = _frame(inside)
    yaw = float(portable_math.arctan2(along[1], along[0]))
    names = (
        "container_20ft",
        "container_40ft",
        "container_40ft",
        "tank_storage",
        "truck_box",
        "truck_flatbed",
    )
    for y in np.arange(4.0, size[1], 9.0):
        for x in np.arange(8.0, size[0], 15.0):
            place = origin + x * along + y * across + rng.uniform(-0.5, 0.5, 2)
            name = str(rng.choice(names, p=[0.28, 0.22, 0.16, 0.08, 0.14, 0.12]))
            length, width, height = builder[name].extent_m
            shape = rectangle(place, yaw, length + 1.0, width + 0.6)
            if rng.random() < 0.3 * density and inside.contains(shape) and block.occupied.claim(shape):
                builder.place(name, place, base_m=block.base_m, yaw_rad=yaw)
                if name.startswith("container") and rng.random() < 0.4:
                    builder.place(name, place, base_m=block.base_m + height, yaw_rad=yaw)


def scatter_trees(
    builder: SceneBuilder,
    block: CityBlock,
    *,
    spacing_m: float,
    names: tuple[str, ...],
    rng: np.random.Generator,
    inset_m: float = 5.0,
) -> None:
    """Plant trees at random, no two nearer than a third of their spacing.

    Args:
        builder: The scene.
        block: The city block.
        spacing_m: Side of the square that has about one tree [m].
        names: Names of the prototypes.
        rng: Random generator.
        inset_m: Distance from the edge of the block [m].
    """
    inside = block.outline.buffer(-inset_m)
    if inside.is_empty:
        return
    low, high = np.array(inside.bounds[:2]), np.array(inside.bounds[2:])
    places = low + rng.uniform(0, 1, (int(np.prod(high - low) / spacing_m**2), 2)) * (high - low)
    for place in places[shapely.contains_xy(inside, places)]:
        if block.occupied.claim(Point(place).buffer(spacing_m / 6)):
            scale, yaw = rng.uniform(0.75, 1.3), rng.uniform(0, 2 * np.pi)
            builder.place(str(rng.choice(names)), place, base_m=block.base_m, yaw_rad=yaw, scale=scale)


def _furnish(
    builder: SceneBuilder,
    block: CityBlock,
    *,
    inset_m: float,
    spacing_m: float,
    names: tuple[str, ...],
    rng: np.random.Generator,
) -> None:
    """Place prototypes in turn on a line around the block, facing its middle."""
    for rim in _rims(block.outline, inset_m):
        yaw = headings(rim) + np.pi / 2
        along = arc_length(rim)
        for number, distance in enumerate(np.arange(spacing_m / 2, along[-1], spacing_m)):
            place = points_at(rim, np.array([distance]))[0]
            name = names[number % len(names)]
            _stand(builder, block, name, place, rng, yaw_rad=float(np.interp(distance, along, yaw)))


def _stand(
    builder: SceneBuilder,
    block: CityBlock,
    name: str,
    place: NDArray[np.float64],
    rng: np.random.Generator,
    *,
    yaw_rad: float | None = None,
) -> None:
    """Place a prototype if the ground is free."""
    yaw = float(rng.uniform(0, 2 * np.pi)) if yaw_rad is None else yaw_rad
    if block.occupied.claim(Point(place).buffer(0.6)):
        builder.place(name, place, base_m=block.base_m, yaw_rad=yaw)


def _rims(block: Polygon, inset_m: float) -> list[Line]:
    """Return the lines at a distance inside the edge of a block."""
    parts = shapely.get_parts(block.buffer(-inset_m))
    turned = [shapely.orient_polygons(part) for part in parts if isinstance(part, Polygon) and part.area > 30]
    return [resampled(np.asarray(part.exterior.coords)[:, :2], 1.0) for part in turned]


def _frame(
    shape: shapely.Geometry,
) -> tuple[NDArray[np.float64], NDArray[np.float64], NDArray[np.float64], tuple[float, float]]:
    """Return corner, long axis, short axis and (length, width) of the minimum rectangle around a shape."""
    box = shapely.orient_polygons(shapely.minimum_rotated_rectangle(shape))
    corners = shapely.get_coordinates(box)[:4]
    first, second = corners[1] - corners[0], corners[3] - corners[0]
    if np.linalg.norm(first) < np.linalg.norm(second):
        corners = np.roll(corners, -1, axis=0)
        first, second = corners[1] - corners[0], corners[3] - corners[0]
    size = float(np.linalg.norm(first)), float(np.linalg.norm(second))
    return corners[0], first / size[0], second / size[1], size
