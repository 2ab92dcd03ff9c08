"""Nobody who moves touches what stands: posts, bins, trunks, walls, parked cars; and kerbs are kept off."""

from collections.abc import Iterator
from dataclasses import replace

import numpy as np
import pytest
import shapely
from hypothesis import given, settings
from hypothesis import strategies as st
from numpy.typing import NDArray
from shapely.geometry.base import BaseGeometry

from echoscape.scenes.assets.vegetation import tree_prototypes
from echoscape.scenes.assets.vehicles import vehicle_prototypes
from echoscape.scenes.core.lane_graph import Lane, RoadGraph
from echoscape.scenes.core.scene import CLASSES, HasPose, Mesh, Placements, Prototype, Scene, StaticMesh
from echoscape.scenes.core.trajectory import Trajectory
from echoscape.scenes.driving.ego_drive import EGO_EXTENT_M, plan_ego_drive
from echoscape.scenes.driving.route import LaneNetwork
from echoscape.scenes.roads.ground_mesh import ground_plan
from echoscape.scenes.town.build import build_town, road_network
from echoscape.scenes.town.gardens import plant_garden
from echoscape.scenes.town.parcels import CityBlock
from echoscape.scenes.town.placement import OccupiedArea, SceneBuilder
from echoscape.scenes.town.presets import PRESETS, Preset
from echoscape.scenes.traffic.pedestrians import walking_loops
from echoscape.scenes.traffic.plan import TrafficSettings, plan_traffic
from echoscape.scenes.traffic.swept_path import SweptPaths
from echoscape.scenes.traffic.vehicles import vehicle_track
from tests.scenes.obstacles import OVERHEAD_M, Obstacles, triangle_meets_box

KERB_M = 0.1
SHRINK_M = 0.02
CROWDED = TrafficSettings(vehicles_per_km2=150.0, pedestrians_per_km2=400.0, near_m=400.0)
Extent = tuple[float, float, float]


def _small(name: str) -> Preset:
    subdivision = PRESETS[name].subdivision
    assert subdivision is not None
    few = replace(subdivision, half_size_m=(190.0, 170.0), roundabouts=1, removed_share=0.0)
    return replace(PRESETS[name], subdivision=few, margin_m=20.0)


_OTHERS = [pytest.param(name, marks=pytest.mark.slow) for name in ("suburb", "industrial")]


@pytest.fixture(scope="module", params=["town", *_OTHERS])
def small_town(request: pytest.FixtureRequest) -> Iterator[Scene]:
    """A few blocks of a preset, with everything on them."""
    with pytest.MonkeyPatch.context() as patch:
        patch.setitem(PRESETS, "small", _small(request.param))
        yield build_town("small", seed=5)


def _obstacles(town: Scene) -> Obstacles:
    places = [*(lane.centre for lane in town.roads.lanes), *town.roads.footpaths]
    return Obstacles(town, near=np.concatenate(places))


def _carriageway(preset: Preset, seed: int) -> BaseGeometry:
    network, roads, room = road_network(preset, seed=seed)
    shape = ground_plan(network, roads, room, margin_m=preset.margin_m).carriageway
    shapely.prepare(shape)
    return shape


def _kerb_overlap_m(pose: NDArray[np.float64], extent: Extent, carriageway: BaseGeometry) -> float:
    """Return how far [m] any point of the outlines of boxes at `pose` (N, 4) is off the carriageway."""
    along, aside = np.meshgrid(np.linspace(-0.5, 0.5, 9) * extent[0], np.array([-0.5, 0.5]) * extent[1])
    cos, sin = np.cos(pose[:, 3, None]), np.sin(pose[:, 3, None])
    x = pose[:, :1] + cos * along.ravel() - sin * aside.ravel()
    y = pose[:, 1:2] + sin * along.ravel() + cos * aside.ravel()
    off = ~shapely.contains_xy(carriageway, x, y)
    return float(shapely.distance(carriageway, shapely.points(x[off], y[off])).max(initial=0.0))


def _hull(kind: Prototype) -> Extent:
    """Return the extent [m] of what of a vehicle is as low as a kerb: its mirrors may hang over."""
    corners = np.concatenate([mesh.vertices[mesh.faces] for mesh in kind.parts.values()])
    low = corners[corners[..., 2].min(axis=1) < 0.6].reshape(-1, 3)
    return kind.extent_m[0], 2 * float(np.abs(low[:, 1]).max()), 0.6


def _touching(
    obstacles: Obstacles, town: Scene, tracks: list[tuple[str, Extent, HasPose]], time: NDArray[np.float64]
) -> list[tuple[str, str]]:
    """Return who touches what at any of the times."""
    pairs = []
    for name, extent, track in tracks:
        hit = np.unique(obstacles.touched(track.pose(time), extent, shrink_m=SHRINK_M))
        pairs += [(name, CLASSES[town.instance_class[number]]) for number in hit[hit > 0]]
    return pairs


def check_clearance(
    town: Scene, carriageway: BaseGeometry, *, seed: int, traffic: TrafficSettings | None
) -> None:
    """Drive for a minute in traffic and look at everybody four times a second."""
    drive = plan_ego_drive(town, seed=seed, duration_s=60.0)
    movers = plan_traffic(town, drive, seed=seed, settings=traffic)
    assert len(movers) > 12
    tracks: list[tuple[str, Extent, HasPose]] = [("radar car", EGO_EXTENT_M, drive)]
    tracks += [(mover.prototype.name, mover.prototype.extent_m, mover.track) for mover in movers]
    wheeled = [mover for mover in movers if mover.prototype.class_name != "pedestrian"]
    time = np.arange(0.0, 60.01, 0.25)
    assert _touching(_obstacles(town), town, tracks, time) == []
    assert _kerb_overlap_m(drive.pose(time), EGO_EXTENT_M, carriageway) < KERB_M
    for mover in wheeled:
        pose, hull = mover.track.pose(time), _hull(mover.prototype)
        assert _kerb_overlap_m(pose, hull, carriageway) < KERB_M, mover.prototype.name


def test_nobody_touches_what_stands(small_town: Scene, request: pytest.FixtureRequest) -> None:
    preset = _small(request.node.callspec.params["small_town"])
    check_clearance(small_town, _carriageway(preset, small_town.seed), seed=3, traffic=CROWDED)


def test_every_walk_is_free_from_end_to_end(small_town: Scene) -> None:
    obstacles = _obstacles(small_town)
    extent = next(kind.extent_m for kind in vehicle_prototypes() if kind.name == "pedestrian_walking")
    rounds = [way for walk in small_town.roads.footpaths for way in walking_loops(walk)]
    assert len(rounds) > 5
    for way in rounds:
        step = np.diff(way.xy, axis=0)
        flat = np.full(len(step), 0.12)
        pose = np.column_stack([way.xy[:-1], flat, np.arctan2(step[:, 1], step[:, 0])])[::3]
        assert not obstacles.touched(pose, extent, shrink_m=SHRINK_M).any()


def _ways(roads: RoadGraph, usable: NDArray[np.bool_]) -> list[tuple[int, ...]]:
    """Return every way from one street through a junction to the next along lanes that are `usable`."""
    ways: list[tuple[int, ...]] = []
    grow: list[tuple[int, ...]] = [
        (lane.id,) for lane in roads.lanes if lane.kind == "street" and usable[lane.id]
    ]
    while grow:
        way = grow.pop()
        for after in roads.lanes[way[-1]].successors:
            if usable[after] and after not in way:
                longer = (*way, after)
                (ways if roads.lanes[after].kind == "street" else grow).append(longer)
    return ways


def check_long_vehicles(town: Scene, carriageway: BaseGeometry) -> int:
    """Send every long vehicle through every junction that it may pass; return the number of ways."""
    obstacles, swept, count = _obstacles(town), SweptPaths(LaneNetwork(town.roads)), 0
    for kind in vehicle_prototypes():
        length, width, _ = kind.extent_m
        if length < 7.0:
            continue
        for way in _ways(town.roads, swept.drivable_lanes(length, width)):
            begin, end = length, sum(town.roads.lanes[lane].length_m for lane in way) - length
            before = town.roads.lanes[way[0]].length_m
            begin, end = max(begin, before - 20.0), min(end, end - town.roads.lanes[way[-1]].length_m + 20.0)
            if end - begin < 2.0:
                continue
            travel = np.arange(begin, end, 1.0)
            track = vehicle_track(town.roads, way, travel, travel, np.ones_like(travel), length_m=length)
            hit = obstacles.touched(track.state, kind.extent_m, shrink_m=SHRINK_M)
            assert not hit.any(), (kind.name, way)
            over = _kerb_overlap_m(track.state, _hull(kind), carriageway)
            assert over < KERB_M, (kind.name, way, over)
            count += 1
    return count


def test_long_vehicles_fit_where_they_are_let(small_town: Scene, request: pytest.FixtureRequest) -> None:
    preset = _small(request.node.callspec.params["small_town"])
    assert check_long_vehicles(small_town, _carriageway(preset, small_town.seed)) > 40


@pytest.mark.slow
@pytest.mark.parametrize("preset", ["town", "suburb", "industrial"])
@pytest.mark.parametrize("seed", range(4))
def test_nobody_touches_what_stands_in_any_town(preset: str, seed: int) -> None:
    town, carriageway = build_town(preset, seed=seed), _carriageway(PRESETS[preset], seed)
    check_clearance(town, carriageway, seed=seed, traffic=None)
    check_clearance(town, carriageway, seed=seed + 50, traffic=CROWDED)
    check_long_vehicles(town, carriageway)


def test_crowns_that_reach_the_ground_keep_off_what_is_taken() -> None:
    garden, strip = shapely.box(0.0, 0.0, 8.0, 8.0), shapely.box(8.0, -9.0, 9.0, 17.0)
    kinds, kerb = tree_prototypes(), 0.12
    planted, missing = set(), 0
    for seed in range(150):
        builder, occupied = SceneBuilder(kinds), OccupiedArea()
        occupied.add(strip)
        block = CityBlock(outline=garden, occupied=occupied, base_m=kerb, inradius_m=8.0)
        plant_garden(builder, garden, block, chance=1.0, rng=np.random.default_rng(seed))
        placed = builder.placements()
        missing += len(placed.yaw) == 0
        for number, place, yaw, scale in zip(
            placed.prototype, placed.position, placed.yaw, placed.scale, strict=True
        ):
            corners = np.concatenate([mesh.vertices[mesh.faces] for mesh in kinds[number].parts.values()])
            low = scale * corners[scale * corners[..., 2].min(axis=1) < 1.8].reshape(-1, 3)
            x = place[0] + np.cos(yaw) * low[:, 0] - np.sin(yaw) * low[:, 1]
            assert x.max() < 8.0, kinds[number].name
            planted.add(kinds[number].name)
    assert planted == {"tree_broadleaf", "tree_street", "tree_conifer", "tree_shrub"}
    assert 0 < missing < 30


# ---------------------------------------------------------------------- swept paths


def _racecourse(radius_m: float, width_m: float) -> RoadGraph:
    """Return two straight streets of 40 m joined by half circles."""
    along, angle = np.linspace(0.0, 40.0, 81), np.linspace(-np.pi / 2, np.pi / 2, 161)
    street = np.column_stack([along, np.full_like(along, -radius_m)])
    bend = radius_m * np.column_stack([np.cos(angle), np.sin(angle)]) + [40.0, 0.0]
    lines = [street, bend, [40.0, 0.0] - street, [40.0, 0.0] - bend]
    lanes = tuple(
        Lane(
            id=number,
            kind="turn" if number % 2 else "street",
            centre=line,
            width_m=width_m if number % 2 else 6.0,
            speed_limit_mps=10.0,
            successors=((number + 1) % 4,),
        )
        for number, line in enumerate(lines)
    )
    return RoadGraph(lanes=lanes, junctions=np.zeros((0, 2)))


@pytest.mark.parametrize("radius_m", [10.0, 12.0, 16.0])
def test_bends_are_open_to_what_stays_on_them(radius_m: float) -> None:
    swept = SweptPaths(LaneNetwork(_racecourse(radius_m, 3.3)))
    # Axles 0.6 L apart on the circle, itself drawn in by sigma^2 / 2 R: the rest is 3.3 / 2 + 0.4 (+ 0.05) m.
    for length in (8.0, 10.0, 12.0, 14.0):
        inward = radius_m - np.sqrt(radius_m**2 - (0.3 * length) ** 2) + 0.5 / radius_m
        half = 1.65 + 0.4 - inward
        assert swept.drivable_lanes(length, 2 * (half - 0.08)).all()
        assert not swept.drivable_lanes(length, 2 * (half + 0.13)).any()


@pytest.mark.parametrize("radius_m", [10.0, 12.0, 16.0])
@pytest.mark.parametrize("length_m", [8.0, 12.0])
def test_bends_are_closed_to_what_swings_its_front_over_the_kerb(radius_m: float, length_m: float) -> None:
    open_roads, width = _racecourse(radius_m, 3.3), 2.0
    assert SweptPaths(LaneNetwork(open_roads)).drivable_lanes(length_m, width).all()
    line = radius_m - 0.5 / radius_m
    middle = np.sqrt(line**2 - (0.3 * length_m) ** 2)
    corner = np.hypot(middle + width / 2, length_m / 2)

    def drivable_lanes(kerb_m: float) -> NDArray[np.bool_]:
        outer = shapely.LineString([(0.0, 0.0), (40.0, 0.0)]).buffer(kerb_m, quad_segs=64).exterior
        kerbs = (np.asarray(outer.coords),)
        return SweptPaths(LaneNetwork(replace(open_roads, kerbs=kerbs))).drivable_lanes(length_m, width)

    # A tenth of a metre, of mirrors, may hang over on either side, and half as much ahead.
    assert drivable_lanes(corner + 0.03).all()
    assert not drivable_lanes(corner - 0.18).any()


def test_long_vehicles_keep_both_axles_on_the_line() -> None:
    roads, length = _racecourse(12.0, 4.0), 10.0
    travel = np.arange(45.0, 70.0, 0.5)
    track = vehicle_track(roads, (0, 1, 2), travel, travel, np.ones_like(travel), length_m=length)
    for share in (-0.3, 0.3):
        ahead = np.column_stack([np.cos(track.state[:, 3]), np.sin(track.state[:, 3])])
        axle = track.state[:, :2] + share * length * ahead - [40.0, 0.0]
        on_bend = axle[:, 0] > 2.0
        np.testing.assert_allclose(np.hypot(*axle[on_bend].T), 12.0 - 0.5 / 12.0, atol=0.05)


# ---------------------------------------------------------------------- what counts as standing


def _scene(parts: dict[str, Mesh], placed: Prototype | None = None) -> Scene:
    """Return a town of one object a class, from 1 on, and one prototype at (10, 0)."""
    classes = [0, *(CLASSES.index(name) for name in parts), CLASSES.index("lamp_post")]
    static = {
        name: StaticMesh(
            vertices=mesh.vertices, faces=mesh.faces, instance=np.full(len(mesh.faces), number + 1, np.uint32)
        )
        for number, (name, mesh) in enumerate(parts.items())
    }
    some = 1 if placed else 0
    return Scene(
        preset="test",
        seed=0,
        static=static,
        prototypes=(placed,) if placed else (),
        placements=Placements(
            prototype=np.zeros(some, np.uint32),
            instance=np.full(some, len(parts) + 1, np.uint32),
            position=np.tile([10.0, 0.0, 0.12], (some, 1)),
            yaw=np.full(some, np.pi / 2),
            scale=np.full(some, 2.0),
        ),
        instance_class=np.array(classes, np.uint8),
        roads=RoadGraph(lanes=(), junctions=np.zeros((0, 2))),
        bounds_m=(0.0, 0.0, 1.0, 1.0),
    )


def _triangle(*corners: tuple[float, float, float]) -> Mesh:
    return Mesh(vertices=np.array(corners, np.float32), faces=np.array([[0, 1, 2]], np.uint32))


def _hits(town: Scene, x: float, y: float, height: float, yaw: float = 0.0) -> int:
    obstacles = Obstacles(town, near=np.array([[0.0, 0.0], [10.0, 0.0]]))
    return int(obstacles.touched(np.array([[x, y, 0.0, yaw]]), (4.0, 2.0, height), shrink_m=0.0)[0])


def test_a_wall_seen_from_above_is_met_and_a_road_is_not() -> None:
    wall = _triangle((1.9, -9.0, 0.0), (1.9, 9.0, 0.0), (1.9, 0.0, 3.0))
    road = _triangle((-9.0, -9.0, 0.1), (9.0, -9.0, 0.1), (0.0, 9.0, 0.1))
    town = _scene({"road": road, "wall": wall})
    assert _hits(town, 0.0, 0.0, 1.5) == 2
    assert _hits(town, -0.2, 0.0, 1.5) == 0
    assert _hits(town, 0.0, 0.0, 1.5, yaw=np.pi / 2) == 0  # it is 1 m to either side then


def test_what_hangs_high_is_passed_under() -> None:
    for height, lorry, car in ((OVERHEAD_M, 0, 0), (2.0, 1, 0), (1.4, 1, 1)):
        leaf = _triangle((0.0, 0.0, height), (0.5, 0.0, height), (0.0, 0.5, height))
        town = _scene({"tree": leaf})
        assert (_hits(town, 0.0, 0.0, 3.5), _hits(town, 0.0, 0.0, 1.5)) == (lorry, car)


def test_what_is_placed_is_met_where_it_was_turned_to() -> None:
    arm = _triangle((0.0, 0.0, 0.5), (1.5, 0.0, 0.5), (1.5, 0.01, 0.5))  # to x: twice as long and turned to y
    kind = Prototype(name="arm", class_name="lamp_post", parts={"metal": arm}, extent_m=(3.0, 0.02, 0.5))
    town = _scene({}, kind)
    assert _hits(town, 10.0, 3.9, 1.5) == 1
    assert _hits(town, 10.0, 4.1, 1.5) == 0
    assert _hits(town, 12.5, 0.0, 1.5) == 0


@settings(max_examples=60, deadline=None)
@given(seed=st.integers(0, 2**32 - 1))
def test_triangles_meet_boxes_where_sampled_points_say_so(seed: int) -> None:
    rng = np.random.default_rng(seed)
    corner, half = rng.uniform(-4, 4, (1, 3, 2)), rng.uniform(0.3, 2.0, 2)
    weight = rng.dirichlet(np.ones(3), 4000)
    inside = (np.abs(weight @ corner[0]) <= half).all(axis=-1).any()
    apart = shapely.Polygon(corner[0]).distance(shapely.box(*-half, *half)) > 0
    meets = bool(triangle_meets_box(corner, half)[0])
    assert meets or not inside
    assert meets != apart


def test_walks_of_trajectories_are_looked_at_where_they_are() -> None:
    post = _triangle((0.0, 0.0, 0.0), (0.1, 0.0, 0.0), (0.0, 0.1, 1.0))
    town = _scene({"bollard": post})
    state = np.array([[-5.0, 0.0, 0.0, 0.0], [5.0, 0.0, 0.0, 0.0]])
    track = Trajectory(time_s=np.array([0.0, 10.0]), state=state, rate=np.tile([1.0, 0, 0, 0], (2, 1)))
    obstacles = Obstacles(town, near=np.zeros((1, 2)))
    hit = obstacles.touched(track.pose(np.arange(0.0, 10.1, 1.0)), (4.0, 2.0, 1.5)) > 0
    # A box of 4 m meets the post, 0 to 0.1 m, while its middle is from -1.98 to 2.08 m.
    np.testing.assert_array_equal(np.flatnonzero(hit), [4, 5, 6, 7])
