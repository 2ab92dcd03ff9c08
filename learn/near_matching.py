"""Matching near expected places: a softmax over the samples around each, times a normal distribution.

Source: the softmax of `matching`. Where keypoints are looked for within a metre or two, almost all of a
picture weighs nothing; only samples up to `REACH` standard deviations away, each way, are compared. The
normal distribution's own moments over the same samples say what is found where all is alike, at edges too.
"""

import math
from dataclasses import dataclass

import torch
from torch import Tensor

from echoscape.learn.fast_matching import DensePicture
from echoscape.learn.matching import pixel_grid

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


def near_search(queries: Tensor, picture: DensePicture, *, temperature: float, near: Near) -> NearSearch:
    """Look for descriptors (B, N, 248) of unit length in pictures near where they are expected."""
    parts = []
    for query, descriptors, places in zip(queries, picture.descriptors, near.places_px, strict=True):
        reach = min(math.ceil(REACH * near.deviation_px / picture.stride), max(descriptors.shape[-2:]) - 1)
        count = max(_PIECE // ((2 * reach + 1) ** 2 * len(descriptors)), 1)
        pieces = [
            _searched(temperature * some, descriptors, where, near.deviation_px, picture.stride, reach)
            for some, where in zip(query.split(count), places.split(count), strict=True)
        ]
        parts.append([torch.cat(each) for each in zip(*pieces, strict=True)])
    found, spread, expected, expected_spread = (torch.stack(each) for each in zip(*parts, strict=True))
    return NearSearch(
        found=Moments(places_px=found, spread_px2=spread),
        expected=Moments(places_px=expected, spread_px2=expected_spread),
    )


def _searched(
    queries: Tensor, descriptors: Tensor, expected_px: Tensor, deviation_px: float, stride: int, reach: int
) -> tuple[Tensor, Tensor, Tensor, Tensor]:
    """Return what is found, places (N, 2) [px] and covariances (N, 2, 2) [px^2], and what is expected.

    queries: (N, K); descriptors: (K, rows, columns).
    """
    rows, columns = descriptors.shape[-2:]
    size = queries.new_tensor([rows, columns])
    middle = ((expected_px + 0.5) / stride - 0.5).round().clamp(min=0).minimum(size - 1)
    side = 2 * reach + 1
    samples = middle[:, None] + pixel_grid(side, side, like=queries) - reach  # (N, W, 2)
    inside = ((samples >= 0) & (samples < size)).all(-1)
    index = samples.clamp(min=0).minimum(size - 1).long()
    flat = descriptors.permute(1, 2, 0).reshape(rows * columns, -1)
    taken = flat[index[..., 0] * columns + index[..., 1]]  # (N, W, K)
    away_px = (samples + 0.5) * stride - 0.5 - expected_px[:, None]
    log_prior = -(away_px**2).sum(-1) / (2 * deviation_px**2)
    log_prior = log_prior.masked_fill(~inside, -math.inf)
    likeness = (taken @ queries[..., None])[..., 0]
    least = _LEAST_PX2 * torch.eye(2).to(queries)
    moments = []
    for logits in (likeness + log_prior, log_prior):
        chances = logits.softmax(-1)[..., None]  # (N, W, 1)
        mean = (chances * away_px).sum(1)
        off = away_px - mean[:, None]
        moments += [expected_px + mean, off.transpose(1, 2) @ (chances * off) + least]
    return moments[0], moments[1], moments[2], moments[3]
