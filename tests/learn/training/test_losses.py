"""The losses of matches: least at the truth, and who learns from which of them."""

import math
from dataclasses import replace

import pytest
import torch
from hypothesis import given, settings
from hypothesis.strategies import floats
from numpy.testing import assert_allclose
from torch import Tensor

from echoscape.learn.geometry.matches import Matches
from echoscape.learn.geometry.procrustes import Motion, rotation_of_yaw
from echoscape.learn.training.losses import likelihood_loss, match_loss, score_loss

TRUTH = Motion(
    rotation=rotation_of_yaw(torch.tensor([0.7], dtype=torch.float64)),
    translation_m=torch.tensor([[3.0, -1.0]], dtype=torch.float64),
    certain=torch.ones(1, dtype=torch.bool),
)


def _matches(astray_m: list[tuple[float, float]], weights: Tensor) -> Matches:
    """Return matches with the given errors, forward and right [m]."""
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
    assert_allclose(match_loss(found, TRUTH).detach(), 0, atol=1e-12)


def test_places_are_drawn_home_by_their_share_however_far_they_are_and_weights_are_left() -> None:
    found = _matches([(3.0, 4.0), (0.0, -20.0)], _weights(1, 3))
    loss = match_loss(found, TRUTH)
    assert_allclose(loss.detach(), (5 + 3 * 20) / 4, atol=1e-9)
    loss.sum().backward()
    assert found.destination_m.grad is not None
    assert_allclose(found.destination_m.grad[0], [[0.15, 0.2], [0, -0.75]], atol=1e-9)
    assert found.weights.grad is None


def test_errors_count_by_precision() -> None:
    """Along the first axis the first has no precision, the second a quarter."""
    found = _matches([(7.0, 4.0), (-6.0, 8.0)], _weights(1, 1))
    precision = torch.tensor([[[0.0, 0.0], [0.0, 1.0]], [[0.25, 0.0], [0.0, 1.0]]], dtype=torch.float64)
    found = replace(found, precision=precision[None])
    assert_allclose(found.errors_m(TRUTH).detach()[0], [4, math.hypot(3, 8)], atol=1e-9)


def test_no_weight_at_all_gives_no_nan() -> None:
    found = _matches([(1.0, 0.0), (0.0, 1.0)], _weights(0, 0))
    loss = (match_loss(found, TRUTH) + score_loss(found, TRUTH, scale_m=1.0)).sum()
    loss.backward()
    assert math.isfinite(float(loss.detach()))
    for each in (found.destination_m, found.weights):
        assert each.grad is not None
        assert bool(each.grad.isfinite().all())


@settings(deadline=None)
@given(off_m=floats(0, 4), scale_m=floats(0.3, 3), wrong=floats(0.02, 0.3))
def test_scores_cost_least_where_each_weight_is_the_chance_of_a_right_match(
    off_m: float, scale_m: float, wrong: float
) -> None:
    right = min(max(math.exp(-0.5 * (off_m / scale_m) ** 2), 0.35), 0.65)
    off_m = scale_m * math.sqrt(-2 * math.log(right))

    def cost(weight: float) -> float:
        found = _matches([(off_m, 0.0), (0.0, off_m)], _weights(weight, right))
        return float(score_loss(found, TRUTH, scale_m=scale_m).detach())

    assert cost(right) < min(cost(right + wrong), cost(right - wrong))


def test_scores_teach_weights_alone_each_by_its_own_match() -> None:
    found = _matches([(0.0, 0.0), (0.0, -50.0)], _weights(0.25, 0.25))
    score_loss(found, TRUTH, scale_m=1.0).sum().backward()
    assert found.destination_m.grad is None
    assert found.weights.grad is not None
    # The mean of -log w where right, which it is by 1, and of -log(1 - w) where it is by 0.
    assert_allclose(found.weights.grad[0], [-1 / 0.25 / 2, 1 / 0.75 / 2], atol=1e-9)


def test_the_likelihood_loss_is_the_mean_surprisal_by_weight_and_a_tenth_and_teaches_no_weights() -> None:
    found = replace(
        _matches([(0.0, 0.0)] * 3, _weights(0.9, 2.9, 3.9)),
        surprisal=torch.tensor([[2.0, 0.5, 0.0]], dtype=torch.float64, requires_grad=True),
    )
    loss = likelihood_loss(found)
    assert_allclose(loss.detach(), [(1 * 2.0 + 3 * 0.5) / 8])
    loss.sum().backward()
    assert found.weights.grad is None
    assert found.surprisal is not None
    assert found.surprisal.grad is not None
    assert_allclose(found.surprisal.grad, [[1 / 8, 3 / 8, 4 / 8]])


def test_without_the_true_motion_there_is_no_likelihood() -> None:
    with pytest.raises(ValueError, match="surprisal"):
        likelihood_loss(_matches([(0.0, 0.0)], _weights(1)))
