"""Descriptors at keypoints without the dense map: from nine pixels of each of the encoder's maps.

Source: Barnes & Posner 2020, section III-A (dense descriptors). Maps are resized bilinearly with pixels as
areas (`align_corners=False`): sample j of map l lies at pixel 2^l (j + 1/2) - 1/2.
"""

import torch
from torch import Tensor

from echoscape.learn.model.keypoint_model import Maps, unit
from echoscape.learn.model.ops.bilinear import pixels_taken, shares_of_places


def descriptors_at(maps: Maps, points_px: Tensor) -> Tensor:
    """Compute `unit(sampled(dense_descriptors(maps), points_px))` without the dense descriptors.

    Bilinear interpolation of a bilinearly resized map is a weighted sum of 3 x 3 of the map's pixels.

    Args:
        maps: Maps of the encoder, finest first.
        points_px: Points (B, N, 2): row, column [px].

    Returns:
        Descriptors (B, N, 248) of unit length.
    """
    last = points_px.new_tensor(maps[0].shape[-2:]) - 1
    points_px = points_px.clamp(min=0).minimum(last)
    corner = points_px.detach().floor()
    part = (points_px - corner)[..., None]
    shares = torch.cat([1 - part, part], -1)  # (B, N, 2, 2): of two rows and of two columns
    around = torch.stack([corner, (corner + 1).minimum(last)], -1)
    found = [_between_pixels(each, (around + 0.5) / 2**i - 0.5, shares) for i, each in enumerate(maps)]
    return unit(torch.cat(found, -1))


def _between_pixels(values: Tensor, places: Tensor, shares: Tensor) -> Tensor:
    """Return (B, N, C): maps (B, C, h, w) at two rows and two columns (B, N, 2, 2), weighted by shares."""
    last = places.new_tensor(values.shape[-2:])[:, None] - 1
    places = places.clamp(min=0).minimum(last)
    pixels = places[..., :1].floor() + torch.arange(3).to(places)  # two places are at most one pixel apart
    rows, columns = (shares[..., None] * shares_of_places(places, pixels)).sum(3).unbind(2)
    weights = (rows[..., None] * columns[..., None, :]).flatten(2)  # (B, N, 9)
    return (weights[:, :, None] @ pixels_taken(values, pixels.minimum(last)))[:, :, 0]
