"""Planar motions as tensors agree with the NumPy poses that they are made of."""

import math

import torch
from hypothesis import given
from hypothesis import strategies as st
from numpy.testing import assert_allclose

from echoscape.learn.geometry.se2 import relative, to_motion, to_pose, transform
from echoscape.sim.datasets import se2
from echoscape.sim.datasets.se2 import SE2

POSES = st.builds(SE2, x_m=st.floats(-50, 50), y_m=st.floats(-50, 50), yaw_rad=st.floats(-3.1, 3.1))
POINTS = torch.tensor([[[3.0, -4.0], [0.0, 7.0], [-20.0, 1.0]]], dtype=torch.float64)


@given(pose=POSES)
def test_a_pose_survives_the_way_to_tensors_and_back(pose: SE2) -> None:
    assert_allclose(to_pose(to_motion(pose, torch.float64)).array, pose.array, atol=1e-12)


@given(first=POSES, second=POSES)
def test_a_batch_holds_the_poses_in_their_order(first: SE2, second: SE2) -> None:
    batch = to_motion([first, second], torch.float64)
    assert_allclose(batch.translation_m, [[first.x_m, first.y_m], [second.x_m, second.y_m]])
    assert_allclose(batch.yaw_rad, [first.yaw_rad, second.yaw_rad], atol=1e-12)
    assert batch.certain.all()


@given(pose=POSES)
def test_points_are_mapped_as_in_numpy(pose: SE2) -> None:
    assert_allclose(transform(pose, POINTS), se2.transform(pose.array, POINTS.numpy()), atol=1e-9)


@given(first=POSES, second=POSES)
def test_relative_motions_are_those_of_numpy(first: SE2, second: SE2) -> None:
    found = to_pose(relative(to_motion(first, torch.float64), to_motion(second, torch.float64)))
    expected = SE2.from_array(se2.relative(first.array, second.array))
    assert_allclose([found.x_m, found.y_m], [expected.x_m, expected.y_m], atol=1e-9)
    assert abs(math.remainder(found.yaw_rad - expected.yaw_rad, 2 * math.pi)) < 1e-9


@given(pose=POSES)
def test_exponential_and_logarithm_of_tensors_are_those_of_numpy(pose: SE2) -> None:
    tensor = torch.as_tensor(pose.array)
    assert_allclose(se2.exp(tensor, xp=torch), se2.exp(pose.array), rtol=1e-12, atol=1e-12)
    assert_allclose(se2.log(tensor, xp=torch), se2.log(pose.array), rtol=1e-12, atol=1e-12)
