"""Bilinear interpolation by whole factors and at places as sums over pixels, faster than PyTorch's.

Pixels are areas (`align_corners=False`), and the outermost ones extend outwards: sample i of a map resized
f times is at (i + 1/2) / f - 1/2 of the map. Tests compare with `torch.nn.functional.interpolate`.
"""

import torch
from torch import Tensor
from torch.nn.functional import pad


def resized(values: Tensor, factor: int) -> Tensor:
    """Resize maps by products with two matrices, whose gradients are products as well.

    Args:
        values: Maps (..., H, W).
        factor: Samples per pixel, along each side.

    Returns:
        Maps (..., factor H, factor W).
    """
    if factor == 1:
        return values
    rows, columns = (_shares(length, factor, like=values) for length in values.shape[-2:])
    return rows @ (values.contiguous() @ columns.T)


def _shares(length: int, factor: int, *, like: Tensor) -> Tensor:
    """Return the bilinear weights (factor * length, length) of pixels in samples, along one side."""
    samples = torch.arange(factor * length, dtype=torch.float64)
    places = ((samples + 0.5) / factor - 0.5).clamp(0, length - 1)
    return shares_of_places(places, torch.arange(length, dtype=torch.float64)).to(like)


def shares_of_places(places: Tensor, pixels: Tensor) -> Tensor:
    """Compute the bilinear weights of pixels at places between them, along one side.

    Args:
        places: Places (..., S) [px].
        pixels: Pixels (..., P) [px].

    Returns:
        Weights (..., S, P): max(0, 1 - |place - pixel|).
    """
    return (1 - (places[..., :, None] - pixels[..., None, :]).abs()).clamp(min=0)


def pixels_taken(values: Tensor, pixels: Tensor) -> Tensor:
    """Read maps where rows and columns cross.

    Places that are not finite are taken as 0; the weights computed from them are not finite either, so that
    the result shows it.

    Args:
        values: Maps (B, C, H, W).
        pixels: S rows and S columns for each of N points (B, N, 2, S), whole numbers inside the maps.

    Returns:
        Values (B, N, S^2, C).
    """
    batch, channels, height, width = values.shape
    by_pixel = values.permute(0, 2, 3, 1).reshape(-1, channels)
    first = torch.arange(batch, device=values.device)[:, None, None, None] * (height * width)
    rows, columns = pixels.nan_to_num(0.0).long().unbind(2)
    index = first + rows[..., None] * width + columns[..., None, :]
    return by_pixel.index_select(0, index.flatten()).view(*index.shape[:2], -1, channels)


def squared_lengths(values: Tensor, factor: int) -> Tensor:
    """Compute the squared lengths of resized descriptors without resizing them.

    Between four pixels a resized map is their weighted mean, so its square is a weighted sum of the
    products of the four; rounding may make it slightly negative.

    Args:
        values: Maps (B, C, H, W).
        factor: Samples per pixel, along each side.

    Returns:
        Sums (B, factor H, factor W) over channels of `resized(values, factor)` squared.

    Raises:
        ValueError: The factor is neither 1 nor even.
    """
    if factor != 1 and factor % 2:
        raise ValueError(f"factor must be 1 or even, got {factor}")
    if factor == 1:
        return values.square().sum(1)
    wide = pad(values, (1, 1, 1, 1), mode="replicate")
    squares = wide.square().sum(1)
    across = (wide[..., :-1] * wide[..., 1:]).sum(1)
    down = (wide[..., :-1, :] * wide[..., 1:, :]).sum(1)
    crossed = (wide[..., :-1, :-1] * wide[..., 1:, 1:] + wide[..., :-1, 1:] * wide[..., 1:, :-1]).sum(1)
    corners = (squares[:, :-1, :-1], squares[:, :-1, 1:], squares[:, 1:, :-1], squares[:, 1:, 1:])
    sides = (across[:, :-1], across[:, 1:], down[..., :-1], down[..., 1:])
    products = torch.stack([*corners, *sides, crossed], -1)  # (B, H + 1, W + 1, 9), by box
    to = ((torch.arange(factor) + 0.5) / factor).to(values)
    near, far, both = (
        (1 - to) ** 2,
        to**2,
        2 * to * (1 - to),
    )  # of the ends of a box
    ends = (near, near), (near, far), (far, near), (far, far)
    along = (near, both), (far, both), (both, near), (both, far)
    weights = torch.stack([torch.outer(a, b) for a, b in (*ends, *along, (both, both / 2))])
    boxes = products @ weights.flatten(1)  # (B, H + 1, W + 1, f f)
    batch, rows, columns, _ = boxes.shape
    samples = boxes.unflatten(-1, (factor, factor)).transpose(2, 3)
    samples = samples.reshape(batch, rows * factor, columns * factor)
    edge = factor // 2  # half a box lies outside
    return samples[:, edge:-edge, edge:-edge]
