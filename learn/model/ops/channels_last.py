"""Memory layout of gradients: a pixel's channels side by side, as in the network's own maps.

PyTorch returns some gradients, such as those of `grid_sample`, one channel after the other; sums with them
have that layout too, and the backward pass of all convolutions before takes several times as long.
"""

from typing import Any

import torch
from torch import Tensor
from torch.autograd import Function


def with_gradient_by_pixel(values: Tensor) -> Tensor:
    """Pass values on, and return their gradient with a pixel's channels side by side.

    Args:
        values: Maps (B, C, H, W).

    Returns:
        The same values.
    """
    return _ByPixel.apply(values)


class _ByPixel(Function):
    """The identity."""

    @staticmethod
    def forward(ctx: Any, values: Tensor) -> Tensor:  # type: ignore[override]
        return values.detach()  # a view might give a batch of one another stride, and lose the layout

    @staticmethod
    def backward(ctx: Any, slope: Tensor) -> Tensor:  # type: ignore[override]
        return slope.contiguous(memory_format=torch.channels_last)
