"""Motions by the precisions of matches."""

import math

import pytest
import torch
from torch import Tensor
from torch.testing import assert_close

from echoscape.learn.geometry.pose_refinement import motion_by_precision, turned_precision, weighed_squares
from echoscape.learn.geometry.procrustes import motion_of_matches, robust_motion, rotation_of_yaw
from echoscape.learn.geometry.se2 import to_motion, to_pose, transform
from echoscape.sim.datasets.se2 import SE2
from tests.learn.matrices import covariance_of


def test_a_square_is_the_same_in_any_frame() -> None:
    generator = torch.Generator().manual_seed(1)
    off = torch.randn(1, 5, 2, generator=generator)
    precision = torch.stack([covariance_of(1.0, 0.1, 0.3 * i).float() for i in range(5)])[None]
    rotation = rotation_of_yaw(torch.tensor([0.7]))
    found = weighed_squares(off @ rotation.transpose(1, 2), turned_precision(precision, rotation))
    assert_close(found, weighed_squares(off, precision))


def scene(motion: SE2, *, seed: int = 0) -> tuple[Tensor, Tensor, Tensor]:
    """Return sources and destinations (1, 60, 2) by a motion, and weights."""
    generator = torch.Generator().manual_seed(seed)
    source = 100 * (torch.rand(1, 60, 2, generator=generator) - 0.5)
    return source, transform(motion, source), torch.rand(1, 60, generator=generator) + 0.1


MOTION = SE2(x_m=1.2, y_m=-0.3, yaw_rad=0.05)


def test_exact_matches_give_the_exact_motion_whatever_their_precisions() -> None:
    source, destination, weights = scene(MOTION)
    precision = torch.stack([covariance_of(1.0, 0.02 + 0.01 * i, 0.1 * i).float() for i in range(60)])[None]
    found = motion_by_precision(source, destination, weights, precision, scale_m=0.7)
    assert bool(found.certain)
    for name in ("x_m", "y_m", "yaw_rad"):
        assert getattr(to_pose(found), name) == pytest.approx(getattr(MOTION, name), abs=1e-5)


def test_walls_that_slide_along_themselves_do_not_move_the_answer() -> None:
    source, destination, weights = scene(MOTION)
    slid = destination.clone()
    slid[:, :40, 0] += 0.4  # two in three are found too far ahead, along a wall ahead
    precision = torch.eye(2).expand(1, 60, 2, 2).clone()
    precision[:, :40, 0, 0] = 0.0
    found = to_pose(motion_by_precision(source, slid, weights, precision, scale_m=0.7))
    alike = to_pose(robust_motion(source, slid, weights, scale_m=0.7))
    assert found.x_m == pytest.approx(MOTION.x_m, abs=1e-4)
    assert abs(alike.x_m - MOTION.x_m) > 0.2


def test_precisions_of_one_give_the_robust_motion() -> None:
    source, destination, weights = scene(MOTION)
    destination = destination + 0.1 * torch.randn(
        destination.shape, generator=torch.Generator().manual_seed(3)
    )
    one = torch.eye(2).expand(1, 60, 2, 2)
    found = motion_by_precision(source, destination, weights, one, scale_m=0.7)
    wanted = robust_motion(source, destination, weights, scale_m=0.7)
    assert_close(found.translation_m, wanted.translation_m, atol=2e-4, rtol=0)
    assert_close(found.yaw_rad, wanted.yaw_rad, atol=1e-5, rtol=0)


def test_wrong_matches_do_not_count() -> None:
    source, destination, weights = scene(MOTION)
    destination[:, :15] += torch.tensor([6.0, -9.0])
    one = torch.eye(2).expand(1, 60, 2, 2)
    found = to_pose(motion_by_precision(source, destination, weights, one, scale_m=0.7))
    assert found.x_m == pytest.approx(MOTION.x_m, abs=5e-3)
    assert found.yaw_rad == pytest.approx(MOTION.yaw_rad, abs=1e-3)


@pytest.mark.parametrize("left", ["everything", "forward"])
def test_directions_without_precision_are_uncertain_and_finite(left: str) -> None:
    source, destination, weights = scene(MOTION)
    precision = torch.zeros(1, 60, 2, 2)
    if left == "forward":  # all on a line to the right, with precisions to the right alone
        precision[..., 1, 1] = 1.0
        source[..., 0] = destination[..., 0] = 0.0
    found = motion_by_precision(source, destination, weights, precision, scale_m=0.7)
    assert not bool(found.certain)
    assert bool(found.translation_m.isfinite().all() and found.rotation.isfinite().all())


def test_without_a_scale_all_matches_count_by_their_precision_alone() -> None:
    source, destination, weights = scene(MOTION)
    destination[:, :15] += torch.tensor([6.0, -9.0])
    precision = torch.eye(2).expand(1, 60, 2, 2).clone()
    precision[:, :15] = 0.0
    found = motion_by_precision(source, destination, weights, precision, scale_m=None)
    assert to_pose(found).x_m == pytest.approx(MOTION.x_m, abs=1e-4)
    one = torch.eye(2).expand(1, 60, 2, 2)
    every = motion_by_precision(source, destination, weights, one, scale_m=None)
    wanted = motion_of_matches(source, destination, weights)
    assert_close(every.translation_m, wanted.translation_m, atol=1e-3, rtol=0)


def test_a_motion_to_begin_with_decides_which_of_two_is_found() -> None:
    """Half of the matches have one motion, a few less another 3 m off: each is a local minimum."""
    source, destination, _ = scene(MOTION)
    destination[:, :28, 0] += 3.0
    one, weights = torch.eye(2).expand(1, 60, 2, 2), torch.ones(1, 60)
    other = SE2(x_m=MOTION.x_m + 2.8, y_m=MOTION.y_m, yaw_rad=MOTION.yaw_rad)
    alone = motion_by_precision(source, destination, weights, one, scale_m=0.5)
    begun = motion_by_precision(source, destination, weights, one, scale_m=0.5, near=to_motion(other))
    assert to_pose(alone).x_m == pytest.approx(MOTION.x_m, abs=0.1)
    assert to_pose(begun).x_m == pytest.approx(MOTION.x_m + 3, abs=0.1)


def test_matches_that_are_not_finite_leave_the_motion_open() -> None:
    source, destination, weights = scene(MOTION)
    destination[0, 3, 0] = math.nan
    one = torch.eye(2).expand(1, 60, 2, 2)
    assert not bool(motion_by_precision(source, destination, weights, one, scale_m=0.7).certain)
