"""Batch normalisation is PyTorch's: values, gradients, running moments."""

from typing import Any

import pytest
import torch
from torch import Tensor, nn
from torch.testing import assert_close

from echoscape.learn.model.ops.batch_norm import BatchNorm


def _after_a_step(layer: nn.BatchNorm2d, values: Tensor, slope: Tensor) -> list[Tensor]:
    values = values.clone(memory_format=torch.preserve_format).requires_grad_()
    found = layer.train()(values)
    found.backward(slope)
    assert values.grad is not None
    assert layer.weight.grad is not None
    assert layer.bias.grad is not None
    state = [each.clone() for each in layer.state_dict().values()]
    return [found.detach(), values.grad, layer.weight.grad, layer.bias.grad, *state]


@pytest.mark.parametrize("shape", [(2, 8, 16, 16), (1, 128, 3, 5), (3, 5, 7, 1)])
@pytest.mark.parametrize("by_pixel", [True, False])
def test_values_gradients_and_moments_are_those_of_pytorch(shape: tuple[int, ...], by_pixel: bool) -> None:
    draws = torch.Generator().manual_seed(1)
    values, slope = (3 + 2 * torch.randn(shape, generator=draws, dtype=torch.float64) for _ in range(2))
    if by_pixel:
        values, slope = (each.contiguous(memory_format=torch.channels_last) for each in (values, slope))
    mine, theirs = (kind(shape[1], momentum=0.01).double() for kind in (BatchNorm, nn.BatchNorm2d))
    for layer in (mine, theirs):
        with torch.no_grad():
            layer.weight.copy_(torch.linspace(0.5, 2, shape[1]))
            layer.bias.copy_(torch.linspace(-1, 1, shape[1]))
    for found, wanted in zip(
        _after_a_step(mine, values, slope), _after_a_step(theirs, values, slope), strict=True
    ):
        assert_close(found, wanted, rtol=1e-9, atol=1e-9)
    assert_close(mine.eval()(values), theirs.eval()(values))


def test_bfloat16_maps_keep_their_format_and_parameters_theirs() -> None:
    draws = torch.Generator().manual_seed(2)
    values, slope = (torch.randn(2, 8, 16, 16, generator=draws).bfloat16() for _ in range(2))
    layer, theirs = BatchNorm(8), nn.BatchNorm2d(8)
    found, wanted = (_after_a_step(each, values, slope) for each in (layer, theirs))
    assert [each.dtype for each in found] == [each.dtype for each in wanted]
    for mine, other in zip(found, wanted, strict=True):
        assert_close(mine, other, rtol=0.02, atol=0.02)


@pytest.mark.parametrize("how", [{"momentum": None}, {"affine": False}, {"track_running_stats": False}])
def test_other_ways_to_normalise_are_pytorchs(how: dict[str, Any]) -> None:
    values = torch.randn(2, 3, 4, 5, generator=torch.Generator().manual_seed(3))
    assert_close(BatchNorm(3, **how).train()(values), nn.BatchNorm2d(3, **how).train()(values))


@pytest.mark.parametrize("shape", [(2, 8, 16, 16), (1, 4, 1, 1), (4, 16, 16)])
def test_maps_that_do_not_fit_are_refused(shape: tuple[int, ...]) -> None:
    with pytest.raises(ValueError, match=r"input must be \(B, 4, H, W\)|expected 4D input"):
        BatchNorm(4).train()(torch.randn(shape))
