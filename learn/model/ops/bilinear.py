"""Bilinear resizing by whole factors as products with matrices, whose gradients are products as well.

Pixels are areas (`align_corners=False`): sample i of a map made f times as large stands at
(i + 1/2) / f - 1/2 of it, and the outermost pixels go on. It is tested against
`torch.nn.functional.interpolate`, whose gradients take long on maps that are given channel after channel.
"""

import torch
from torch import Tensor


def resized(values: Tensor, factor: int) -> Tensor:
    """Return (..., f H, f W): maps (..., H, W), each side f times as many samples."""
    if factor == 1:
        return values
    rows, columns = (_shares(length, factor, like=values) for length in values.shape[-2:])
    return rows @ (values.contiguous() @ columns.T)


def _shares(length: int, factor: int, *, like: Tensor) -> Tensor:
    """Return (f length, length): how much each pixel counts in each sample."""
    samples = torch.arange(factor * length, dtype=torch.float64)
    places = ((samples + 0.5) / factor - 0.5).clamp(0, length - 1)
    return shares_of_places(places, torch.arange(length, dtype=torch.float64)).to(like)


def shares_of_places(places: Tensor, pixels: Tensor) -> Tensor:
    """Return (..., S, P): how much pixels (..., P) count at places (..., S) between them, bilinearly."""
    return (1 - (places[..., :, None] - pixels[..., None, :]).abs()).clamp(min=0)


def pixels_taken(values: Tensor, pixels: Tensor) -> Tensor:
    """Return (B, N, S^2, C): what maps (B, C, H, W) are where rows and columns (B, N, 2, S) meet.

    Places that are not finite are taken as 0; shares that come of them say so in what is made of the pixels.
    """
    batch, channels, height, width = values.shape
    by_pixel = values.permute(0, 2, 3, 1).reshape(-1, channels)
    first = torch.arange(batch, device=values.device)[:, None, None, None] * (height * width)
    rows, columns = pixels.nan_to_num(0.0).long().unbind(2)
    index = first + rows[..., None] * width + columns[..., None, :]
    return by_pixel.index_select(0, index.flatten()).view(*index.shape[:2], -1, channels)


def squared_lengths(values: Tensor, factor: int) -> Tensor:
    """Return (B, f H, f W): the sum over channels of `resized(values, f)`^2, without resizing (B, C, H, W).

    Between four pixels a resized map is their mean with weights, and its square one of their products, which
    by rounding may be a little below 0.

    Raises:
        ValueError: the factor is neither 1 nor even.
    """
    if factor != 1 and factor % 2:
        raise ValueError(f"factor must be 1 or even, got {factor}")
    if factor == 1:
        return values.square().sum(1)
    wide = torch.nn.functional.pad(values, (1, 1, 1, 1), mode="replicate")
    squares = wide.square().sum(1)
    across = (wide[..., :-1] * wide[..., 1:]).sum(1)
    down = (wide[..., :-1, :] * wide[..., 1:, :]).sum(1)
    crossed = (wide[..., :-1, :-1] * wide[..., 1:, 1:] + wide[..., :-1, 1:] * wide[..., 1:, :-1]).sum(1)
    corners = (squares[:, :-1, :-1], squares[:, :-1, 1:], squares[:, 1:, :-1], squares[:, 1:, 1:])
    sides = (across[:, :-1], across[:, 1:], down[..., :-1], down[..., 1:])
    products = torch.stack([*corners, *sides, crossed], -1)  # (B, H + 1, W + 1, 9), a box between four pixels
    to = ((torch.arange(factor) + 0.5) / factor).to(values)
    near, far, both = (1 - to) ** 2, to**2, 2 * to * (1 - to)  # of a box's two ends, along one side
    ends = (near, near), (near, far), (far, near), (far, far)
    along = (near, both), (far, both), (both, near), (both, far)
    weights = torch.stack([torch.outer(a, b) for a, b in (*ends, *along, (both, both / 2))])
    boxes = products @ weights.flatten(1)  # (B, H + 1, W + 1, f f)
    batch, rows, columns, _ = boxes.shape
    samples = boxes.unflatten(-1, (factor, factor)).transpose(2, 3)
    samples = samples.reshape(batch, rows * factor, columns * factor)
    edge = factor // 2  # half a box lies outside
    return samples[:, edge:-edge, edge:-edge]
