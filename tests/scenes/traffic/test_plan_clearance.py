"""No mover touches a stationary object, and none leaves the carriageway or the pavement."""

from collections.abc import Iterator
from dataclasses import replace

import numpy as np
import pytest
import shapely
from numpy.typing import NDArray
from shapely.geometry.base import BaseGeometry

from echoscape.scenes.assets.vehicles import vehicle_prototypes
from echoscape.scenes.core.lane_graph import RoadGraph
from echoscape.scenes.core.scene import CLASSES, HasPose, Prototype, Scene
from echoscape.scenes.driving.ego_drive import EGO_EXTENT_M, plan_ego_drive
from echoscape.scenes.driving.route import LaneNetwork
from echoscape.scenes.roads.ground_mesh import ground_plan
from echoscape.scenes.town.build import build_town, road_network
from echoscape.scenes.town.presets import PRESETS, Preset
from echoscape.scenes.traffic.pedestrians import walking_loops
from echoscape.scenes.traffic.plan import TrafficSettings, plan_traffic
from echoscape.scenes.traffic.swept_path import SweptPaths
from echoscape.scenes.traffic.vehicles import vehicle_track
from tests.scenes.obstacles import Obstacles

KERB_M = 0.1


SHRINK_M = 0.02


CROWDED = TrafficSettings(vehicles_per_km2=150.0, pedestrians_per_km2=400.0, near_m=400.0)


Extent = tuple[float, float, float]


def _small(name: str) -> Preset:
    subdivision = PRESETS[name].subdivision
    assert subdivision is not None
    few = replace(subdivision, half_size_m=(190.0, 170.0), outskirts_m=0.0, roundabouts=1, removed_share=0.0)
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


def test_no_mover_touches_an_obstacle(small_town: Scene, request: pytest.FixtureRequest) -> None:
    preset = _small(request.node.callspec.params["small_town"])
    check_clearance(small_town, _carriageway(preset, small_town.seed), seed=3, traffic=CROWDED)


def test_every_footpath_is_free_from_end_to_end(small_town: Scene) -> None:
    obstacles = _obstacles(small_town)
    extent = next(kind.extent_m for kind in vehicle_prototypes() if kind.name == "pedestrian_walking")
    loops = [path for walk in small_town.roads.footpaths for path in walking_loops(walk)]
    assert len(loops) > 5
    for path in loops:
        step = np.diff(path.xy, axis=0)
        flat = np.full(len(step), 0.12)
        pose = np.column_stack([path.xy[:-1], flat, np.arctan2(step[:, 1], step[:, 0])])[::3]
        assert not obstacles.touched(pose, extent, shrink_m=SHRINK_M).any()


def _junction_paths(roads: RoadGraph, usable: NDArray[np.bool_]) -> list[tuple[int, ...]]:
    """Return every path from one street through a junction to the next along lanes that are `usable`."""
    paths: list[tuple[int, ...]] = []
    grow: list[tuple[int, ...]] = [
        (lane.id,) for lane in roads.lanes if lane.kind == "street" and usable[lane.id]
    ]
    while grow:
        path = grow.pop()
        for after in roads.lanes[path[-1]].successors:
            if usable[after] and after not in path:
                longer = (*path, after)
                (paths if roads.lanes[after].kind == "street" else grow).append(longer)
    return paths


def check_long_vehicles(town: Scene, carriageway: BaseGeometry) -> int:
    """Send every long vehicle through every junction that it may pass; return the number of paths."""
    obstacles, swept, count = _obstacles(town), SweptPaths(LaneNetwork(town.roads)), 0
    for kind in vehicle_prototypes():
        length, width, _ = kind.extent_m
        if length < 7.0:
            continue
        for path in _junction_paths(town.roads, swept.drivable_lanes(length, width)):
            begin, end = length, sum(town.roads.lanes[lane].length_m for lane in path) - length
            before = town.roads.lanes[path[0]].length_m
            begin, end = max(begin, before - 20.0), min(end, end - town.roads.lanes[path[-1]].length_m + 20.0)
            if end - begin < 2.0:
                continue
            travel = np.arange(begin, end, 1.0)
            track = vehicle_track(town.roads, path, travel, travel, np.ones_like(travel), length_m=length)
            hit = obstacles.touched(track.state, kind.extent_m, shrink_m=SHRINK_M)
            assert not hit.any(), (kind.name, path)
            over = _kerb_overlap_m(track.state, _hull(kind), carriageway)
            assert over < KERB_M, (kind.name, path, over)
            count += 1
    return count


def test_long_vehicles_fit_the_lanes_they_may_use(small_town: Scene, request: pytest.FixtureRequest) -> None:
    preset = _small(request.node.callspec.params["small_town"])
    assert check_long_vehicles(small_town, _carriageway(preset, small_town.seed)) > 40


@pytest.mark.slow
@pytest.mark.parametrize("preset", ["town", "suburb", "industrial"])
@pytest.mark.parametrize("seed", range(4))
def test_no_mover_touches_an_obstacle_in_any_town(preset: str, seed: int) -> None:
    town, carriageway = build_town(preset, seed=seed), _carriageway(PRESETS[preset], seed)
    check_clearance(town, carriageway, seed=seed, traffic=None)
    check_clearance(town, carriageway, seed=seed + 50, traffic=CROWDED)
    check_long_vehicles(town, carriageway)
