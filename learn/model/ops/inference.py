"""Low-passed maxima and upsampling without gradients, faster than PyTorch's operators on the CPU.

Maps have a pixel's channels side by side in memory, as convolutions return them, and are processed by whole
rows and columns. Tests compare with `blurred_pooling.blurred_max_pool` and `torch.nn.functional.interpolate`.
"""

import torch
from torch import Tensor


def blurred_maxima(values: Tensor) -> Tensor:
    """Compute `blurred_pooling.blurred_max_pool`, rows first, then columns.

    Along each side, maxima of neighbours are taken at odd and at even places, the even ones between two
    results.

    Args:
        values: Maps (B, C, H, W), H and W even.

    Returns:
        Maps (B, C, H / 2, W / 2).
    """
    by_pixel = values.permute(0, 2, 3, 1).contiguous()
    odd, even = (_blurred_columns(each) for each in _neighbours_maxima(by_pixel))
    return _blurred(odd, even).permute(0, 3, 1, 2)


def _blurred_columns(values: Tensor) -> Tensor:
    """Return (B, H, W / 2, C) of maxima (B, H, W, C) along columns."""
    lines = values.flatten(0, 1)
    return _blurred(*_neighbours_maxima(lines)).unflatten(0, values.shape[:2])


def _neighbours_maxima(values: Tensor) -> tuple[Tensor, Tensor]:
    """Return maxima along the first side of values (B, H, ...): at 2 j and 2 j + 1, at 2 j - 1 and 2 j."""
    first, second = values[:, 0::2], values[:, 1::2]
    between = torch.maximum(second[:, :-1], first[:, 1:])
    return torch.maximum(first, second), torch.cat([first[:, :1], between, second[:, -1:]], 1)


def _blurred(odd: Tensor, even: Tensor) -> Tensor:
    """Return means of neighbours, 1-2-1: odd (B, n, ...) in the middle, even (B, n + 1, ...) around."""
    return torch.lerp(torch.lerp(even[:, :-1], even[:, 1:], 0.5), odd, 0.5)


def upsampled_above(coarse: Tensor, fine: Tensor) -> Tensor:
    """Upsample maps bilinearly to twice their size and concatenate finer maps.

    Pixels are areas: samples are a quarter of a pixel before and after the centre of each.

    Args:
        coarse: Maps (B, C, H, W).
        fine: Maps (B, F, 2 H, 2 W).

    Returns:
        Maps (B, C + F, 2 H, 2 W).
    """
    batch, channels, rows, columns = coarse.shape
    total = coarse.new_empty(batch, 2 * rows, 2 * columns, channels + fine.shape[1])
    by_pixel = coarse.permute(0, 2, 3, 1)
    for row in (0, 1):
        lines = _shifted(by_pixel, 1, torch.empty_like(by_pixel), forward=bool(row))
        for column in (0, 1):
            part = total[:, row::2, column::2, :channels]
            _shifted(lines, 2, part, forward=bool(column))
    total[..., channels:] = fine.permute(0, 2, 3, 1)
    return total.permute(0, 3, 1, 2)


def _shifted(values: Tensor, side: int, into: Tensor, *, forward: bool) -> Tensor:
    """Write values shifted by a quarter of a pixel along a side to `into`, edges repeated; return it."""
    count = values.shape[side] - 1
    first, second = values.narrow(side, 0, count), values.narrow(side, 1, count)
    here, there = (first, second) if forward else (second, first)
    torch.lerp(here, there, 0.25, out=into.narrow(side, 0 if forward else 1, count))
    edge = count if forward else 0
    into.select(side, edge).copy_(values.select(side, edge))
    return into
