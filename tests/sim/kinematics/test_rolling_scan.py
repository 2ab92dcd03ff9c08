import numpy as np
import pytest

from echoscape.sim.kinematics.rolling_scan import Revolution, azimuth_poses, mover_states, revolutions
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


def test_only_movers_within_reach_are_kept() -> None:
    box = box_prototype("box", (2.0, 2.0, 2.0), "metal")
    near, far = mover(1, box, straight([50, 0], [1, 0])), mover(2, box, straight([500, 0], [1, 0]))
    revolution = Revolution(start_s=0.0, azimuth_period_s=0.000625, azimuths=400)
    states = mover_states((near, far), revolution, near=np.zeros(3), reach_m=170)
    assert [each.instance for each in states.movers] == [1]
    assert states.state.shape == (1, 400, 4)
    assert mover_states((), revolution, near=np.zeros(3), reach_m=170).state.shape == (0, 400, 4)
