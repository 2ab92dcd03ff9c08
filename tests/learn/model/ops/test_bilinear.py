"""Resizing by matrices, and lengths without resizing, against PyTorch's interpolation."""

import math

import pytest
import torch
from numpy.testing import assert_allclose
from torch import Tensor
from torch.nn.functional import interpolate

from echoscape.learn.model.ops.bilinear import pixels_taken, resized, squared_lengths


def _plain(values: Tensor, factor: int) -> Tensor:
    return interpolate(values, scale_factor=factor, mode="bilinear", align_corners=False)


def _drawn(*shape: int) -> Tensor:
    return torch.randn(shape, generator=torch.Generator().manual_seed(4), dtype=torch.float64)


@pytest.mark.parametrize("factor", [1, 2, 4, 8, 16])
@pytest.mark.parametrize("shape", [(2, 3, 5, 7), (1, 1, 1, 1), (1, 4, 1, 6)])
def test_resizing_and_its_gradients_are_those_of_interpolation(factor: int, shape: tuple[int, ...]) -> None:
    values = _drawn(*shape).requires_grad_()
    found, plain = resized(values, factor), _plain(values, factor)
    assert_allclose(found.detach(), plain.detach(), atol=1e-12)
    slope = _drawn(*plain.shape)
    mine, theirs = (torch.autograd.grad(each, values, slope)[0] for each in (found, plain))
    assert_allclose(mine, theirs, atol=1e-11)


@pytest.mark.parametrize("factor", [1, 2, 4, 8, 16])
@pytest.mark.parametrize("shape", [(2, 3, 5, 7), (1, 1, 1, 1), (1, 4, 1, 6)])
def test_lengths_are_those_of_the_resized_map(factor: int, shape: tuple[int, ...]) -> None:
    values = _drawn(*shape)
    assert_allclose(squared_lengths(values, factor), _plain(values, factor).square().sum(1), atol=1e-11)


def test_lengths_by_factors_that_are_not_even_are_refused() -> None:
    with pytest.raises(ValueError, match="factor must be 1 or even, got 3"):
        squared_lengths(_drawn(1, 1, 2, 2), 3)


def test_pixels_are_taken_where_rows_and_columns_meet_of_each_picture() -> None:
    values = _drawn(2, 3, 4, 5)
    pixels = torch.tensor([[[[0.0, 3.0], [4.0, 1.0]]], [[[2.0, 2.0], [0.0, 3.0]]]])  # (2, 1, 2, 2)
    found = pixels_taken(values, pixels)
    assert torch.equal(found[0, 0], values[0][:, [0, 0, 3, 3], [4, 1, 4, 1]].T)
    assert torch.equal(found[1, 0], values[1][:, [2, 2, 2, 2], [0, 3, 0, 3]].T)


def test_places_that_are_not_finite_are_not_looked_for_in_memory() -> None:
    values = _drawn(1, 1, 2, 2)
    found = pixels_taken(values, torch.tensor([[[[math.nan], [math.nan]]]]))
    assert torch.equal(found[0, 0, 0], values[0, :, 0, 0])
