"""Motion of matches: exact recovery, the SVD's answer, gradients, and sets that leave it open."""

import math

import numpy as np
import pytest
import torch
from hypothesis import given, settings
from hypothesis import strategies as st
from numpy.testing import assert_allclose
from torch import Tensor

from echoscape.learn.geometry.procrustes import Motion, motion_of_matches, robust_motion, rotation_of_yaw
from echoscape.learn.model.keypoint_model import pose_loss
from echoscape.learn.training.losses import pose_errors


def _motion(yaw: float, shift: tuple[float, float]) -> Motion:
    return Motion(
        rotation=rotation_of_yaw(torch.tensor([yaw], dtype=torch.float64)),
        translation_m=torch.tensor([shift], dtype=torch.float64),
        certain=torch.ones(1, dtype=torch.bool),
    )


def _drawn(seed: int, count: int = 30) -> tuple[Tensor, Tensor, Tensor]:
    draws = torch.Generator().manual_seed(seed)
    source, noise = torch.randn(2, 1, count, 2, generator=draws, dtype=torch.float64) * 40
    return source, noise, torch.rand(1, count, generator=draws, dtype=torch.float64)


@given(yaw=st.floats(-math.pi, math.pi), x=st.floats(-50, 50), y=st.floats(-50, 50), seed=st.integers(0, 99))
@settings(deadline=None)
def test_a_rigid_motion_is_recovered_exactly(yaw: float, x: float, y: float, seed: int) -> None:
    source, _, weights = _drawn(seed)
    truth = _motion(yaw, (x, y))
    destination = source @ truth.rotation.transpose(1, 2) + truth.translation_m
    found = motion_of_matches(source, destination, weights)
    assert_allclose(found.rotation, truth.rotation, atol=1e-12)
    assert_allclose(found.translation_m, truth.translation_m, atol=1e-10)
    assert bool(found.certain)
    shift, turn = pose_errors(found, truth)
    assert float(shift) < 1e-9
    assert float(turn) < 1e-9


@pytest.mark.parametrize("seed", range(20))
def test_noisy_matches_give_what_the_svd_gives(seed: int) -> None:
    source, destination, weights = _drawn(seed)
    share = (weights / weights.sum())[0, :, None].numpy()
    s, d = source[0].numpy(), destination[0].numpy()
    s_mean, d_mean = (share * s).sum(0), (share * d).sum(0)
    u, _, vt = np.linalg.svd((s - s_mean).T @ (share * (d - d_mean)))
    rotation = vt.T @ np.diag([1, np.linalg.det(vt.T @ u.T)]) @ u.T
    found = motion_of_matches(source, destination, weights)
    assert_allclose(found.rotation[0], rotation, atol=1e-10)
    assert_allclose(found.translation_m[0], d_mean - rotation @ s_mean, atol=1e-9)


def test_weights_of_zero_leave_matches_out_and_scale_does_not_matter() -> None:
    source, noise, weights = _drawn(4)
    truth = _motion(2.0, (3.0, -7.0))
    destination = source @ truth.rotation.transpose(1, 2) + truth.translation_m
    weights[:, :10], destination[:, :10] = 0, noise[:, :10]
    found = motion_of_matches(source, destination, 1e-3 * weights)
    assert_allclose(found.translation_m, truth.translation_m, atol=1e-9)


def test_turning_and_moving_the_destination_turns_and_moves_the_answer() -> None:
    source, destination, weights = _drawn(5)
    by = _motion(0.7, (5.0, 6.0))
    before = motion_of_matches(source, destination, weights)
    after = motion_of_matches(source, destination @ by.rotation.transpose(1, 2) + by.translation_m, weights)
    assert_allclose(after.rotation, by.rotation @ before.rotation, atol=1e-12)
    moved = before.translation_m @ by.rotation[0].T + by.translation_m
    assert_allclose(after.translation_m, moved, atol=1e-10)


def test_pose_passes_gradcheck() -> None:
    source, destination, weights = (each.requires_grad_() for each in _drawn(6, 5))

    def answer(*inputs: Tensor) -> tuple[Tensor, Tensor]:
        found = motion_of_matches(*inputs)
        return found.rotation, found.translation_m

    assert torch.autograd.gradcheck(answer, (source, destination, weights))


@pytest.mark.parametrize("scale", [1e-3, 1e-20, 1e-36])
@pytest.mark.parametrize("robust", [False, True])
def test_the_scale_of_the_weights_does_not_matter_however_small(scale: float, robust: bool) -> None:
    source, noise, weights = (each.float() for each in _drawn(4))
    truth = _motion(0.3, (3.0, -7.0))
    moved = source @ truth.rotation.float().transpose(1, 2) + truth.translation_m.float() + 0.01 * noise

    def found(weights: Tensor) -> Motion:
        if robust:
            return robust_motion(source, moved, weights, scale_m=1.0)
        return motion_of_matches(source, moved, weights)

    small = (weights * scale).requires_grad_()
    assert_allclose(found(small).translation_m.detach(), found(weights).translation_m, atol=1e-4)
    (slope,) = torch.autograd.grad(found(small).translation_m.sum(), small)
    assert bool(slope.isfinite().all())


@pytest.mark.parametrize("seed", range(20))
@pytest.mark.parametrize("dtype", [torch.float32, torch.float64])
def test_points_all_in_one_place_leave_the_rotation_open_whatever_the_place(
    seed: int, dtype: torch.dtype
) -> None:
    draws = torch.Generator().manual_seed(seed)
    source, destination = (100 * torch.randn(1, 1, 2, generator=draws, dtype=dtype) for _ in range(2))
    weights = torch.rand(1, 400, generator=draws, dtype=dtype)
    places = source.expand(1, 400, 2), destination.expand(1, 400, 2)
    found = motion_of_matches(*places, weights)
    assert not bool(found.certain)
    assert_allclose(found.translation_m[0], (destination - source)[0, 0], rtol=1e-3)
    assert not bool(robust_motion(*places, weights, scale_m=1.0).certain)


@pytest.mark.parametrize("case", ["one place", "no weight", "one match", "balanced"])
def test_sets_that_leave_the_rotation_open_give_none_and_no_nan(case: str) -> None:
    source, destination, weights = _drawn(7, 4)
    expected = None
    if case == "one place":
        source, destination = torch.full_like(source, 3.0), torch.full_like(source, 5.0)
        expected = [2.0, 2.0]
    elif case == "no weight":
        weights, expected = torch.zeros_like(weights), [0.0, 0.0]
    elif case == "one match":
        weights = torch.tensor([[0.0, 1.0, 0.0, 0.0]], dtype=torch.float64)
        expected = (destination - source)[0, 1].tolist()
    else:  # a square and its mirror image: every rotation fits alike
        source = torch.tensor([[[1.0, 0], [0, 1], [-1, 0], [0, -1]]], dtype=torch.float64)
        destination, weights = source * torch.tensor([1.0, -1.0]), torch.ones_like(weights)
        expected = [0.0, 0.0]
    inputs = [each.clone().requires_grad_() for each in (source, destination, weights)]
    found = motion_of_matches(*inputs)
    assert not bool(found.certain)
    assert_allclose(found.rotation.detach()[0], np.eye(2))
    assert_allclose(found.translation_m.detach()[0], expected, atol=1e-12)
    slopes = torch.autograd.grad(found.rotation.sum() + found.translation_m.sum(), inputs)
    assert all(bool(each.isfinite().all()) for each in slopes)


def test_shapes_that_do_not_fit_are_refused() -> None:
    with pytest.raises(ValueError, match="points must be"):
        motion_of_matches(torch.zeros(1, 4, 2), torch.zeros(1, 5, 2), torch.zeros(1, 4))


@given(st.floats(-3.1, 3.1), st.floats(-3.1, 3.1))
@settings(deadline=None)
def test_loss_is_the_sum_of_both_spectral_norms(first: float, second: float) -> None:
    one, other = _motion(first, (3.0, 4.0)), _motion(second, (0.0, 0.0))
    difference = (one.rotation @ other.rotation.transpose(1, 2))[0].numpy() - np.eye(2)
    assert_allclose(pose_loss(one, other, alpha_m=10.0), 5 + 10 * np.linalg.norm(difference, 2), atol=1e-9)
    assert_allclose(np.linalg.norm(difference, 2), 2 * abs(math.sin((first - second) / 2)), atol=1e-9)


def test_loss_has_no_gradient_at_the_truth_and_no_nan() -> None:
    yaw = torch.tensor([0.3], requires_grad=True)
    at = Motion(rotation=rotation_of_yaw(yaw), translation_m=yaw.new_zeros(1, 2), certain=torch.ones(1) > 0)
    (slope,) = torch.autograd.grad(pose_loss(at, at, alpha_m=10.0).sum(), yaw)
    assert bool(slope.isfinite())


# ---------------------------------------------------------------------- wrong matches


@pytest.mark.parametrize("seed", range(10))
def test_a_third_of_wrong_matches_does_not_move_the_robust_motion(seed: int) -> None:
    source, noise, weights = _drawn(seed, count=90)
    truth = _motion(0.2, (4.0, -1.0))
    destination = source @ truth.rotation.transpose(1, 2) + truth.translation_m
    wrong = torch.arange(90) % 3 == 0
    destination[:, wrong] += noise[:, wrong] + 20
    least_squares = motion_of_matches(source, destination, weights)
    assert float(pose_errors(least_squares, truth)[0]) > 1
    found = robust_motion(source, destination, weights, scale_m=0.5)
    shift, turn = pose_errors(found, truth)
    assert float(shift) < 0.02
    assert float(turn) < 0.001


@pytest.mark.parametrize("seed", range(5))
def test_where_no_match_is_wrong_both_agree(seed: int) -> None:
    source, noise, weights = _drawn(seed)
    truth = _motion(-0.4, (1.0, 2.0))
    destination = source @ truth.rotation.transpose(1, 2) + truth.translation_m + 1e-4 * noise
    found = robust_motion(source, destination, weights, scale_m=1.0)
    expected = motion_of_matches(source, destination, weights)
    assert_allclose(found.translation_m, expected.translation_m, atol=1e-4)
    assert_allclose(found.rotation, expected.rotation, atol=1e-5)


def test_robust_motion_is_uncertain_where_least_squares_is() -> None:
    points = torch.ones(1, 5, 2, dtype=torch.float64)
    found = robust_motion(points, points, torch.ones(1, 5, dtype=torch.float64), scale_m=1.0)
    assert not bool(found.certain)
    assert bool(found.rotation.isfinite().all())
