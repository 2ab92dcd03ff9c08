from dataclasses import replace

import numpy as np
import pytest

from echoscape.scenes.core.attitude import Attitude
from echoscape.scenes.core.trajectory import Trajectory
from echoscape.sim.kinematics.rolling_scan import (
    TILT_CENTRE_M,
    Revolution,
    azimuth_poses,
    mover_states,
    revolutions,
)
from echoscape.sim.sensor.cts350x import CTS350X
from tests.sim.worlds import box_prototype, mover, straight


def test_turns_last_as_long_as_the_real_ones_and_do_not_depend_on_how_many_are_asked_for() -> None:
    few, many = (revolutions(CTS350X, scans=n, rng=np.random.default_rng(1)) for n in (5, 2000))
    assert few == many[:5]
    starts = np.array([revolution.start_s for revolution in many])
    between = np.diff(starts)
    assert 0.2465 < between.min() < 0.2485  # measured frame to frame: 247-253 ms
    assert 0.2515 < between.max() < 0.2535
    np.testing.assert_allclose(
        between, [revolution.azimuth_period_s * 400 for revolution in many[:-1]], rtol=1e-9
    )


def test_rows_have_the_pose_of_their_own_time() -> None:
    ride = straight([3.0, 4.0], [10.0, -2.0])
    revolution = Revolution(start_s=1.0, azimuth_period_s=0.000625, azimuths=400)
    poses = azimuth_poses(ride.trajectory, revolution, height_m=2.0)
    expected = np.array([3.0, 4.0, 2.0]) + revolution.times_s[:, None] * [10.0, -2.0, 0.0]
    np.testing.assert_allclose(poses.position, expected, atol=1e-9)
    np.testing.assert_allclose(poses.velocity, np.tile([10.0, -2.0, 0.0], (400, 1)), atol=1e-9)


def test_without_distortion_all_rows_stand_at_mid_scan() -> None:
    revolution = Revolution(start_s=1.0, azimuth_period_s=0.000625, azimuths=400)
    poses = azimuth_poses(straight([0, 0], [10.0, 0]).trajectory, revolution, height_m=2.0, distortion=False)
    assert np.ptp(poses.position, axis=0) == pytest.approx(0)
    assert poses.position[0, 0] == pytest.approx(10 * (1.0 + 0.000625 * 399 / 2))
    assert poses.velocity[0, 0] == pytest.approx(10.0)


def swaying(yaw_rate: float = 0.4) -> Trajectory:
    """A car in a bend whose body pitches and rolls."""
    time_s = np.linspace(0.0, 4.0, 401)
    angle = np.stack([0.05 * np.sin(6 * time_s), 0.08 * np.cos(4 * time_s)], axis=1)
    rate = np.stack([0.3 * np.cos(6 * time_s), -0.32 * np.sin(4 * time_s)], axis=1)
    track = straight([3.0, 4.0], [10.0, -2.0]).trajectory
    state, rates = track.state.copy(), track.rate.copy()
    state[1, 3] += 100 * yaw_rate
    rates[:, 3] = yaw_rate
    attitude = Attitude(time_s=time_s, angle_rad=angle, rate_rps=rate)
    return replace(track, state=state, rate=rates, attitude=attitude)


def test_antenna_stands_on_the_axis_of_the_tilted_body() -> None:
    revolution = Revolution(start_s=1.0, azimuth_period_s=0.000625, azimuths=400)
    track = swaying()
    poses = azimuth_poses(track, revolution, height_m=2.0)
    np.testing.assert_array_equal(poses.tilt, track.tilt(revolution.times_s))
    centre = track.pose(revolution.times_s)[:, :3] + [0, 0, TILT_CENTRE_M]
    np.testing.assert_allclose(poses.position, centre + (2.0 - TILT_CENTRE_M) * poses.axes[:, 2], atol=1e-12)


def test_velocity_of_the_antenna_is_the_derivative_of_its_position() -> None:
    times = Revolution(start_s=1.0, azimuth_period_s=0.000625, azimuths=400)
    near = Revolution(start_s=1.0 + 1e-5, azimuth_period_s=0.000625, azimuths=400)
    before, after = (azimuth_poses(swaying(), each, height_m=2.0) for each in (times, near))
    change = (after.position - before.position) / 1e-5
    np.testing.assert_allclose((before.velocity + after.velocity) / 2, change, atol=1e-5)


def test_strength_of_attitude_scales_the_angles() -> None:
    revolution = Revolution(start_s=1.0, azimuth_period_s=0.000625, azimuths=400)
    whole, half, level = (
        azimuth_poses(swaying(), revolution, height_m=2.0, attitude=strength) for strength in (1.0, 0.5, 0.0)
    )
    np.testing.assert_allclose(half.tilt, whole.tilt / 2)
    plain = azimuth_poses(replace(swaying(), attitude=None), revolution, height_m=2.0)
    np.testing.assert_array_equal(level.position, plain.position)
    np.testing.assert_array_equal(level.velocity, plain.velocity)
    assert not level.tilt.any()


def test_without_distortion_the_attitude_is_that_of_mid_scan() -> None:
    revolution = Revolution(start_s=1.0, azimuth_period_s=0.000625, azimuths=400)
    poses = azimuth_poses(swaying(), revolution, height_m=2.0, distortion=0.0)
    np.testing.assert_allclose(poses.tilt, np.tile(swaying().tilt(revolution.middle_s), (400, 1)))


def test_only_movers_within_reach_are_kept() -> None:
    box = box_prototype("box", (2.0, 2.0, 2.0), "metal")
    near, far = mover(1, box, straight([50, 0], [1, 0])), mover(2, box, straight([500, 0], [1, 0]))
    revolution = Revolution(start_s=0.0, azimuth_period_s=0.000625, azimuths=400)
    states = mover_states((near, far), revolution, near=np.zeros(3), reach_m=170)
    assert [each.instance for each in states.movers] == [1]
    assert states.state.shape == (1, 400, 4)
    assert mover_states((), revolution, near=np.zeros(3), reach_m=170).state.shape == (0, 400, 4)
