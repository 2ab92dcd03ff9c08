"""Matching near expected places: a softmax over the samples around each, times a normal distribution.

Source: the softmax of `matching`. Where keypoints are looked for within a metre or two, almost all of a
picture weighs nothing; only samples up to `REACH` standard deviations away, each way, are compared. The
normal distribution's own moments over the same samples say what is found where all is alike, at edges too.

Dense descriptors are not made: resizing is linear, so a keypoint is compared with the few pixels of each of
the encoder's maps that lie around, and what comes out is resized, one number a pixel instead of up to 128.
"""

import math
from dataclasses import dataclass

import torch
from torch import Tensor

from echoscape.learn.resizing import shares_of_places
from echoscape.learn.searched_picture import SearchedPicture

REACH = 3.5
"""Standard deviations that samples are looked at up to: 5e-4 of a normal distribution lies beyond."""
_LEAST_PX2 = 0.02
"""Variance that a place has even where one sample has it all, so that inverses are finite [px^2]."""
_PIECE = 2**25
"""Numbers of descriptors that are taken at once (128 MB)."""


@dataclass(frozen=True, kw_only=True)
class Near:
    """Where keypoints are expected: places_px (B, N, 2) row, column, and a standard deviation [px]."""

    places_px: Tensor
    deviation_px: float

    def __post_init__(self) -> None:
        if not 0 < self.deviation_px < math.inf:
            raise ValueError(f"deviation_px must be finite and above 0, got {self.deviation_px}")


@dataclass(frozen=True, kw_only=True)
class Moments:
    """Mean places (..., 2) row, column [px] and covariances (..., 2, 2) [px^2], `_LEAST_PX2` included."""

    places_px: Tensor
    spread_px2: Tensor


@dataclass(frozen=True, kw_only=True)
class NearSearch:
    """What a search of N keypoints in B pictures found, and what it would have where all looks alike."""

    found: Moments
    expected: Moments


def near_search(queries: Tensor, picture: SearchedPicture, *, temperature: float, near: Near) -> NearSearch:
    """Look for descriptors (B, N, 248) of unit length in pictures near where they are expected."""
    reach = min(math.ceil(REACH * near.deviation_px / picture.stride), max(picture.shape) - 1)
    most = max(_pixels_around(layer.factor, reach) ** 2 * layer.values.shape[1] for layer in picture.layers)
    count = max(_PIECE // most, 1)
    parts = []
    for number, (query, places) in enumerate(zip(queries, near.places_px, strict=True)):
        pieces = [
            _searched(temperature * some, picture, number, where, near.deviation_px, reach)
            for some, where in zip(query.split(count), places.split(count), strict=True)
        ]
        parts.append([torch.cat(each) for each in zip(*pieces, strict=True)])
    found, spread, expected, expected_spread = (torch.stack(each) for each in zip(*parts, strict=True))
    return NearSearch(
        found=Moments(places_px=found, spread_px2=spread),
        expected=Moments(places_px=expected, spread_px2=expected_spread),
    )


def _pixels_around(factor: int, reach: int) -> int:
    """Return how many pixels a side, `factor` samples wide each, share in samples up to `reach` away."""
    return 2 * reach + 1 if factor == 1 else math.ceil(2 * reach / factor) + 2


def _likeness(queries: Tensor, values: Tensor, factor: int, middle: Tensor, reach: int) -> Tensor:
    """Return (N, 2 reach + 1, 2 reach + 1): products of queries (N, C) with maps (C, h, w), resized.

    middle: (N, 2) row, column of the samples in the middle.
    """
    channels, *size = values.shape
    side, step = _pixels_around(factor, reach), torch.arange(2 * reach + 1).to(middle)
    last = middle.new_tensor(size) - 1
    first = ((middle - reach + 0.5) / factor - 0.5).floor()
    pixels = first[..., None] + step[:side]  # (N, 2, side), some of them outside
    flat = values.permute(1, 2, 0).reshape(-1, channels)
    around = _taken(flat, size[1], pixels.clamp(min=0).minimum(last[:, None]))  # (N, side^2, C)
    products = (queries[:, None] @ around.transpose(1, 2)).view(-1, side, side)
    if factor == 1:
        return products
    places = ((middle[..., None] - reach + step + 0.5) / factor - 0.5).clamp(min=0)
    down, right = shares_of_places(places.minimum(last[:, None]), pixels).unbind(1)
    return down @ products @ right.transpose(1, 2)


def _taken(values: Tensor, columns: int, places: Tensor) -> Tensor:
    """Return (N, side^2, C): what values (rows * columns, C) are where rows and columns (N, 2, side) meet."""
    rows, across = places.long().unbind(1)
    index = rows[..., None] * columns + across[:, None]
    return values.index_select(0, index.flatten()).view(len(places), -1, values.shape[1])


def _searched(
    queries: Tensor,
    picture: SearchedPicture,
    number: int,
    expected_px: Tensor,
    deviation_px: float,
    reach: int,
) -> tuple[Tensor, Tensor, Tensor, Tensor]:
    """Return what is found, places (N, 2) [px] and covariances (N, 2, 2) [px^2], and what is expected.

    queries: (N, 248); number: of the picture among its batch.
    """
    stride, size = picture.stride, queries.new_tensor(picture.shape)
    middle = ((expected_px + 0.5) / stride - 0.5).round().clamp(min=0).minimum(size - 1)
    samples = middle[..., None] + torch.arange(-reach, reach + 1).to(middle)  # (N, 2, side)
    inside = (samples >= 0) & (samples < size[:, None])
    likeness = torch.zeros((), dtype=queries.dtype)
    parts = queries.split([layer.values.shape[1] for layer in picture.layers], 1)
    for part, layer in zip(parts, picture.layers, strict=True):
        likeness = likeness + _likeness(part, layer.values[number], layer.factor, middle, reach)
    around = samples.clamp(min=0).minimum(size[:, None] - 1)
    likeness = likeness / _taken(picture.lengths[number].reshape(-1, 1), picture.shape[1], around).view_as(
        likeness
    )
    away_px = (samples + 0.5) * stride - 0.5 - expected_px[..., None]
    log_prior = (-(away_px**2) / (2 * deviation_px**2)).masked_fill(~inside, -math.inf)
    logits = likeness + log_prior[:, 0, :, None] + log_prior[:, 1, None]
    chances = logits.flatten(1).softmax(-1).view_as(logits)
    prior = log_prior.softmax(-1)
    found = _moments(chances, away_px)
    expected = _moments(prior[:, 0, :, None] * prior[:, 1, None], away_px)
    return expected_px + found[0], found[1], expected_px + expected[0], expected[1]


def _moments(chances: Tensor, away_px: Tensor) -> tuple[Tensor, Tensor]:
    """Return means (N, 2) [px] and covariances (N, 2, 2) [px^2], `_LEAST_PX2` included.

    chances: (N, side, side), whose sum is 1; away_px: (N, 2, side) of rows and of columns.
    """
    by_side = torch.stack([chances.sum(2), chances.sum(1)], 1)
    mean = (by_side * away_px).sum(-1)
    off = away_px - mean[..., None]
    spread = torch.diag_embed((by_side * off**2).sum(-1) + _LEAST_PX2)
    crossed = off[:, :1] @ chances @ off[:, 1:].transpose(1, 2)  # (N, 1, 1)
    return mean, spread + crossed * (1 - torch.eye(2)).to(spread)
