"""Removal of the prior: exact for normal distributions; no precision where the match adds nothing."""

import math

import pytest
import torch
from hypothesis import given, settings
from hypothesis import strategies as st
from torch import Tensor
from torch.testing import assert_close

from echoscape.learn.model.feature_pyramid import FeaturePyramid
from echoscape.learn.model.keypoint_model import unit
from echoscape.learn.model.local_matching import Moments, Near, match_local
from echoscape.learn.model.prior_removal import precision_of_pixels, remove_prior
from tests.learn.maps import drawn_maps
from tests.learn.matrices import covariance_of

SHARPEST_PX = 0.7


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
def test_the_prior_is_removed_from_normal_distributions_exactly(
    first: float, second: float, angle: float, place: tuple[float, float], deviation: float
) -> None:
    own, mean = covariance_of(first, second, angle), torch.tensor(place, dtype=torch.float64)
    expected = torch.tensor([0.5, -1.0], dtype=torch.float64)
    prior = covariance_of(deviation**2, 0.8 * deviation**2, 0.3)
    spread = torch.linalg.inv(torch.linalg.inv(own) + torch.linalg.inv(prior))  # of their product
    found = spread @ (torch.linalg.inv(own) @ mean + torch.linalg.inv(prior) @ expected)
    places, precision = remove_prior(moments(found, spread), moments(expected, prior))
    assert_close(places[0, 0], mean, atol=1e-9, rtol=0)
    wanted = SHARPEST_PX**2 * torch.linalg.inv(own + SHARPEST_PX**2 * torch.eye(2, dtype=torch.float64))
    assert_close(precision[0, 0], wanted, atol=1e-9, rtol=0)


@pytest.mark.parametrize(("share", "precise"), [(0.95, False), (0.85, True)])
def test_a_posterior_nearly_as_wide_as_the_prior_has_no_precision(share: float, precise: bool) -> None:
    """A spread of 0.85 adds 0.18 of what was known, one of 0.95 adds 0.05; the limit is a tenth."""
    found = moments(torch.tensor([3.0, 1.0]), torch.diag(torch.tensor([4.0 * share, 0.2])))
    places, precision = remove_prior(found, moments(torch.zeros(2), 4 * torch.eye(2)))
    assert (float(precision[0, 0, 0, 0]) > 0) == precise
    assert (float(places[0, 0, 0]) > 0) == precise  # else the place is the expected one
    assert places[0, 0, 1] > 1.0
    assert precision[0, 0, 1, 1] > 0.5


def test_a_spread_alike_in_all_directions_has_a_precision_alike_in_all() -> None:
    found = moments(torch.zeros(2), 0.5 * torch.eye(2))
    _, precision = remove_prior(found, moments(torch.zeros(2), 9 * torch.eye(2)))
    assert_close(precision[0, 0], precision[0, 0, 0, 0] * torch.eye(2))


@pytest.mark.parametrize("stride", [1, 2])
@pytest.mark.parametrize("deviation_px", [0.2, 1.0, 4.0])
def test_an_image_without_features_gives_no_precision_even_at_its_edges(
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
