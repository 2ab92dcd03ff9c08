"""The world has no edge in sight: ground and clutter go on beyond the range of every radar, from every pose.

Clutter is counted from the finished scene: one place per object, the middle of its vertices.
"""

from dataclasses import dataclass
from functools import cached_property

import numpy as np
import pytest
import shapely
from numpy.typing import NDArray
from scipy.spatial import KDTree
from shapely.geometry.base import BaseGeometry

from echoscape.scenes.core.scene import CLASSES, Scene
from echoscape.scenes.driving.ego_drive import plan_ego_drive
from echoscape.scenes.roads.ground_mesh import ground_plan
from echoscape.scenes.town.build import build_town, road_network
from echoscape.scenes.town.presets import PRESETS, SIGHT_M
from echoscape.sim.sensor.registry import SENSORS

FARTHEST_M = max(sensor.range_m for sensor in SENSORS.values())
SECTORS = 12
GROUND = ("ground", "road", "pavement", "kerb")
SOLID = tuple(name for name in CLASSES if name not in ("none", "target", *GROUND))
BUILT_IN_SECONDS = ("town", "suburb", "industrial")
BUILT_AT_ONCE = ("motorway", "open", "yard")


@dataclass(frozen=True, kw_only=True)
class World:
    """A scene and what is found in it."""

    scene: Scene

    @cached_property
    def poses(self) -> NDArray[np.float64]:
        """Places (N, 2) along a drive of four minutes [m]."""
        drive = plan_ego_drive(self.scene, seed=self.scene.seed, duration_s=240.0)
        return drive.pose(np.arange(0.0, 240.0, 3.0))[:, :2]

    @cached_property
    def driven(self) -> BaseGeometry:
        """The lanes and all that they enclose."""
        lanes = shapely.union_all(
            shapely.buffer([shapely.LineString(lane.centre[::4]) for lane in self.scene.roads.lanes], 8.0)
        )
        return shapely.union_all([shapely.Polygon(part.exterior) for part in shapely.get_parts(lanes)])

    def places(self, *names: str) -> NDArray[np.float64]:
        """Return the middle (N, 2) of every object of these classes [m]."""
        scene = self.scene
        count = len(scene.instance_class)
        total, sums = np.zeros(count), np.zeros((count, 2))
        for mesh in scene.static.values():
            total += np.bincount(mesh.instance, minlength=count)
            middle = mesh.vertices[mesh.faces, :2].astype(float).mean(axis=1)
            sums += np.stack([np.bincount(mesh.instance, middle[:, a], count) for a in (0, 1)], axis=-1)
        total[scene.placements.instance] = 1.0
        sums[scene.placements.instance] = scene.placements.position[:, :2]
        wanted = np.isin(scene.instance_class, [CLASSES.index(name) for name in names]) & (total > 0)
        return sums[wanted] / total[wanted, None]

    def density(self, zone: BaseGeometry, *names: str) -> float:
        """Return the number of objects of these classes in a zone [1/ha]."""
        return 1e4 * float(shapely.contains_xy(zone, self.places(*names)).sum()) / zone.area


def check_ground(world: World) -> None:
    """There is ground below a random place in each of the sectors around each pose, and at full range."""
    rng = np.random.default_rng(0)
    angle = 2 * np.pi * (np.arange(SECTORS) + rng.random((2, len(world.poses), SECTORS))) / SECTORS
    reach = np.stack([rng.uniform(0, FARTHEST_M, angle[0].shape), np.full(angle[0].shape, FARTHEST_M)])
    places = world.poses[None, :, None] + reach[..., None] * np.stack([np.cos(angle), np.sin(angle)], axis=-1)
    corners = []
    for mesh in world.scene.static.values():
        level = np.ptp(mesh.vertices[mesh.faces][..., 2], axis=1) == 0.0
        under = np.isin(world.scene.instance_class[mesh.instance], [CLASSES.index(name) for name in GROUND])
        corners.append(mesh.vertices[mesh.faces[level & under]][..., :2].astype(float))
    triangles = np.asarray(shapely.polygons(np.concatenate(corners)))
    triangles = shapely.buffer(triangles, 0.02)  # no gaps from float32
    found = shapely.STRtree(triangles).query(shapely.points(places.reshape(-1, 2)), predicate="within")[0]
    assert len(np.unique(found)) == places.size // 2


def check_clutter(world: World) -> None:
    """From each pose something solid stands in every sector, between 100 m and the end of the range."""
    solid = world.places(*SOLID)
    for pose, near in zip(world.poses, KDTree(solid).query_ball_point(world.poses, FARTHEST_M), strict=True):
        away = solid[near] - pose
        away = away[np.hypot(*away.T) > 100.0]
        sector = np.floor(np.arctan2(away[:, 1], away[:, 0]) / (2 * np.pi) * SECTORS).astype(int) % SECTORS
        assert len(np.unique(sector)) == SECTORS


def check_density(world: World) -> None:
    """Buildings and trees stand as densely 100 to 160 m beyond the last driven street as between streets."""
    ring = world.driven.buffer(160.0).difference(world.driven.buffer(100.0))
    town = PRESETS[world.scene.preset].subdivision is not None
    inside = world.driven if town else world.driven.buffer(100.0).difference(world.driven.buffer(20.0))
    ratio = world.density(ring, "building", "tree") / world.density(inside, "building", "tree")
    assert 0.5 < ratio < 2.0


def test_the_world_goes_on_beyond_the_range_of_every_radar() -> None:
    assert SIGHT_M > FARTHEST_M + 5.0
    assert min(preset.margin_m for preset in PRESETS.values()) >= SIGHT_M


@pytest.mark.parametrize("preset", ["industrial", "motorway", "open"])
def test_no_end_of_the_world_is_in_sight(preset: str) -> None:
    world = World(scene=build_town(preset, seed=3))
    check_ground(world)
    check_clutter(world)
    check_density(world)


def test_trees_stand_all_around_beyond_the_wall_of_a_yard() -> None:
    world = World(scene=build_town("yard", seed=3))
    check_ground(world)
    check_clutter(world)


def test_the_plane_goes_on() -> None:
    check_ground(World(scene=build_town("empty", seed=3)))


@pytest.mark.slow
@pytest.mark.parametrize("seed", range(50))
def test_no_end_of_any_world_is_in_sight(seed: int) -> None:
    presets = BUILT_AT_ONCE
    if seed < 10 * len(BUILT_IN_SECONDS):
        presets += (BUILT_IN_SECONDS[seed % len(BUILT_IN_SECONDS)],)
    for preset in presets:
        world = World(scene=build_town(preset, seed=seed))
        check_ground(world)
        check_clutter(world)
        if preset != "yard":
            check_density(world)


@pytest.mark.slow
@pytest.mark.parametrize("preset", BUILT_IN_SECONDS)
@pytest.mark.parametrize("seed", range(50))
def test_land_and_streets_go_on_around_every_drive(preset: str, seed: int) -> None:
    """From the plan of the ground alone; `fill_outskirts` builds on all land beyond the driven streets."""
    network, roads, trims = road_network(PRESETS[preset], seed=seed)
    ground = ground_plan(network, roads, trims, margin_m=PRESETS[preset].margin_m)
    drive = plan_ego_drive(roads, seed=seed, duration_s=240.0)
    poses = shapely.points(drive.pose(np.arange(0.0, 240.0, 3.0))[:, :2])
    assert shapely.contains(ground.land, poses).all()
    assert shapely.distance(ground.land.boundary, poses).min() > FARTHEST_M
    ring = ground.driven.buffer(SIGHT_M).difference(ground.driven)
    beyond, between = (
        sum(shapely.LineString(street.line).intersection(zone).length for street in streets) / zone.area
        for zone, streets in ((ring, network.outskirts), (ground.driven, network.streets))
    )
    assert 0.5 < beyond / between < 2.0
