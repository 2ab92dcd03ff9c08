"""Precisions of matches: an expectation is taken out exactly; motions are found by what matches do say."""

import math

import pytest
import torch
from hypothesis import given, settings
from hypothesis import strategies as st
from torch import Tensor
from torch.testing import assert_close

from echoscape.learn.geometry.pose_refinement import motion_by_precision, turned_precision, weighed_squares
from echoscape.learn.geometry.procrustes import motion_of_matches, robust_motion, rotation_of_yaw
from echoscape.learn.geometry.se2 import to_motion, to_pose, transform
from echoscape.learn.model.feature_pyramid import FeaturePyramid
from echoscape.learn.model.keypoint_model import unit
from echoscape.learn.model.local_matching import Moments, Near, match_local
from echoscape.learn.model.prior_removal import precision_of_pixels, remove_prior
from echoscape.sim.datasets.se2 import SE2
from tests.learn.maps import drawn_maps

SHARPEST_PX = 0.7


def covariance(first: float, second: float, angle: float) -> Tensor:
    """Return a 2 x 2 matrix with these eigenvalues, the first along `angle`."""
    axes = rotation_of_yaw(torch.tensor([angle], dtype=torch.float64))[0]
    return axes @ torch.diag(torch.tensor([first, second], dtype=torch.float64)) @ axes.T


def moments(place: Tensor, spread: Tensor) -> Moments:
    return Moments(places_px=place[None, None], spread_px2=spread[None, None])


@settings(max_examples=50, deadline=None)
@given(
    first=st.floats(0.3, 3.0),
    second=st.floats(0.3, 3.0),
    angle=st.floats(0, math.pi),
    place=st.tuples(st.floats(-2, 2), st.floats(-2, 2)),
    deviation=st.floats(2.0, 5.0),
)
def test_what_was_expected_is_taken_out_of_normal_distributions_exactly(
    first: float, second: float, angle: float, place: tuple[float, float], deviation: float
) -> None:
    own, mean = covariance(first, second, angle), torch.tensor(place, dtype=torch.float64)
    expected = torch.tensor([0.5, -1.0], dtype=torch.float64)
    prior = covariance(deviation**2, 0.8 * deviation**2, 0.3)
    spread = torch.linalg.inv(torch.linalg.inv(own) + torch.linalg.inv(prior))  # of their product
    found = spread @ (torch.linalg.inv(own) @ mean + torch.linalg.inv(prior) @ expected)
    places, precision = remove_prior(moments(found, spread), moments(expected, prior))
    assert_close(places[0, 0], mean, atol=1e-9, rtol=0)
    wanted = SHARPEST_PX**2 * torch.linalg.inv(own + SHARPEST_PX**2 * torch.eye(2, dtype=torch.float64))
    assert_close(precision[0, 0], wanted, atol=1e-9, rtol=0)


@pytest.mark.parametrize(("share", "says"), [(0.95, False), (0.85, True)])
def test_what_is_nearly_as_wide_as_the_expectation_says_nothing(share: float, says: bool) -> None:
    """A spread of 0.85 adds 0.18 of what was known, one of 0.95 adds 0.05; the limit is a tenth."""
    found = moments(torch.tensor([3.0, 1.0]), torch.diag(torch.tensor([4.0 * share, 0.2])))
    places, precision = remove_prior(found, moments(torch.zeros(2), 4 * torch.eye(2)))
    assert (float(precision[0, 0, 0, 0]) > 0) == says
    assert (float(places[0, 0, 0]) > 0) == says  # else it is where it was expected, whatever was found
    assert places[0, 0, 1] > 1.0
    assert precision[0, 0, 1, 1] > 0.5


def test_a_spread_alike_in_all_directions_has_a_precision_alike_in_all() -> None:
    found = moments(torch.zeros(2), 0.5 * torch.eye(2))
    _, precision = remove_prior(found, moments(torch.zeros(2), 9 * torch.eye(2)))
    assert_close(precision[0, 0], precision[0, 0, 0, 0] * torch.eye(2))


@pytest.mark.parametrize("stride", [1, 2])
@pytest.mark.parametrize("deviation_px", [0.2, 1.0, 4.0])
def test_a_picture_without_features_says_nothing_at_its_edges_neither(
    stride: int, deviation_px: float
) -> None:
    flat = FeaturePyramid(maps=tuple(torch.full_like(each, 0.5) for each in drawn_maps(32)), stride=stride)
    places = torch.tensor([[[0.0, 0.0], [0.5, 31.0], [16.0, 15.3], [31.0, 7.5]]])
    near = Near(places_px=places, deviation_px=deviation_px)
    found = match_local(unit(torch.ones(1, 4, 248)), flat, temperature=100.0, near=near)
    _, precision = remove_prior(found.found, found.expected)
    assert float(precision.abs().max()) == 0.0


def test_precisions_by_pixels_are_those_of_metres_with_forward_up() -> None:
    wanted = torch.tensor([[0.2, -0.1], [-0.1, 0.6]])
    found = precision_of_pixels(torch.tensor([[0.2, 0.1], [0.1, 0.6]])[None, None])
    assert_close(found[0, 0], wanted)


def test_a_square_is_the_same_in_any_frame() -> None:
    generator = torch.Generator().manual_seed(1)
    off = torch.randn(1, 5, 2, generator=generator)
    precision = torch.stack([covariance(1.0, 0.1, 0.3 * i).float() for i in range(5)])[None]
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
    precision = torch.stack([covariance(1.0, 0.02 + 0.01 * i, 0.1 * i).float() for i in range(60)])[None]
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
def test_what_is_left_open_is_said_and_stays_finite(left: str) -> None:
    source, destination, weights = scene(MOTION)
    precision = torch.zeros(1, 60, 2, 2)
    if left == "forward":  # all stand on a line to the right, and say how far right they are
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
    """Half of the matches say one motion, a few less another that is 3 m off: both are least sums."""
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
