"""Batch normalisation whose gradients do not slow down with a second thread.

PyTorch's own sums of gradients by channel lie side by side for all threads, a few numbers each, so that
threads wait for each other's cache lines: with eight channels two take twice as long as one.
"""

from typing import Any, cast

import torch
from torch import Tensor, nn
from torch.autograd import Function
from torch.autograd.function import once_differentiable

_WIDE = 64
"""Numbers a line that are summed over lines at once."""


class BatchNorm(nn.BatchNorm2d):
    """`nn.BatchNorm2d` of maps whose channels lie side by side."""

    def forward(self, input: Tensor) -> Tensor:
        """Return maps (B, C, H, W) normalised by channel, by their own moments while training.

        Raises:
            ValueError: there are not four sides, other channels than the layer's, or one value a channel.
        """
        usual = self.affine and self.track_running_stats and self.momentum is not None
        if not (usual and self.training and torch.is_grad_enabled()):
            return super().forward(input)
        self._check_input_dim(input)
        # What PyTorch calls next writes where other channels would be, unchecked.
        if input.shape[1] != self.num_features or input.numel() <= self.num_features:
            wanted = f"(B, {self.num_features}, H, W) with more than one value a channel"
            raise ValueError(f"input must be {wanted}, got {tuple(input.shape)}")
        cast("Tensor", self.num_batches_tracked).add_(1)
        values = input.contiguous(memory_format=torch.channels_last)
        moments = self.running_mean, self.running_var, self.momentum, self.eps
        return _Normalised.apply(values, self.weight, self.bias, *moments)


class _Normalised(Function):
    """(x - mean) / sqrt(variance + eps) weight + bias, by the batch's own mean and variance."""

    @staticmethod
    def forward(  # type: ignore[override]
        ctx: Any,
        values: Tensor,
        weight: Tensor,
        bias: Tensor,
        running_mean: Tensor,
        running_variance: Tensor,
        momentum: float,
        eps: float,
    ) -> Tensor:
        normalised, mean, inverse = torch.native_batch_norm(
            values, weight, bias, running_mean, running_variance, True, momentum, eps
        )
        ctx.save_for_backward(values, weight, mean, inverse)
        return normalised

    @staticmethod
    @once_differentiable
    def backward(ctx: Any, slope: Tensor) -> tuple[Tensor | None, ...]:  # type: ignore[override]
        """Return the derivatives by values, weight and bias.

        With g the derivative by the output, n values a channel, h = (x - mean) / deviation and w the weight,
        that by x is w (g - mean of g - h mean of g h) / deviation: a g + b x + c, constant a, b, c.
        Source: Ioffe & Szegedy, Batch normalization, ICML 2015, section 3.
        """
        values, weight, mean, inverse = ctx.saved_tensors
        g, x = (_lines(each).to(mean.dtype) for each in (slope, values))
        by_bias = _by_channel(g, len(weight))
        by_weight = (_by_channel(g * x, len(weight)) - mean * by_bias) * inverse
        count = values.numel() / len(weight)
        a = weight * inverse
        b = -a * inverse * by_weight / count
        c = -a * by_bias / count - b * mean
        a, b, c = (each.repeat(g.shape[1] // len(weight)) for each in (a, b, c))
        by_values = (g * a).addcmul_(x, b).add_(c).to(values.dtype)
        shape = values.permute(0, 2, 3, 1).shape
        return by_values.view(shape).permute(0, 3, 1, 2), by_weight, by_bias, None, None, None, None


def _lines(values: Tensor) -> Tensor:
    """Return maps (B, C, H, W) as (L, k C), some pixels a line, a pixel's channels side by side."""
    by_pixel = values.permute(0, 2, 3, 1).reshape(-1, values.shape[1])
    pixels = max(_WIDE // values.shape[1], 1)
    return by_pixel.view(-1, pixels * values.shape[1]) if len(by_pixel) % pixels == 0 else by_pixel


def _by_channel(lines: Tensor, channels: int) -> Tensor:
    """Return the sums (C,) of what `_lines` returned."""
    return lines.sum(0).view(-1, channels).sum(0)
