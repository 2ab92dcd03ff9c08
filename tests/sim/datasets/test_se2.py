"""SE(2) is a group that acts on points, in Oxford axes: x forward, y right, yaw clockwise."""

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from numpy.testing import assert_allclose

from echoscape.sim.datasets.se2 import (
    IDENTITY,
    SE2,
    chain,
    compose,
    exp,
    from_world,
    inverse,
    log,
    relative,
    relative_from_world,
    to_world,
    transform,
    wrapped,
)

QUARTER = math.pi / 2
POSES = st.builds(SE2, x_m=st.floats(-50, 50), y_m=st.floats(-50, 50), yaw_rad=st.floats(-3.1, 3.1))
ARRAYS = POSES.map(lambda pose: pose.array)
POINTS = np.array([[3.0, -4.0], [0.0, 7.0], [-20.0, 1.0]])


def same(first: SE2, second: SE2) -> None:
    assert_allclose([first.x_m, first.y_m], [second.x_m, second.y_m], atol=1e-9)
    assert abs(math.remainder(first.yaw_rad - second.yaw_rad, 2 * math.pi)) < 1e-9


# ---------------------------------------------------------------------- a group


@given(pose=POSES)
def test_a_pose_and_its_inverse_make_the_identity(pose: SE2) -> None:
    same(pose @ pose.inverse(), IDENTITY)
    same(pose.inverse() @ pose, IDENTITY)


@given(first=POSES, second=POSES, third=POSES)
def test_composition_is_associative(first: SE2, second: SE2, third: SE2) -> None:
    same((first @ second) @ third, first @ (second @ third))


@given(first=ARRAYS, second=ARRAYS)
def test_points_are_mapped_by_one_pose_after_the_other(first: np.ndarray, second: np.ndarray) -> None:
    assert_allclose(
        transform(compose(first, second), POINTS), transform(first, transform(second, POINTS)), atol=1e-9
    )


@given(first=ARRAYS, second=ARRAYS)
def test_the_relative_pose_leads_from_one_pose_to_the_other(first: np.ndarray, second: np.ndarray) -> None:
    same(SE2.from_array(compose(first, relative(first, second))), SE2.from_array(second))
    same(SE2.from_array(relative(first, second)), SE2.from_array(inverse(first)) @ SE2.from_array(second))


@given(first=ARRAYS, second=ARRAYS)
def test_arrays_of_poses_are_composed_one_by_one(first: np.ndarray, second: np.ndarray) -> None:
    both = compose([first, second], [second, first])
    assert_allclose(both, [compose(first, second), compose(second, first)])


# ---------------------------------------------------------------------- axes


def test_a_right_angle_clockwise_takes_ahead_to_the_right() -> None:
    assert_allclose(transform([1.0, 0.0, QUARTER], [2.0, 0.0]), [1.0, 2.0], atol=1e-15)


def test_right_turns_drive_a_square_clockwise() -> None:
    # Ten metres ahead, then a right angle to the right, four times: back at the start.
    poses = chain([[10.0, 0.0, QUARTER]] * 4)
    assert_allclose(poses[:, :2], [[0, 0], [10, 0], [10, 10], [0, 10], [0, 0]], atol=1e-12)
    assert_allclose(poses[:, 2], np.arange(5) * QUARTER)


def test_a_motion_is_in_the_axes_of_the_earlier_pose() -> None:
    # Facing right after the first motion, a metre ahead is a metre to the right of the start.
    assert_allclose(chain([[0.0, 0.0, QUARTER], [1.0, 0.0, 0.0]])[-1], [0, 1, QUARTER], atol=1e-15)
    # And a metre to the car's right is a metre behind the start.
    assert_allclose(chain([[0.0, 0.0, QUARTER], [0.0, 1.0, 0.0]])[-1], [-1, 0, QUARTER], atol=1e-15)


def test_driving_straight_on_northward_moves_along_positive_x() -> None:
    north = np.array([3.0, -4.0, 0.0, QUARTER])
    assert_allclose(relative_from_world(north, north + np.array([0, 2, 0, 0])).array, [2, 0, 0], atol=1e-12)


def test_a_right_turn_of_an_eastward_car_moves_to_positive_y_and_yaw() -> None:
    # Heading east, right is south; a right turn makes the counter-clockwise world yaw smaller.
    east = np.array([100.0, 50.0, 0.0, 0.0])
    later = east + np.array([1, -0.5, 0, -0.1])
    assert_allclose(relative_from_world(east, later).array, [1, 0.5, 0.1], atol=1e-12)


@given(pose=ARRAYS)
def test_world_and_oxford_axes_convert_both_ways(pose: np.ndarray) -> None:
    assert_allclose(from_world(to_world(pose)), pose)
    world = to_world(pose)
    assert (world[0], world[1], world[3]) == (pose[0], -pose[1], -pose[2])


# ---------------------------------------------------------------------- numbers


@given(yaw=st.floats(-3.14, 3.14), turns=st.integers(-5, 5))
def test_angles_are_reduced_by_whole_turns_and_otherwise_kept(yaw: float, turns: int) -> None:
    assert wrapped(yaw) == yaw
    assert float(wrapped(yaw + 2 * math.pi * turns)) == pytest.approx(yaw, abs=1e-12)


@given(first=POSES, second=POSES)
def test_the_yaw_of_a_product_lies_within_half_a_turn(first: SE2, second: SE2) -> None:
    assert abs((first @ second).yaw_rad) <= math.pi


def test_a_chain_needs_finite_motions() -> None:
    with pytest.raises(ValueError, match=r"motions must be finite \(pairs, 3\), got shape \(4, 2\)"):
        chain(np.zeros((4, 2)))
    with pytest.raises(ValueError, match="not finite"):
        chain([[math.nan, 0, 0]])
    assert_allclose(chain(np.zeros((0, 3))), np.zeros((1, 3)))


def test_length_and_scaling() -> None:
    assert SE2(x_m=3.0, y_m=-4.0, yaw_rad=1.0).length_m == 5.0
    assert SE2(x_m=1.0, y_m=0.0, yaw_rad=0.5).scaled(0.5) == SE2(x_m=0.5, y_m=0.0, yaw_rad=0.25)


# ---------------------------------------------------------------------- exponential and logarithm


@given(pose=ARRAYS)
def test_the_exponential_undoes_the_logarithm(pose: np.ndarray) -> None:
    assert_allclose(exp(log(pose)), pose, atol=1e-7)


@given(x=st.floats(-20, 20), y=st.floats(-20, 20), yaw=st.floats(-3, 3))
def test_the_exponential_is_the_limit_of_many_small_motions(x: float, y: float, yaw: float) -> None:
    steps = 4000
    small = np.array([x, y, yaw]) / steps
    assert_allclose(exp(np.array([x, y, yaw])), chain(np.tile(small, (steps, 1)))[-1], atol=0.05)


@pytest.mark.parametrize("yaw", [0.0, 1e-9, 0.9e-4, 1.1e-4])
def test_series_and_quotients_agree_about_a_yaw_of_0(yaw: float) -> None:
    # To first order the path is straight and leaves the axis by half the yaw times its length.
    assert_allclose(exp(np.array([10.0, 0.0, yaw])), [10.0, 5.0 * yaw, yaw], atol=1e-7)
    assert_allclose(log(np.array([10.0, 0.0, yaw])), [10.0, -5.0 * yaw, yaw], atol=1e-7)


def test_a_quarter_circle_has_its_radius() -> None:
    # Arc length r pi / 2 with a right angle to the right ends r ahead and r to the right.
    assert_allclose(exp(np.array([3.0 * QUARTER, 0.0, QUARTER])), [3.0, 3.0, QUARTER], atol=1e-12)
