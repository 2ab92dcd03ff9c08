"""Traffic keeps to its lanes and limits, and nobody ever touches anybody."""

from collections.abc import Callable
from dataclasses import replace
from itertools import pairwise

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from numpy.testing import assert_allclose
from scipy.spatial import KDTree

from echoscape.scenes.core.lane_graph import RoadGraph
from echoscape.scenes.core.scene import Mover, Prototype, Scene
from echoscape.scenes.core.trajectory import Trajectory
from echoscape.scenes.driving.ego_drive import EGO_EXTENT_M, EgoDrive, plan_ego_drive
from echoscape.scenes.roads.ground_mesh import WALKING_OFFSET_M
from echoscape.scenes.traffic.car_following import idm_acceleration
from echoscape.scenes.traffic.collisions import boxes_touch, overlaps
from echoscape.scenes.traffic.microsimulation import Fleet, simulate_traffic
from echoscape.scenes.traffic.pedestrians import PACE_MPS, pedestrian_track, walking_loops
from echoscape.scenes.traffic.plan import TrafficSettings, plan_traffic
from echoscape.scenes.traffic.right_of_way import conflicting_lanes

BareTown = Callable[[RoadGraph], Scene]
DENSE = TrafficSettings(vehicles_per_km2=70.0, pedestrians_per_km2=60.0)


@pytest.fixture(scope="module")
def scene(
    blocks: RoadGraph, bare_town: BareTown, boxes: tuple[Prototype, ...]
) -> tuple[EgoDrive, tuple[Mover, ...]]:
    drive = plan_ego_drive(blocks, seed=11, duration_s=150)
    return drive, plan_traffic(bare_town(blocks), drive, seed=11, settings=DENSE, prototypes=boxes)


def _vehicles(movers: tuple[Mover, ...]) -> list[Mover]:
    return [mover for mover in movers if mover.prototype.class_name != "pedestrian"]


def _taken_out(caplog: pytest.LogCaptureFixture) -> int:
    messages = [record.getMessage() for record in caplog.records]
    return sum(int(message.split()[1]) for message in messages if message.startswith("removed"))


@pytest.mark.parametrize("seed", range(4))
def test_nobody_touches_anybody(
    blocks: RoadGraph,
    bare_town: BareTown,
    boxes: tuple[Prototype, ...],
    caplog: pytest.LogCaptureFixture,
    seed: int,
) -> None:
    drive = plan_ego_drive(blocks, seed=seed, duration_s=120)
    with caplog.at_level("INFO"):
        movers = plan_traffic(bare_town(blocks), drive, seed=seed, settings=DENSE, prototypes=boxes)
    assert _taken_out(caplog) <= 1  # by keeping clear, not by being taken out
    found = overlaps(drive, movers, ego_extent_m=EGO_EXTENT_M, duration_s=120.0)
    assert len(movers) > 20
    assert len(found) == 0


@pytest.mark.parametrize("seed", range(2))
def test_few_are_taken_out_in_a_real_town(
    town_roads: RoadGraph, bare_town: BareTown, caplog: pytest.LogCaptureFixture, seed: int
) -> None:
    drive = plan_ego_drive(town_roads, seed=seed, duration_s=300)
    with caplog.at_level("INFO"):
        movers = plan_traffic(bare_town(town_roads), drive, seed=seed)
    assert len(movers) >= 8
    assert _taken_out(caplog) <= 0.1 * len(movers)


def test_vehicles_keep_to_their_lanes_and_below_the_limit(
    scene: tuple[EgoDrive, tuple[Mover, ...]], blocks: RoadGraph
) -> None:
    drive, movers = scene
    centres = KDTree(np.concatenate([lane.centre for lane in blocks.lanes]))
    time = np.arange(0, drive.duration_s, 0.5)
    for mover in _vehicles(movers):
        off, _ = centres.query(mover.track.pose(time)[:, :2])
        # Both axles are on the line: the middle of a long one cuts bends by (0.3 length)^2 / (2 radius).
        assert off.max() < 0.6 + (0.3 * mover.prototype.extent_m[0]) ** 2 / (2 * 6.0)
        assert np.hypot(*mover.track.velocity(time)[:, :2].T).max() < 13.4 + 1e-6
        assert_allclose(mover.track.pose(time)[:, 2], 0.0)


def test_vehicles_move_along_their_heading(scene: tuple[EgoDrive, tuple[Mover, ...]]) -> None:
    drive, movers = scene
    time = np.arange(0.05, drive.duration_s, 0.5)
    for mover in _vehicles(movers):
        velocity, yaw = mover.track.velocity(time), mover.track.pose(time)[:, 3]
        moving = np.hypot(*velocity[:, :2].T) > 1
        course = np.arctan2(velocity[moving, 1], velocity[moving, 0])
        assert np.abs(np.angle(np.exp(1j * (course - yaw[moving])))).max() < 0.2


def test_velocity_of_movers_is_the_derivative_of_their_pose(
    scene: tuple[EgoDrive, tuple[Mover, ...]],
) -> None:
    drive, movers = scene
    time = np.linspace(0.05, drive.duration_s - 0.05, 400)
    for mover in movers:
        slope = (mover.track.pose(time + 1e-4) - mover.track.pose(time - 1e-4)) / 2e-4
        assert_allclose(slope, mover.track.velocity(time), atol=5e-3)


def test_most_traffic_moves(scene: tuple[EgoDrive, tuple[Mover, ...]]) -> None:
    drive, movers = scene
    time = np.arange(0, drive.duration_s, 1.0)
    speed = [np.hypot(*mover.track.velocity(time)[:, :2].T).mean() for mover in _vehicles(movers)]
    assert np.median(speed) > 3.0


def test_instances_follow_the_towns_and_do_not_repeat(
    scene: tuple[EgoDrive, tuple[Mover, ...]], blocks: RoadGraph, bare_town: BareTown
) -> None:
    _, movers = scene
    first = len(bare_town(blocks).instance_class)
    assert [mover.instance for mover in movers] == list(range(first, first + len(movers)))


def test_same_seed_same_traffic(blocks: RoadGraph, bare_town: BareTown, boxes: tuple[Prototype, ...]) -> None:
    drive = plan_ego_drive(blocks, seed=1, duration_s=20)
    runs = [
        plan_traffic(bare_town(blocks), drive, seed=seed, settings=DENSE, prototypes=boxes)
        for seed in (1, 1, 2)
    ]
    states = [b"".join(mover.track.state.tobytes() for mover in movers) for movers in runs]
    assert states[0] == states[1]
    assert states[0] != states[2]


@pytest.mark.slow
def test_twenty_kilometres_of_town_traffic(town_roads: RoadGraph, bare_town: BareTown) -> None:
    drive = plan_ego_drive(town_roads, seed=1, length_m=20_000)
    movers = plan_traffic(bare_town(town_roads), drive, seed=1)
    assert len(movers) > 20
    assert len(overlaps(drive, movers, ego_extent_m=EGO_EXTENT_M, duration_s=drive.duration_s)) == 0


def test_no_traffic_where_none_is_wanted(blocks: RoadGraph, bare_town: BareTown) -> None:
    drive = plan_ego_drive(blocks, seed=1, duration_s=5)
    nobody = TrafficSettings(vehicles_per_km2=0.0, pedestrians_per_km2=0.0)
    assert plan_traffic(bare_town(blocks), drive, seed=1, settings=nobody) == ()


def test_followers_keep_their_distance(straight: RoadGraph) -> None:
    slow_lead = Fleet(
        lane=np.array([0, 0, 0]),
        station_m=np.array([60.0, 40.0, 20.0]),
        length_m=np.full(3, 4.5),
        max_speed_mps=np.array([4.0, 13.0, 13.0]),
        speed_factor=np.ones(3),
        lane_weight=np.ones(len(straight.lanes)),
        may_use=np.ones((3, len(straight.lanes)), dtype=bool),
    )
    drive = plan_ego_drive(straight, seed=3, duration_s=40)
    far = replace(drive, travel_m=np.full_like(drive.travel_m, 0.0))  # the radar car stays where nobody is
    record = simulate_traffic(straight, far, slow_lead, step_s=0.2, rng=np.random.default_rng(0))
    gap = -np.diff(record.travel_m, axis=1) - 4.5
    assert gap.min() > 1.5
    # In the end all go at the speed of the first, at s0 + v T = 2.5 + 4 x 1.4 m, a little more for v / v0.
    assert_allclose(record.speed_mps[-40], 4.0, atol=0.3)
    assert_allclose(gap[-40], 8.1, atol=1.5)


def test_interaction_vanishes_at_the_wanted_gap_and_grows_as_the_gap_closes() -> None:
    speed = np.full(3, 10.0)
    gap = np.array([2.5 + 10.0 * 1.4, 10.0, 5.0])
    acceleration = idm_acceleration(speed, gap, np.zeros(3))
    assert_allclose(acceleration[0], 0.0, atol=1e-12)
    assert acceleration[2] < acceleration[1] < 0


def test_crossing_lanes_conflict_and_parallel_ones_do_not(blocks: RoadGraph) -> None:
    conflict = conflicting_lanes(blocks)
    assert_allclose(conflict, conflict.T)
    assert not conflict[[lane.id for lane in blocks.lanes if lane.kind == "street"]].any()
    turns = [lane for lane in blocks.lanes if lane.kind == "turn" and lane.junction == 12]
    straight_on = [lane for lane in turns if np.hypot(*(lane.centre[-1] - lane.centre[0])) > 17.9]
    assert len(straight_on) == 4
    for first in straight_on:
        way = first.centre[-1] - first.centre[0]
        for second in straight_on:
            cosine = way @ (second.centre[-1] - second.centre[0]) / (way @ way)
            assert conflict[first.id, second.id] == (
                cosine > -0.5
            )  # itself and the two that cross, not the opposite


# ---------------------------------------------------------------------- people


def _walk(closed: bool) -> np.ndarray:
    if not closed:
        return np.array([[0.0, 0.0], [30.0, 0.0], [30.0, 20.0]])
    return np.array([[0.0, 0.0], [30.0, 0.0], [30.0, 20.0], [0.0, 20.0], [0.0, 0.0]])


@pytest.mark.parametrize("closed", [False, True])
def test_people_stay_on_their_walk_at_their_pace(*, closed: bool) -> None:
    line = np.concatenate([np.linspace(a, b, 400) for a, b in pairwise(_walk(closed))])
    for way in walking_loops(_walk(closed)):
        track = pedestrian_track(way, start_m=3.0, pace_mps=1.4, duration_s=200.0)
        time = np.linspace(0, 199, 3000)
        off, _ = KDTree(line).query(track.pose(time)[:, :2])
        assert off.max() < WALKING_OFFSET_M + 0.4  # sharp corners are rounded
        assert_allclose(np.hypot(*track.velocity(time)[:, :2].T), 1.4, atol=0.3)
        assert_allclose(track.pose(time)[:, 2], 0.12)


@settings(max_examples=10, deadline=None)
@given(pace=st.floats(*PACE_MPS), apart_m=st.floats(2.0, 40.0))
def test_people_on_one_walk_never_meet(pace: float, apart_m: float) -> None:
    way = walking_loops(_walk(closed=False))[0]
    tracks = [
        pedestrian_track(way, start_m=start, pace_mps=pace, duration_s=120.0) for start in (0.0, apart_m)
    ]
    time = np.linspace(0, 120, 2000)
    between = np.hypot(*(tracks[0].pose(time) - tracks[1].pose(time))[:, :2].T)
    assert between.min() > 2 * WALKING_OFFSET_M - 0.3


# ---------------------------------------------------------------------- boxes


@settings(max_examples=60, deadline=None)
@given(seed=st.integers(0, 2**32 - 1))
def test_boxes_touch_where_sampled_points_say_so(seed: int) -> None:
    rng = np.random.default_rng(seed)
    pose = np.column_stack([rng.uniform(-4, 4, (2, 2)), rng.uniform(-4, 4, 2)])
    extent = rng.uniform(1, 5, (2, 2))
    share = np.stack(np.meshgrid(*[np.linspace(-0.5, 0.5, 60)] * 2), -1).reshape(-1, 2)

    def corners(box: int) -> np.ndarray:
        cos, sin = np.cos(pose[box, 2]), np.sin(pose[box, 2])
        return pose[box, :2] + (share * extent[box]) @ np.array([[cos, sin], [-sin, cos]])

    def holds(box: int, points: np.ndarray, slack: float) -> bool:
        cos, sin = np.cos(pose[box, 2]), np.sin(pose[box, 2])
        local = (points - pose[box, :2]) @ np.array([[cos, -sin], [sin, cos]])
        return bool((np.abs(local) <= extent[box] / 2 + slack).all(axis=-1).any())

    touch = bool(boxes_touch(pose[:1], extent[:1], pose[1:], extent[1:])[0])
    if holds(0, corners(1), 0.0):
        assert touch
    if touch:
        assert holds(0, corners(1), 0.1)  # the grid of points is 0.085 m at its widest


def test_overlaps_finds_the_moment_two_meet(boxes: tuple[Prototype, ...]) -> None:
    still = np.zeros((2, 4))
    ego = Trajectory(time_s=np.array([0.0, 10.0]), state=still, rate=still)
    coming = np.array([[50.0, 0, 0, 0], [-50.0, 0, 0, 0]])
    track = Trajectory(
        time_s=np.array([0.0, 10.0]), state=coming, rate=np.array([[-10.0, 0, 0, 0], [-10.0, 0, 0, 0]])
    )
    car = Mover(instance=1, prototype=boxes[0], track=track)
    found = overlaps(ego, [car], ego_extent_m=EGO_EXTENT_M, duration_s=10.0)
    # Bumpers meet when the middles are (4.8 + 4.4) / 2 = 4.6 m apart: at 4.54 s, and part at 5.46 s.
    assert_allclose([found.time_s.min(), found.time_s.max()], [4.6, 5.4], atol=1e-9)
    assert set(found.first) == {-1}
    assert set(found.second) == {0}
