"""A walled works yard around a crossroads: the smallest world that has some of everything.

The crossroads cuts the yard into four quarters: a small hall with containers, a car park, trees, and storage,
in an order that is drawn. A wall with gaps surrounds them; beyond it trees stand on open ground.
"""

import numpy as np
import shapely
from numpy.typing import NDArray
from shapely.geometry import LineString, Point, Polygon, box
from shapely.geometry.base import BaseGeometry

from echoscape.scenes.assets.buildings.building import building
from echoscape.scenes.core import portable_math
from echoscape.scenes.geometry.curves import headings, offset, points_at
from echoscape.scenes.roads.ground_mesh import Ground, polygons
from echoscape.scenes.roads.street_network import Network
from echoscape.scenes.town.gardens import add_boundary
from echoscape.scenes.town.open_spaces import PARK_TREES, lay_car_park, lay_yard, scatter_trees
from echoscape.scenes.town.parcels import CityBlock
from echoscape.scenes.town.placement import OccupiedArea, SceneBuilder, rectangle
from echoscape.scenes.town.roadside import scatter_trees as scatter_country_trees

_WALL_M = 12.0
"""Distance of the surrounding wall beyond the ends of the roads [m]."""
_VERGE_M = 3.0
"""Width of the strip beside the carriageway that stays free [m]."""
_HALL_M = (24.0, 14.0, 5.0)
"""Length, width and height of the walls of the hall [m]."""
_PLANTS = 45.0
_QUARTERS = 4


def dress_yard(
    builder: SceneBuilder,
    occupied: OccupiedArea,
    network: Network,
    ground: Ground,
    *,
    rng: np.random.Generator,
) -> None:
    """Add the wall, the four quarters, lamps and walls along the roads, and the trees beyond.

    Args:
        builder: The scene.
        occupied: Occupied ground, which is extended.
        network: The crossroads, see `scenes.roads.rural.crossroads`.
        ground: Plan of the ground.
        rng: Random generator.
    """
    site = box(*LineString(network.junctions).bounds).buffer(_WALL_M, join_style="mitre")
    whole = CityBlock(outline=site, occupied=occupied, base_m=0.0, inradius_m=0.0)
    _surround(builder, whole, ground, rng)
    lays = (_lay_hall, _lay_cars, _lay_trees, _lay_storage)
    for quarter, lay in zip(_quarters(site, network, ground), rng.permutation(_QUARTERS), strict=True):
        block = CityBlock(outline=quarter, occupied=occupied, base_m=0.0, inradius_m=0.0)
        lays[lay](builder, block, rng)
    for street in network.streets:
        for side in (-1.0, 1.0):
            line = offset(street.line, side * (street.type.half_width_m + 1.5))
            _line_road(builder, whole, line, ground, rng)
    occupied.add(site)
    scatter_country_trees(builder, occupied, ground, spacing_m=_PLANTS, clear_m=20.0, rng=rng)


def _quarters(site: Polygon, network: Network, ground: Ground) -> list[Polygon]:
    """Return the land between the roads, counter-clockwise from the one that lies ahead to the left."""
    middle = network.junctions[0]
    cuts = [
        LineString([middle, middle + 1.4 * (end - middle)]).buffer(_VERGE_M) for end in network.junctions[1:]
    ]
    roads = ground.carriageway.buffer(_VERGE_M)
    parts = polygons(site.buffer(-2.0).difference(shapely.union_all([roads, *cuts])))
    largest = sorted(parts, key=lambda part: -part.area)[:_QUARTERS]
    return sorted(largest, key=lambda part: _angle_rad(part, middle))


def _angle_rad(part: Polygon, middle: NDArray[np.float64]) -> float:
    x, y = np.array(part.centroid.coords[0]) - middle
    return float(portable_math.arctan2(y, x) % (2 * np.pi))


def _surround(builder: SceneBuilder, block: CityBlock, ground: Ground, rng: np.random.Generator) -> None:
    """Add a wall, on one side a fence, in runs with gaps."""
    corners = np.asarray(shapely.orient_polygons(block.outline).exterior.coords)
    fenced = int(rng.integers(_QUARTERS))
    for number in range(_QUARTERS):
        side = corners[number : number + 2]
        length, place = float(np.hypot(*(side[1] - side[0]))), rng.uniform(1.0, 6.0)
        while place < length - 6.0:
            stop = min(place + rng.uniform(25.0, 50.0), length - 1.0)
            line = LineString(points_at(side, np.array([place, stop])))
            if line.distance(ground.carriageway) > 1.0:
                kind = "chain_link" if number == fenced else "wall"
                add_boundary(builder, line, kind, block, rng=rng, height_m=2.6)
            place = stop + rng.uniform(3.0, 8.0)


def _line_road(
    builder: SceneBuilder,
    block: CityBlock,
    line: NDArray[np.float64],
    ground: Ground,
    rng: np.random.Generator,
) -> None:
    """Add a low wall, a lamp post and a few bollards beside a road."""
    heading = headings(line)
    for share, name in ((0.35, "lamp_arm"), (0.55, "bollard_metal"), (0.6, "bollard_metal")):
        at = int(share * (len(line) - 1))
        foot = Point(line[at])
        if foot.distance(ground.carriageway) > 0.8 and block.occupied.claim(foot.buffer(0.3)):
            builder.place(name, line[at], base_m=0.0, yaw_rad=float(heading[at]))
    first = float(rng.uniform(0.7, 0.8)) * len(line)
    run = LineString(line[int(first) : int(first + rng.uniform(0.1, 0.15) * len(line)) : 4])
    strip: BaseGeometry = run.buffer(0.3)
    if strip.distance(ground.carriageway) > 0.8 and block.occupied.is_free(strip):
        add_boundary(builder, run, "wall", block, rng=rng, height_m=1.1)


def _lay_hall(builder: SceneBuilder, block: CityBlock, rng: np.random.Generator) -> None:
    """Add a hall in the middle, and storage around it."""
    length, width, height = _HALL_M
    middle = np.array(block.outline.representative_point().coords[0])
    shape = rectangle(middle, float(rng.choice([0.0, np.pi / 2])) + rng.normal(0.0, 0.05), length, width)
    corners = np.asarray(shapely.orient_polygons(shape).exterior.coords)[:4]
    builder.add("building", building(corners, height_m=height, style="hall", rng=rng))
    block.occupied.add(shape.buffer(3.0))
    lay_yard(builder, block, rng=rng, density=0.4)


def _lay_cars(builder: SceneBuilder, block: CityBlock, rng: np.random.Generator) -> None:
    lay_car_park(builder, block, filled_share=0.4, rng=rng)


def _lay_trees(builder: SceneBuilder, block: CityBlock, rng: np.random.Generator) -> None:
    scatter_trees(builder, block, spacing_m=11.0, names=PARK_TREES, rng=rng)


def _lay_storage(builder: SceneBuilder, block: CityBlock, rng: np.random.Generator) -> None:
    lay_yard(builder, block, rng=rng)
