"""Roadside outside towns: guard rails, noise walls, gantries, bridges, hedges, farms.

Rails stand at least 0.5 m beyond the edge of the carriageway; bridges clear it by 5.6 m.
"""

import numpy as np
import shapely
from shapely.geometry import LineString, Point

from echoscape.scenes.assets.buildings.building import Style, building
from echoscape.scenes.assets.vegetation import hedge
from echoscape.scenes.assets.walls_fences import wall
from echoscape.scenes.core.scene import Mesh
from echoscape.scenes.geometry.curves import (
    Line,
    arc_length,
    headings,
    left_normals,
    offset,
    points_at,
    resampled,
)
from echoscape.scenes.geometry.meshes import merge, moved
from echoscape.scenes.geometry.primitives import box, cylinder
from echoscape.scenes.roads.ground_mesh import Ground
from echoscape.scenes.roads.motorway import EDGE_M, Motorway
from echoscape.scenes.roads.street_network import Network
from echoscape.scenes.town.open_spaces import PARK_TREES
from echoscape.scenes.town.placement import OccupiedArea, SceneBuilder, rectangle


def dress_motorway(
    builder: SceneBuilder, occupied: OccupiedArea, motorway: Motorway, *, rng: np.random.Generator
) -> None:
    """Add rails, noise walls, gantries, bridges, lamps and trees along a motorway.

    Args:
        builder: The scene.
        occupied: Occupied ground, which is extended.
        motorway: The motorway.
        rng: Random generator.
    """
    length = float(arc_length(motorway.middle)[-1])
    for share in (0.1, 0.9):  # where no slip road runs beside the main line
        _bridge(builder, occupied, motorway.middle, share * length)
    for share in (0.2, 0.47, 0.62, 0.8):
        _gantry(builder, motorway, (share + rng.uniform(-0.02, 0.02)) * length)
    for aside in (-0.9, 0.9):
        _rails(builder, motorway.middle, motorway.ground, aside, inside=True)
    for aside in (-EDGE_M - 0.7, EDGE_M + 0.7):
        _rails(builder, motorway.middle, motorway.ground, aside, inside=False)
    for lane in motorway.roads.lanes:
        if lane.kind == "street" and lane.speed_limit_mps < 20:
            _rails(builder, lane.centre, motorway.ground, -3.6, inside=False)
    for side in (-1.0, 1.0):
        _noise_walls(builder, occupied, motorway, side)
    _lamps(builder, motorway, rng)
    scatter_trees(builder, occupied, motorway.ground, spacing_m=34.0, clear_m=7.0, rng=rng)


def dress_country_roads(
    builder: SceneBuilder,
    occupied: OccupiedArea,
    network: Network,
    ground: Ground,
    *,
    rng: np.random.Generator,
) -> None:
    """Add hedges, posts, trees and farms along country roads.

    Args:
        builder: The scene.
        occupied: Occupied ground, which is extended.
        network: The roads.
        ground: Plan of the ground.
        rng: Random generator.
    """
    ends = [j for j in range(len(network.junctions)) if len(network.arms(j)) == 1]
    for junction in ends[-2:]:
        _farm(builder, occupied, ground, network.junctions[junction], rng)
    for street in network.streets:
        for side in (-1.0, 1.0):
            line = offset(street.line, side * (street.type.half_width_m + 3.2))
            _hedges(builder, occupied, ground, line, rng)
            _posts(builder, occupied, street.line, side * (street.type.half_width_m + 1.2), ground, rng)
    scatter_trees(builder, occupied, ground, spacing_m=62.0, clear_m=8.0, rng=rng)


def scatter_trees(
    builder: SceneBuilder,
    occupied: OccupiedArea,
    ground: Ground,
    *,
    spacing_m: float,
    clear_m: float,
    rng: np.random.Generator,
) -> None:
    """Plant a tree at a random place in each square of the land.

    Args:
        builder: The scene.
        occupied: Occupied ground, which is extended.
        ground: Plan of the ground.
        spacing_m: Side of the squares [m].
        clear_m: Least distance from the carriageway [m].
        rng: Random generator.
    """
    x0, y0, x1, y1 = ground.land.bounds
    axes = np.arange(x0, x1, spacing_m), np.arange(y0, y1, spacing_m)
    corners = np.stack(np.meshgrid(*axes), axis=-1).reshape(-1, 2)
    places = rng.permutation(corners + rng.uniform(0, spacing_m, corners.shape))
    shape = ground.land.buffer(-6.0).difference(ground.carriageway.buffer(clear_m))
    for place in places[shapely.contains_xy(shape, places)]:
        if occupied.claim(Point(place).buffer(2.0)):
            scale, yaw = rng.uniform(0.75, 1.35), rng.uniform(0, 2 * np.pi)
            builder.place(str(rng.choice(PARK_TREES)), place, base_m=0.0, yaw_rad=yaw, scale=scale)


def _rails(builder: SceneBuilder, line: Line, ground: Ground, aside_m: float, *, inside: bool) -> None:
    """Add guard rails end to end, `aside_m` to the left of a line; unless `inside`, off the carriageway."""
    run = resampled(offset(line, aside_m), 1.0)
    along, heading = arc_length(run), headings(run)
    for distance in np.arange(3.0, along[-1] - 3.0, 4.0):
        place = points_at(run, np.array([distance]))[0]
        yaw = float(np.interp(distance, along, heading))
        shape = rectangle(place, yaw, 4.6, 1.0)
        if inside or not shape.intersects(ground.carriageway):
            builder.place("guard_rail", place, base_m=0.0, yaw_rad=yaw + np.pi * (aside_m < 0))


def _noise_walls(builder: SceneBuilder, occupied: OccupiedArea, motorway: Motorway, side: float) -> None:
    """Add noise walls along one side of a motorway."""
    length = float(arc_length(motorway.middle)[-1])
    line = offset(motorway.middle, side * 21.0)
    for start in (0.16 * length, 0.76 * length):
        for step in range(5):
            first = start + 40.0 * step
            points = points_at(line, np.linspace(first, first + 40.0, 9))
            strip = LineString(points).buffer(0.5)
            if strip.distance(motorway.ground.carriageway) > 2.0 and occupied.claim(strip.buffer(-0.3)):
                mesh = wall(points, height_m=float(3.0 + 0.5 * (side > 0)), thickness_m=0.25)
                builder.add("wall", {"concrete": mesh})


def _lamps(builder: SceneBuilder, motorway: Motorway, rng: np.random.Generator) -> None:
    """Add lamp posts and direction signs behind the outer rails."""
    along, normal, heading = (
        arc_length(motorway.middle),
        left_normals(motorway.middle),
        headings(motorway.middle),
    )
    for number, distance in enumerate(np.arange(60.0, along[-1] - 40.0, 45.0)):
        side = 1.0 if number % 2 else -1.0
        left = np.array([np.interp(distance, along, normal[:, axis]) for axis in range(2)])
        place = points_at(motorway.middle, np.array([distance]))[0] + side * (EDGE_M + 2.0) * left
        if Point(place).distance(motorway.ground.carriageway) > 1.5:
            name = "sign_direction" if rng.random() < 0.15 else "lamp_arm"
            turn = -side * np.pi / 2 if name == "lamp_arm" else (np.pi if side < 0 else 0.0)
            yaw = float(np.interp(distance, along, heading)) + turn
            builder.place(name, place, base_m=0.0, yaw_rad=yaw)


def _across(middle: Line, distance_m: float, part: Mesh) -> Mesh:
    """Return a mesh whose y axis lies across the road at a distance along its middle."""
    place = points_at(middle, np.array([distance_m]))[0]
    yaw = float(np.interp(distance_m, arc_length(middle), headings(middle)))
    return moved(part, (float(place[0]), float(place[1]), 0.0), yaw_rad=yaw)


def _bridge(builder: SceneBuilder, occupied: OccupiedArea, middle: Line, distance_m: float) -> None:
    """Add a bridge over the road: a deck on piers and abutments, with parapets."""
    deck = box((9.0, 56.0, 1.1), (0.0, 0.0, 6.15))
    beams = [box((0.5, 52.0, 0.5), (x, 0.0, 5.45)) for x in (-3.6, -1.2, 1.2, 3.6)]
    parapets = [box((0.3, 56.0, 1.0), (x, 0.0, 7.2)) for x in (-4.3, 4.3)]
    piers = [
        moved(cylinder(0.5, 5.2, sides=12), (x, y, 0.0)) for y in (-17.2, 0.0, 17.2) for x in (-3.0, 0.0, 3.0)
    ]
    abutments = [box((10.0, 4.0, 5.6), (0.0, y, 2.8)) for y in (-26.0, 26.0)]
    builder.add("building", {"concrete": _across(middle, distance_m, merge([deck, *beams]))})
    builder.add("wall", {"concrete": _across(middle, distance_m, merge(parapets))})
    for part in (*piers, *abutments):
        builder.add("building", {"concrete": _across(middle, distance_m, part)})
    place = points_at(middle, np.array([distance_m]))[0]
    occupied.add(Point(place).buffer(30.0))


def _gantry(builder: SceneBuilder, motorway: Motorway, distance_m: float) -> None:
    """Add a sign gantry over both carriageways, unless its legs would stand on a slip road."""
    reach, middle = EDGE_M + 1.6, motorway.middle
    feet = _across(middle, distance_m, box((1.0, 2 * reach, 1.0))).vertices[:, :2]
    if shapely.distance(shapely.points(feet.astype(np.float64)), motorway.ground.carriageway).min() < 0.8:
        return
    legs = [box((0.4, 0.4, 7.6), (0.0, y, 3.8)) for y in (-reach, reach)]
    beams = [box((0.3, 2 * reach, 0.3), (x, 0.0, z)) for x in (-0.5, 0.5) for z in (6.3, 7.5)]
    signs = [box((0.08, 3.2, 2.0), (x, y, 6.9)) for y in (-8.4, -4.6, 4.6, 8.4) for x in (-0.75, 0.75)]
    builder.add("sign", {"metal": _across(middle, distance_m, merge([*legs, *beams, *signs]))})


def _hedges(
    builder: SceneBuilder, occupied: OccupiedArea, ground: Ground, line: Line, rng: np.random.Generator
) -> None:
    """Add runs of hedge along a line, clear of every carriageway."""
    length, place = float(arc_length(line)[-1]), 0.0
    while place < length - 20.0:
        stop = min(place + rng.uniform(15.0, 60.0), length)
        points = points_at(line, np.linspace(place, stop, max(int((stop - place) / 5.0), 2)))
        strip = LineString(points).buffer(0.5)
        if rng.random() < 0.45 and strip.distance(ground.carriageway) > 2.0 and occupied.claim(strip):
            mesh = hedge(points, height_m=float(rng.uniform(1.2, 2.0)), thickness_m=0.8, rng=rng, step_m=1.0)
            builder.add("hedge", {"foliage": mesh})
        place = stop + rng.uniform(3.0, 30.0)


def _posts(
    builder: SceneBuilder,
    occupied: OccupiedArea,
    line: Line,
    aside_m: float,
    ground: Ground,
    rng: np.random.Generator,
) -> None:
    """Add marker posts and a few signs beside a road."""
    run = offset(line, aside_m)
    heading = headings(run)
    along = arc_length(run)
    for distance in np.arange(20.0, along[-1] - 20.0, 50.0):
        place = points_at(run, np.array([distance]))[0]
        foot = Point(place)
        if foot.distance(ground.carriageway) > 0.8 and occupied.claim(foot.buffer(0.3)):
            name = "bollard_metal" if rng.random() < 0.8 else "sign_triangle"
            turn = np.pi if aside_m < 0 else 0.0
            yaw = float(np.interp(distance, along, heading)) + turn
            builder.place(name, place, base_m=0.0, yaw_rad=yaw)


def _farm(
    builder: SceneBuilder, occupied: OccupiedArea, ground: Ground, yard: Line, rng: np.random.Generator
) -> None:
    """Add a house, barns, a tank and a truck around the end of a track."""
    shapes: tuple[tuple[Style, float, float, float], ...] = (
        ("house", 11.0, 8.5, 5.4),
        ("hall", 30.0, 16.0, 6.5),
        ("hall", 22.0, 14.0, 5.5),
    )
    for style, length, width, height in shapes:
        for _ in range(40):
            angle, reach = rng.uniform(0, 2 * np.pi), rng.uniform(20.0, 45.0)
            place = yard + reach * np.array([np.cos(angle), np.sin(angle)])
            shape = rectangle(place, angle + np.pi / 2, length, width)
            if shape.distance(ground.carriageway) > 5.0 and occupied.claim(shape.buffer(2.0)):
                corners = np.asarray(shape.exterior.coords)[:4]
                made = building(corners, height_m=height, style=style, rng=rng)
                builder.add("building", made)
                break
    for name in ("tank_storage", "truck_flatbed", "container_20ft", "bin_wheeled"):
        for _ in range(40):
            angle, reach = rng.uniform(0, 2 * np.pi), rng.uniform(16.0, 40.0)
            place = yard + reach * np.array([np.cos(angle), np.sin(angle)])
            length, width, _ = builder[name].extent_m
            shape = rectangle(place, angle, length, width)
            if shape.distance(ground.carriageway) > 2.0 and occupied.claim(shape.buffer(0.5)):
                builder.place(name, place, base_m=0.0, yaw_rad=angle)
                break
