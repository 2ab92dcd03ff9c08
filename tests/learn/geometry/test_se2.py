"""Poses in the plane are a group, and act on points as one."""

import math

import torch
from hypothesis import given
from hypothesis import strategies as st
from numpy.testing import assert_allclose

from echoscape.learn.geometry.se2 import STILL, PlaneMotion, plane_motion_of

MOTIONS = st.builds(
    PlaneMotion,
    x_m=st.floats(-50, 50),
    y_m=st.floats(-50, 50),
    yaw_rad=st.floats(-3.1, 3.1),
)
POINTS = torch.tensor([[[3.0, -4.0], [0.0, 7.0], [-20.0, 1.0]]], dtype=torch.float64)


def same(first: PlaneMotion, second: PlaneMotion) -> None:
    assert_allclose([first.x_m, first.y_m], [second.x_m, second.y_m], atol=1e-9)
    assert abs(math.remainder(first.yaw_rad - second.yaw_rad, 2 * math.pi)) < 1e-9


@given(motion=MOTIONS)
def test_there_and_back_is_no_motion(motion: PlaneMotion) -> None:
    same(motion.then(motion.inverse()), STILL)
    same(motion.inverse().then(motion), STILL)


@given(first=MOTIONS, second=MOTIONS, third=MOTIONS)
def test_motions_come_in_any_brackets(first: PlaneMotion, second: PlaneMotion, third: PlaneMotion) -> None:
    same(first.then(second).then(third), first.then(second.then(third)))


@given(first=MOTIONS, second=MOTIONS)
def test_points_go_through_one_motion_after_the_other(first: PlaneMotion, second: PlaneMotion) -> None:
    assert_allclose(
        first.then(second).of_points(POINTS), first.of_points(second.of_points(POINTS)), atol=1e-9
    )


@given(motion=MOTIONS)
def test_tensors_say_the_same(motion: PlaneMotion) -> None:
    same(plane_motion_of(motion.tensors(torch.float64)), motion)
    assert motion.length_m == math.hypot(motion.x_m, motion.y_m)


def test_a_quarter_clockwise_takes_ahead_to_the_right() -> None:
    quarter = PlaneMotion(x_m=1.0, y_m=0.0, yaw_rad=math.pi / 2)
    assert_allclose(quarter.of_points(torch.tensor([[[2.0, 0.0]]])), [[[1.0, 2.0]]], atol=1e-6)
    same(quarter.times(0.5), PlaneMotion(x_m=0.5, y_m=0.0, yaw_rad=math.pi / 4))
