"""Local search: the matching softmax times a normal prior, over the samples around each predicted location.

Source: the softmax of `keypoint_model.matched_locations`. With a prior of a metre or two nearly all samples
of an image have no weight; only those up to `REACH` standard deviations away along each side are compared.
The moments of the prior over the same samples are returned as well, since edges and the grid change them.

Dense descriptors are not computed: resizing is linear, so keypoints are compared with the few pixels of each
of the encoder's maps around them and the similarities are resized, one number per pixel instead of up to 128.
"""

import math
from dataclasses import dataclass

import torch
from torch import Tensor

from echoscape.learn.model.feature_pyramid import FeaturePyramid, Layer
from echoscape.learn.model.ops.bilinear import pixels_taken, shares_of_places

REACH = 3.5
"""Standard deviations up to which samples are compared; 5e-4 of a normal distribution lies beyond."""
_LEAST_PX2 = 0.02
"""Smallest variance of a location, even where one sample has all the weight, for finite inverses [px^2]."""
_PIECE = 2**25
"""Numbers of a layer of maps that are read in one piece (128 MB)."""


@dataclass(frozen=True, kw_only=True)
class Near:
    """Prior of a local search.

    Attributes:
        places_px: Predicted locations (B, N, 2): row, column [px].
        deviation_px: Standard deviation [px].

    Raises:
        ValueError: The standard deviation is not finite and above 0.
    """

    places_px: Tensor
    deviation_px: float

    def __post_init__(self) -> None:
        if not 0 < self.deviation_px < math.inf:
            raise ValueError(f"deviation_px must be finite and above 0, got {self.deviation_px}")


@dataclass(frozen=True, kw_only=True)
class Moments:
    """Moments of distributions over the image.

    Attributes:
        places_px: Means (..., 2): row, column [px].
        spread_px2: Covariances (..., 2, 2) [px^2], `_LEAST_PX2` included.
    """

    places_px: Tensor
    spread_px2: Tensor


@dataclass(frozen=True, kw_only=True)
class NearSearch:
    """Result of a local search of N keypoints in B images.

    Attributes:
        found: Moments of the posterior.
        expected: Moments of the prior over the same samples.
    """

    found: Moments
    expected: Moments


def match_local(queries: Tensor, pyramid: FeaturePyramid, *, temperature: float, near: Near) -> NearSearch:
    """Search for keypoints around their predicted locations.

    Args:
        queries: Descriptors (B, N, 248) of unit length.
        pyramid: The images to search.
        temperature: T of the softmax.
        near: The prior.

    Returns:
        Moments of posterior and prior.
    """
    reach = min(math.ceil(REACH * near.deviation_px / pyramid.stride), max(pyramid.shape) - 1)
    most = max(
        _pixels_around(each.factor, reach) ** 2 * each.values[:, :, 0, 0].numel() for each in pyramid.layers
    )
    count = max(_PIECE // most, 1)
    pieces = [
        _searched(temperature * some, pyramid, where, near.deviation_px, reach)
        for some, where in zip(queries.split(count, 1), near.places_px.split(count, 1), strict=True)
    ]
    found, spread, expected, expected_spread = (torch.cat(each, 1) for each in zip(*pieces, strict=True))
    return NearSearch(
        found=Moments(places_px=found, spread_px2=spread),
        expected=Moments(places_px=expected, spread_px2=expected_spread),
    )


def _pixels_around(factor: int, reach: int) -> int:
    """Return how many pixels a side, `factor` samples wide, samples up to `reach` away depend on."""
    return 2 * reach + 1 if factor == 1 else math.ceil(2 * reach / factor) + 2


def _likeness(queries: Tensor, layer: Layer, middle: Tensor, reach: int) -> Tensor:
    """Return (B, N, 2 reach + 1, 2 reach + 1): products of queries (B, N, C) with a layer's resized maps.

    middle: (B, N, 2) row, column of the samples in the middle.
    """
    side, step = _pixels_around(layer.factor, reach), torch.arange(2 * reach + 1).to(middle)
    last = middle.new_tensor(layer.values.shape[-2:])[:, None] - 1
    first = ((middle - reach + 0.5) / layer.factor - 0.5).floor()
    pixels = first[..., None] + step[:side]  # (B, N, 2, side), some of them outside
    around = pixels_taken(layer.values, pixels.clamp(min=0).minimum(last))
    products = (queries[:, :, None] @ around.transpose(2, 3)).unflatten(-1, (side, side))[:, :, 0]
    if layer.factor == 1:
        return products
    places = ((middle[..., None] - reach + step + 0.5) / layer.factor - 0.5).clamp(min=0)
    down, right = shares_of_places(places.minimum(last), pixels).unbind(2)
    return down @ products @ right.transpose(2, 3)


def _searched(
    queries: Tensor, pyramid: FeaturePyramid, expected_px: Tensor, deviation_px: float, reach: int
) -> tuple[Tensor, Tensor, Tensor, Tensor]:
    """Return places (B, N, 2) [px], covariances (B, N, 2, 2) [px^2], and the same of the prior."""
    stride, size = pyramid.stride, queries.new_tensor(pyramid.shape)
    middle = ((expected_px + 0.5) / stride - 0.5).round().clamp(min=0).minimum(size - 1)
    samples = middle[..., None] + torch.arange(-reach, reach + 1).to(middle)  # (B, N, 2, side)
    likeness = torch.zeros((), dtype=queries.dtype)
    parts = queries.split([each.values.shape[1] for each in pyramid.layers], 2)
    for part, layer in zip(parts, pyramid.layers, strict=True):
        likeness = likeness + _likeness(part, layer, middle, reach)
    around = samples.clamp(min=0).minimum(size[:, None] - 1)
    likeness = likeness / pixels_taken(pyramid.lengths[:, None], around).view_as(likeness)
    away_px = (samples + 0.5) * stride - 0.5 - expected_px[..., None]
    outside = (samples < 0) | (samples >= size[:, None])
    log_prior = (-(away_px**2) / (2 * deviation_px**2)).masked_fill(outside, -math.inf)
    logits = likeness + log_prior[:, :, 0, :, None] + log_prior[:, :, 1, None]
    chances = logits.flatten(2).softmax(-1).view_as(logits)
    prior = log_prior.softmax(-1)
    found = _moments(chances, away_px)
    expected = _moments(prior[:, :, 0, :, None] * prior[:, :, 1, None], away_px)
    return expected_px + found[0], found[1], expected_px + expected[0], expected[1]


def _moments(chances: Tensor, away_px: Tensor) -> tuple[Tensor, Tensor]:
    """Return means (B, N, 2) [px] and covariances (B, N, 2, 2) [px^2], `_LEAST_PX2` included.

    chances: (B, N, side, side), whose sum is 1; away_px: (B, N, 2, side) of rows and of columns.
    """
    by_side = torch.stack([chances.sum(3), chances.sum(2)], 2)
    mean = (by_side * away_px).sum(-1)
    off = away_px - mean[..., None]
    spread = torch.diag_embed((by_side * off**2).sum(-1) + _LEAST_PX2)
    crossed = off[:, :, :1] @ chances @ off[:, :, 1:].transpose(2, 3)  # (B, N, 1, 1)
    return mean, spread + crossed * (1 - torch.eye(2)).to(spread)
