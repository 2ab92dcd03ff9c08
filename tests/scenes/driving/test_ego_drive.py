"""Drives are smooth, keep to their lanes and move as the measured car did."""

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from numpy.testing import assert_allclose
from numpy.typing import NDArray
from scipy.spatial import KDTree

from echoscape.scenes.core.lane_graph import RoadGraph
from echoscape.scenes.driving.ego_drive import EgoDrive, plan_ego_drive


@pytest.fixture(scope="module")
def long_drives(town_roads: RoadGraph) -> list[EgoDrive]:
    return [plan_ego_drive(town_roads, seed=seed, length_m=9000) for seed in range(4)]


def _clock(drive: EgoDrive, step_s: float = 0.25) -> NDArray[np.float64]:
    return np.arange(0.0, drive.duration_s, step_s)


def _speed(drive: EgoDrive, time: NDArray[np.float64]) -> NDArray[np.float64]:
    return np.hypot(*drive.velocity(time)[:, :2].T)


@settings(max_examples=15, deadline=None)
@given(seed=st.integers(0, 2**32 - 1))
def test_velocity_is_the_derivative_of_pose(blocks: RoadGraph, seed: int) -> None:
    drive = plan_ego_drive(blocks, seed=seed, duration_s=40)
    time = np.linspace(0.01, 39.99, 3000)
    slope = (drive.pose(time + 1e-4) - drive.pose(time - 1e-4)) / 2e-4
    # Central differences are off by the jumps of acceleration at knots, some m/s2 times 1e-4 s.
    assert_allclose(slope, drive.velocity(time), atol=5e-4)


@pytest.mark.parametrize("seed", range(3))
def test_car_stays_in_its_lanes(town_roads: RoadGraph, seed: int) -> None:
    drive = plan_ego_drive(town_roads, seed=seed, length_m=2500)
    lanes = [town_roads.lanes[lane].centre for lane in drive.route.lanes]
    off, _ = KDTree(np.concatenate(lanes)).query(drive.pose(_clock(drive))[:, :2])
    assert off.max() < 0.6


def test_travel_locates_the_lane(blocks: RoadGraph) -> None:
    drive = plan_ego_drive(blocks, seed=5, length_m=800)
    time = _clock(drive, 1.0)
    place, _ = drive.route.locate(drive.travel(time))
    for lane, xy in zip(place, drive.pose(time)[:, :2], strict=True):
        centre = blocks.lanes[drive.route.lanes[lane]].centre
        assert np.hypot(*(centre - xy).T).min() < 0.9


def test_yaw_trails_the_course_by_the_slip_of_the_single_track_model(blocks: RoadGraph) -> None:
    drive = plan_ego_drive(blocks, seed=2, length_m=1500)
    time = _clock(drive, 0.1)
    velocity, yaw = drive.velocity(time), drive.pose(time)[:, 3]
    speed = np.hypot(*velocity[:, :2].T)
    moving = speed > 1.0
    course = np.arctan2(velocity[:, 1], velocity[:, 0])
    slip = np.angle(np.exp(1j * (course - yaw)))[moving]
    # The rear axle, 0.9 m behind, moves straight ahead: sideways speed of the middle = 0.9 m x yaw rate.
    assert_allclose(slip, 0.9 * velocity[moving, 3] / speed[moving], atol=5e-3)


def test_speed_statistics_are_near_the_measured_ones(long_drives: list[EgoDrive]) -> None:
    speed = np.concatenate([_speed(drive, _clock(drive)) for drive in long_drives])
    p25, p50, p75, p90, p99 = np.percentile(speed, [25, 50, 75, 90, 99])
    assert abs(p25 - 0.9) < 2.0  # steep there: 0.22 of the time the car stands
    assert abs(p50 - 4.4) < 1.2
    assert abs(p75 - 6.5) < 1.2
    assert abs(p90 - 8.0) < 1.2
    assert abs(p99 - 9.7) < 1.5
    assert speed.max() < 12.3  # the faster of the two measured drives
    assert 0.12 < (speed < 0.1).mean() < 0.32


def test_yaw_rate_statistics_are_near_the_measured_ones(long_drives: list[EgoDrive]) -> None:
    rate = np.degrees(np.concatenate([drive.velocity(_clock(drive))[:, 3] for drive in long_drives]))
    assert np.abs(rate).max() < 36
    low, p25, p75, high = np.percentile(rate, [1, 25, 75, 99])
    assert -26 < low < -15
    assert 15 < high < 26
    assert max(abs(p25), abs(p75)) < 2.0


def test_acceleration_and_slip_are_near_the_measured_ones(long_drives: list[EgoDrive]) -> None:
    drive = long_drives[0]
    time = _clock(drive)
    acceleration = np.diff(_speed(drive, time)) / 0.25
    low, high = np.percentile(acceleration, [1, 99])
    assert -2.6 < low < -1.5
    assert 1.5 < high < 3.0
    pose = drive.pose(time)
    step, yaw = np.diff(pose[:, :2], axis=0), pose[:-1, 3]
    aside = -np.sin(yaw) * step[:, 0] + np.cos(yaw) * step[:, 1]
    assert np.all(np.abs(np.percentile(aside, [1, 99])) < 0.2)
    jerk = np.diff(_speed(drive, _clock(drive, 0.1)), n=2) / 0.1**2
    assert np.abs(jerk).max() < 8.0


def test_lateral_acceleration_is_comfortable(long_drives: list[EgoDrive]) -> None:
    for drive in long_drives:
        velocity = drive.velocity(_clock(drive))
        lateral = np.hypot(*velocity[:, :2].T) * np.abs(velocity[:, 3])
        assert lateral.max() < 2.6


def test_speed_stays_below_the_limits(town_roads: RoadGraph, long_drives: list[EgoDrive]) -> None:
    for drive in long_drives[:2]:
        time = _clock(drive)
        place, _ = drive.route.locate(drive.travel(time))
        limit = np.array([town_roads.lanes[lane].speed_limit_mps for lane in drive.route.lanes])[place]
        street = np.array([town_roads.lanes[lane].kind == "street" for lane in drive.route.lanes])[place]
        assert np.all(_speed(drive, time)[street] < limit[street] + 0.5)


@pytest.mark.parametrize("seed", range(6))
def test_short_drives_move_from_the_start(town_roads: RoadGraph, seed: int) -> None:
    drive = plan_ego_drive(town_roads, seed=seed, duration_s=10)
    assert drive.duration_s == 10
    assert _speed(drive, np.linspace(0, 2, 9)).min() > 1.0
    assert drive.length_m > 10


def test_ten_metres_can_be_driven(blocks: RoadGraph) -> None:
    drive = plan_ego_drive(blocks, seed=4, length_m=10)
    time = np.linspace(0, drive.duration_s, 500)
    assert_allclose(np.hypot(*np.diff(drive.pose(time)[:, :2], axis=0).T).sum(), 10.0, atol=0.01)


def test_twenty_kilometres_can_be_driven(blocks: RoadGraph) -> None:
    drive = plan_ego_drive(blocks, seed=4, length_m=20_000)
    assert_allclose(drive.length_m, 20_000, atol=0.01)
    assert 3000 < drive.duration_s < 7000


def test_speed_follows_the_limit_on_fast_roads(straight: RoadGraph) -> None:
    lanes = tuple(replace(lane, speed_limit_mps=25.0) for lane in straight.lanes)
    drive = plan_ego_drive(replace(straight, lanes=lanes), seed=1, length_m=3000)
    assert 18.0 < _speed(drive, _clock(drive)).max() < 25.5


def test_same_seed_same_drive(blocks: RoadGraph) -> None:
    first, again, other = (plan_ego_drive(blocks, seed=seed, length_m=500) for seed in (7, 7, 8))
    assert first.trajectory.state.tobytes() == again.trajectory.state.tobytes()
    assert first.duration_s != other.duration_s


@pytest.mark.parametrize(
    ("name", "span"),
    [
        ("length_m", {"length_m": 9.0}),
        ("length_m", {"length_m": 20_001.0}),
        ("length_m", {"length_m": float("nan")}),
        ("duration_s", {"duration_s": 0.1}),
        ("duration_s", {"duration_s": 1e5}),
        ("exactly one", {}),
        ("exactly one", {"length_m": 100.0, "duration_s": 10.0}),
    ],
)
def test_refuses_spans_out_of_range(blocks: RoadGraph, name: str, span: dict[str, float]) -> None:
    with pytest.raises(ValueError, match=name):
        plan_ego_drive(blocks, seed=0, duration_s=span.get("duration_s"), length_m=span.get("length_m"))
