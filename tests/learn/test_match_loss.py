"""The loss of matches: nothing at the truth, metres away from it, and who learns from which part of it."""

import math
from dataclasses import replace

import pytest
import torch
from numpy.testing import assert_allclose
from torch import Tensor

from echoscape.learn.loss import likelihood_loss, match_loss
from echoscape.learn.model import Matches
from echoscape.learn.pose import Motion, rotation_of_yaw

TRUTH = Motion(
    rotation=rotation_of_yaw(torch.tensor([0.7], dtype=torch.float64)),
    translation_m=torch.tensor([[3.0, -1.0]], dtype=torch.float64),
    certain=torch.ones(1, dtype=torch.bool),
)


def _matches(astray_m: list[tuple[float, float]], weights: Tensor) -> Matches:
    """Return matches as far from the truth as told, forward and right [m]."""
    draws = torch.Generator().manual_seed(3)
    source = 30 * torch.randn(1, len(astray_m), 2, generator=draws, dtype=torch.float64)
    moved = source @ TRUTH.rotation.transpose(1, 2) + TRUTH.translation_m
    off = torch.tensor([astray_m], dtype=torch.float64)
    return Matches(
        source_m=source, destination_m=(moved + off).requires_grad_(), weights=weights.requires_grad_()
    )


def _weights(*values: float) -> Tensor:
    return torch.tensor([values], dtype=torch.float64)


def test_matches_where_the_motion_puts_them_cost_nothing() -> None:
    found = _matches([(0.0, 0.0)] * 4, _weights(1, 2, 3, 4))
    assert_allclose(match_loss(found, TRUTH, reach_m=5.0).detach(), 0, atol=1e-12)


def test_the_loss_is_the_weighted_distance_once_whole_and_once_bounded() -> None:
    found = _matches([(3.0, 4.0), (0.0, -20.0)], _weights(1, 3))
    expected = (5 + 3 * 20) / 4 + (5 + 3 * 8) / 4
    assert_allclose(match_loss(found, TRUTH, reach_m=8.0).detach(), expected, atol=1e-9)


def test_places_are_drawn_home_by_their_share_however_far_they_are() -> None:
    found = _matches([(3.0, 4.0), (0.0, -20.0)], _weights(1, 3))
    match_loss(found, TRUTH, reach_m=8.0).sum().backward()
    assert found.destination_m.grad is not None
    assert_allclose(found.destination_m.grad[0], [[0.15, 0.2], [0, -0.75]], atol=1e-9)


@pytest.mark.parametrize("far_m", [8.0, 20.0, 200.0])
def test_weights_learn_from_a_bounded_distance_alone(far_m: float) -> None:
    found = _matches([(3.0, 4.0), (0.0, -far_m)], _weights(1, 3))
    match_loss(found, TRUTH, reach_m=8.0).sum().backward()
    mean = (5 + 3 * 8) / 4  # the slope of a weighted mean by a weight: (value - mean) / sum of weights
    assert found.weights.grad is not None
    assert_allclose(found.weights.grad[0], [(5 - mean) / 4, (8 - mean) / 4], atol=1e-9)


def test_no_weight_at_all_gives_no_nan() -> None:
    found = _matches([(1.0, 0.0), (0.0, 1.0)], _weights(0, 0))
    loss = match_loss(found, TRUTH, reach_m=5.0).sum()
    loss.backward()
    assert math.isfinite(float(loss.detach()))
    for each in (found.destination_m, found.weights):
        assert each.grad is not None
        assert bool(each.grad.isfinite().all())


def test_the_likelihood_loss_is_the_weighted_mean_surprisal_and_teaches_no_weights() -> None:
    found = replace(
        _matches([(0.0, 0.0)] * 3, _weights(1, 3, 4)),
        surprisal=torch.tensor([[2.0, 0.5, 0.0]], dtype=torch.float64, requires_grad=True),
    )
    loss = likelihood_loss(found)
    assert_allclose(loss.detach(), [(1 * 2.0 + 3 * 0.5) / 8])
    loss.sum().backward()
    assert found.weights.grad is None
    assert found.surprisal is not None
    assert_allclose(found.surprisal.grad, [[1 / 8, 3 / 8, 4 / 8]])


def test_without_the_true_motion_there_is_no_likelihood() -> None:
    with pytest.raises(ValueError, match="surprisal"):
        likelihood_loss(_matches([(0.0, 0.0)], _weights(1)))
