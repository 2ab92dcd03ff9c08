"""Bilinear resizing and lengths against PyTorch's interpolation; pixels read where rows and columns cross."""

import math

import pytest
import torch
from numpy.testing import assert_allclose
from torch import Tensor
from torch.nn.functional import interpolate

from echoscape.learn.model.ops.bilinear import pixels_taken, resized, shares_of_places, squared_lengths


def _plain(values: Tensor, factor: int) -> Tensor:
    return interpolate(values, scale_factor=factor, mode="bilinear", align_corners=False)


def _drawn(*shape: int) -> Tensor:
    return torch.randn(shape, generator=torch.Generator().manual_seed(4), dtype=torch.float64)


@pytest.mark.parametrize("factor", [2, 4, 16])
def test_shares_of_places_are_those_of_interpolation(factor: int) -> None:
    """Along one side: samples of a line made `factor` times as long, its outermost pixels extended."""
    line = _drawn(1, 1, 7)
    places = ((torch.arange(7 * factor, dtype=torch.float64) + 0.5) / factor - 0.5).clamp(0, 6)
    shares = shares_of_places(places, torch.arange(7, dtype=torch.float64))
    plain = interpolate(line, scale_factor=factor, mode="linear", align_corners=False)
    assert_allclose(shares @ line[0, 0], plain[0, 0], atol=1e-12)
    assert_allclose(shares.sum(-1), 1, atol=1e-12)


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


def test_pixels_are_taken_from_each_image_where_rows_and_columns_meet() -> None:
    values = _drawn(2, 3, 4, 5)
    pixels = torch.tensor([[[[0.0, 3.0], [4.0, 1.0]]], [[[2.0, 2.0], [0.0, 3.0]]]])  # (2, 1, 2, 2)
    found = pixels_taken(values, pixels)
    assert torch.equal(found[0, 0], values[0][:, [0, 0, 3, 3], [4, 1, 4, 1]].T)
    assert torch.equal(found[1, 0], values[1][:, [2, 2, 2, 2], [0, 3, 0, 3]].T)


def test_places_that_are_not_finite_are_not_looked_for_in_memory() -> None:
    values = _drawn(1, 1, 2, 2)
    found = pixels_taken(values, torch.tensor([[[[math.nan], [math.nan]]]]))
    assert torch.equal(found[0, 0, 0], values[0, :, 0, 0])
