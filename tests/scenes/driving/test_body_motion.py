"""A car body dives, squats, leans and settles on its springs, and moves as much as that of real cars."""

import math
from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from numpy.testing import assert_allclose, assert_array_equal
from numpy.typing import NDArray
from scipy.special import k1

from echoscape.scenes.core.attitude import Attitude
from echoscape.scenes.core.lane_graph import RoadGraph
from echoscape.scenes.core.trajectory import Trajectory
from echoscape.scenes.driving.body_motion import CarBody, with_body_motion
from echoscape.scenes.driving.ego_drive import DriveSettings, plan_ego_drive
from echoscape.scenes.roads.motorway import motorway
from echoscape.scenes.town.build import road_network
from echoscape.scenes.town.presets import PRESETS

CAR = CarBody()


def driven(
    time_s: NDArray[np.float64], speed_mps: NDArray[np.float64], yaw_rate_rps: float = 0.0
) -> Trajectory:
    """A car that drives at given speeds, straight or turning evenly to the left."""
    yaw = yaw_rate_rps * (time_s - time_s[0])
    rate = np.stack(
        [speed_mps * np.cos(yaw), speed_mps * np.sin(yaw), 0 * yaw, 0 * yaw + yaw_rate_rps], axis=1
    )
    steps = (rate[1:] + rate[:-1]) / 2 * np.diff(time_s)[:, None]
    state = np.concatenate([[np.zeros(4)], np.cumsum(steps, axis=0)])
    return Trajectory(time_s=time_s, state=state, rate=rate)


def smooth(track: Trajectory) -> Trajectory:
    return with_body_motion(track, seed=1, roughness_m3=0.0)


def test_gradients_are_those_of_passenger_cars() -> None:
    # Milliken & Milliken, Race Car Vehicle Dynamics, 1995, ch. 16: saloons roll by 4 to 8 deg per g.
    assert 4.0 < math.degrees(CAR.roll_gradient * 9.81) < 8.0
    assert 1.5 < math.degrees(CAR.pitch_gradient * 9.81) < 3.5


@settings(deadline=None)  # the first one imports scipy.signal
@given(seed=st.integers(0, 2**31), roughness_m3=st.floats(0, 4e-3), yaw=st.floats(-3, 3))
def test_standing_car_stays_level(seed: int, roughness_m3: float, yaw: float) -> None:
    place = np.array([3.0, -7.0, 0.0, yaw])
    still = Trajectory(time_s=np.array([0.0, 8.0]), state=np.array([place, place]), rate=np.zeros((2, 4)))
    moved = with_body_motion(still, seed=seed, roughness_m3=roughness_m3)
    assert not moved.tilt(np.linspace(0, 8, 100)).any()
    assert not moved.tilt_rate(np.linspace(0, 8, 100)).any()


@pytest.mark.parametrize(("acceleration", "sign"), [(-2.0, -1), (1.5, 1)])
def test_nose_dives_when_braking_and_rises_when_speeding_up(acceleration: float, sign: int) -> None:
    time_s = np.linspace(0, 6, 121)
    track = smooth(driven(time_s, 14.0 + acceleration * time_s))
    pitch, roll = track.tilt(6.0)
    assert np.sign(pitch) == sign
    assert pitch == pytest.approx(CAR.pitch_gradient * acceleration, rel=1e-3)
    assert roll == 0


@pytest.mark.parametrize("yaw_rate", [0.3, -0.2])
def test_body_leans_out_of_the_bend(yaw_rate: float) -> None:
    time_s = np.linspace(0, 8, 801)
    track = smooth(driven(time_s, np.full_like(time_s, 9.0), yaw_rate))
    pitch, roll = track.tilt(7.0)
    # To the left, the right side goes down; v times yaw rate is the lateral acceleration.
    assert roll == pytest.approx(CAR.roll_gradient * 9.0 * yaw_rate, rel=1e-3)
    assert abs(pitch) < 1e-6


def test_body_swings_and_settles_as_its_springs_and_dampers_do() -> None:
    # It brakes at 3 m/s^2 and stands from 4 s on.
    time_s = np.append(np.linspace(0, 4, 401), np.linspace(4.01, 12, 800))
    track = smooth(driven(time_s, np.maximum(12.0 - 3.0 * time_s, 0.0)))
    fine = np.linspace(4.05, 12.0, 79_501)
    pitch = track.tilt(fine)[:, 0]
    peaks = np.flatnonzero(
        (np.abs(pitch[1:-1]) > np.abs(pitch[:-2])) & (np.abs(pitch[1:-1]) >= np.abs(pitch[2:]))
    )
    first, second, third = peaks[:3] + 1
    root = math.sqrt(1 - CAR.damping**2)
    assert fine[third] - fine[first] == pytest.approx(1 / (CAR.pitch_hz * root), rel=3e-3)
    overshoot = math.exp(-math.pi * CAR.damping / root)
    assert -pitch[second] / pitch[first] == pytest.approx(overshoot, rel=5e-3)
    assert abs(pitch[-1]) < 1e-6


@pytest.mark.parametrize(("speed_mps", "roughness_m3"), [(6.0, 256e-6), (20.0, 64e-6)])
def test_roughness_moves_the_body_as_its_transfer_function_says(
    speed_mps: float, roughness_m3: float
) -> None:
    time_s = np.linspace(0, 6000, 3001)
    track = driven(time_s, np.full_like(time_s, speed_mps))
    moved = with_body_motion(track, seed=5, roughness_m3=roughness_m3)
    found = np.std(moved.tilt(np.arange(60.0, 6000.0, 0.05)), axis=0)
    n = np.geomspace(1e-4, 3.0, 20_000)
    slope = (2 * np.pi * 0.1) ** 2 * roughness_m3 * n**2 / (n**2 + 0.01**2)  # one-sided, of one track
    x = 2 * np.pi * n * CAR.track_m
    coherence = x * k1(x)
    front_to_rear = np.sinc(n * CAR.wheelbase_m) ** 2
    expected = []
    for hertz, density in (
        (CAR.pitch_hz, slope * (1 + coherence) / 2 * front_to_rear),
        (CAR.roll_hz, 2 * slope * (1 - coherence) / x**2 * np.cos(np.pi * n * CAR.wheelbase_m) ** 2),
    ):
        r = n * speed_mps / hertz
        gain = (1 + (2 * CAR.damping * r) ** 2) / ((1 - r**2) ** 2 + (2 * CAR.damping * r) ** 2)
        expected.append(math.sqrt(np.trapezoid(density * gain, n)))
    # 36 and 120 km: 3 % by chance, 4 % by the rational form of the coherence.
    assert_allclose(found, expected, rtol=0.09)


def roads_of(preset: str) -> RoadGraph:
    if preset == "motorway":
        return motorway(rng=np.random.default_rng(4), margin_m=60.0).roads
    return road_network(PRESETS[preset], seed=4)[1]


def deviation_deg(track: Trajectory, until_s: float) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Standard deviation and 99 % quantile of pitch and roll at 4 Hz, less their mean over 10 s [deg]."""
    angle = np.degrees(track.tilt(np.arange(0, until_s, 0.25)))
    window = np.ones(41) / 41
    slow = np.stack([np.convolve(each, window, "valid") for each in angle.T], axis=1)
    fast = angle[20:-20] - slow
    return fast.std(axis=0), np.quantile(np.abs(fast), 0.99, axis=0)


@pytest.mark.parametrize("preset", ["town", "suburb", "industrial", "motorway", "open", "empty", "yard"])
def test_pitch_and_roll_are_those_of_real_cars_on_flat_roads(preset: str) -> None:
    # Flat places of HeRCULES: pitch 0.26-0.44 deg, 99 % 0.7-1.7; roll 0.22-0.46 deg, 99 % 0.6-1.5.
    roads = roads_of(preset)
    found = [
        deviation_deg(plan_ego_drive(roads, seed=seed, duration_s=600).trajectory, 600.0) for seed in range(4)
    ]
    (pitch, roll), (pitch_99, roll_99) = np.mean(found, axis=0)
    assert 0.29 < pitch < 0.45
    assert 0.25 < roll < 0.37
    assert 0.8 < pitch_99 < 1.5
    assert 0.8 < roll_99 < 1.4


def test_rough_roads_give_the_attitude_of_a_campus_with_speed_bumps(town_roads: RoadGraph) -> None:
    rough = DriveSettings(road_roughness=12.0)
    drive = plan_ego_drive(town_roads, seed=1, duration_s=600, settings=rough)
    (pitch, roll), (pitch_99, roll_99) = deviation_deg(drive.trajectory, 600.0)
    assert 0.8 < pitch < 1.26
    assert 0.7 < roll < 1.1
    assert 3.0 < pitch_99 < 6.0
    assert 2.8 < roll_99 < 4.5


def test_attitude_so_far_does_not_depend_on_how_long_the_drive_lasts(town_roads: RoadGraph) -> None:
    track = plan_ego_drive(town_roads, seed=3, duration_s=40).trajectory
    until = int(np.searchsorted(track.time_s, 20.0)) + 1
    short = Trajectory(time_s=track.time_s[:until], state=track.state[:until], rate=track.rate[:until])
    long, cut = (
        with_body_motion(replace(each, attitude=None), seed=3, roughness_m3=3e-4) for each in (track, short)
    )
    times = np.linspace(0, 19.9, 500)
    assert_array_equal(long.tilt(times), cut.tilt(times))


def test_seed_decides_the_road() -> None:
    track = driven(np.linspace(0, 10, 11), np.full(11, 8.0))
    one, same, other = (with_body_motion(track, seed=seed, roughness_m3=3e-4).tilt(9.0) for seed in (1, 1, 2))
    assert_array_equal(one, same)
    assert (one != other).all()


def test_attitude_that_is_known_is_kept() -> None:
    known = Attitude(time_s=np.array([0.0, 9.0]), angle_rad=np.full((2, 2), 0.02), rate_rps=np.zeros((2, 2)))
    track = replace(driven(np.linspace(0, 9, 10), np.full(10, 8.0)), attitude=known)
    assert with_body_motion(track, seed=1, roughness_m3=1e-3) is track


def test_hard_manoeuvres_stay_within_the_grip_of_the_tyres() -> None:
    track = smooth(driven(np.array([0.0, 1.0, 1.1, 4.0]), np.array([90.0, 90.0, 0.0, 0.0])))
    pitch = track.tilt(np.linspace(0, 4, 400))[:, 0]
    assert np.abs(pitch).max() < 2 * 9.81 * CAR.pitch_gradient


def test_body_out_of_range_is_refused_by_name() -> None:
    with pytest.raises(ValueError, match=r"damping must be between 0\.05 and 1, got 0"):
        CarBody(damping=0.0)
