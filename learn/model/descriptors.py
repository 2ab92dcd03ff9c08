"""Descriptors: the encoder's maps resized to the picture, one above the other, 248 numbers a pixel.

Source: Barnes & Posner 2020, section III-A (dense descriptors) and III-D (the embedding of a place). Map l is
resized bilinearly with pixels as areas (`align_corners=False`), as everywhere in this package: its sample j
stands at pixel 2^l (j + 1/2) - 1/2, which is where max-pooling took it from.
"""

import torch
from torch import Tensor
from torch.nn.functional import grid_sample, interpolate, normalize

from echoscape.learn.model.ops.bilinear import pixels_taken, shares_of_places
from echoscape.learn.model.unet import Maps

SMALLEST_NORM = 1e-6
"""Descriptors shorter than this are divided by it instead of by their length."""


def dense_descriptors(maps: Maps) -> Tensor:
    """Return (B, 248, H, W), not normalised. Built for reference and for tests only: it is large."""
    size = maps[0].shape[-2:]
    coarse = [interpolate(each, size=size, mode="bilinear", align_corners=False) for each in maps[1:]]
    return torch.cat([maps[0], *coarse], 1)


def unit(descriptors: Tensor, dim: int = -1) -> Tensor:
    """Return descriptors divided by their Euclidean length (or by 1e-6, if they are shorter)."""
    return normalize(descriptors, dim=dim, eps=SMALLEST_NORM)


def sampled(values: Tensor, points_px: Tensor) -> Tensor:
    """Return (B, N, C): values (B, C, H, W) at points (B, N, 2) row, column [px], interpolated bilinearly.

    Outside the middles of the outermost pixels, what is on the edge goes on.
    """
    size = torch.tensor(values.shape[-2:], dtype=points_px.dtype, device=points_px.device)
    grid = ((points_px + 0.5) * (2 / size) - 1).flip(-1)[:, None].to(values.dtype)
    found = grid_sample(values, grid, mode="bilinear", padding_mode="border", align_corners=False)
    return found[:, :, 0].transpose(1, 2)


def descriptors_at(maps: Maps, points_px: Tensor) -> Tensor:
    """Return unit descriptors (B, N, 248) at points (B, N, 2) row, column [px].

    The same as `unit(sampled(dense_descriptors(maps), points_px))` without the dense map: what a point has of
    the four pixels around it, and these of a coarser map's, is what it has of nine of the latter.
    """
    last = _last_pixel(maps[0], points_px)
    points_px = points_px.clamp(min=0).minimum(last)
    corner = points_px.detach().floor()
    part = (points_px - corner)[..., None]
    shares = torch.cat([1 - part, part], -1)  # (B, N, 2, 2) of the rows, and the columns, around a point
    around = torch.stack([corner, (corner + 1).minimum(last)], -1)
    found = [_between_pixels(each, (around + 0.5) / 2**i - 0.5, shares) for i, each in enumerate(maps)]
    return unit(torch.cat(found, -1))


def _between_pixels(values: Tensor, places: Tensor, shares: Tensor) -> Tensor:
    """Return (B, N, C): maps (B, C, h, w) at two rows and two columns (B, N, 2, 2), which count by shares."""
    last = places.new_tensor(values.shape[-2:])[:, None] - 1
    places = places.clamp(min=0).minimum(last)
    pixels = places[..., :1].floor() + torch.arange(3).to(places)  # two places are at most one pixel apart
    rows, columns = (shares[..., None] * shares_of_places(places, pixels)).sum(3).unbind(2)
    weights = (rows[..., None] * columns[..., None, :]).flatten(2)  # (B, N, 9)
    return (weights[:, :, None] @ pixels_taken(values, pixels.minimum(last)))[:, :, 0]


def embedding(maps: Maps) -> Tensor:
    """Return (B, 248): each channel's maximum over the dense descriptors, the description of a place."""
    size = maps[0].shape[-2:]
    coarse = [interpolate(each, size=size, mode="bilinear", align_corners=False) for each in maps[1:]]
    return torch.cat([each.amax((2, 3)) for each in (maps[0], *coarse)], 1)


def _last_pixel(values: Tensor, points_px: Tensor) -> Tensor:
    return points_px.new_tensor([values.shape[-2] - 1, values.shape[-1] - 1])
