"""Matching near expected places: a softmax over the samples around each, times a normal distribution.

Source: the softmax of `matching`, times a normal distribution. Where keypoints are looked for within a metre
or two, almost all of a picture weighs nothing; only samples up to `REACH` standard deviations away, each way,
are compared.
"""

import math
from dataclasses import dataclass

import torch
from torch import Tensor

from echoscape.learn.fast_matching import DensePicture, Search
from echoscape.learn.matching import pixel_grid

REACH = 3.5
"""Standard deviations that samples are looked at up to: what lies beyond has less than a thousandth."""


@dataclass(frozen=True, kw_only=True)
class Near:
    """Where keypoints are expected: places_px (B, N, 2) row, column, and a standard deviation [px]."""

    places_px: Tensor
    deviation_px: float

    def __post_init__(self) -> None:
        if not self.deviation_px > 0:
            raise ValueError(f"deviation_px must be above 0, got {self.deviation_px}")


def near_search(queries: Tensor, picture: DensePicture, *, temperature: float, near: Near) -> Search:
    """Look for descriptors (B, N, 248) of unit length in pictures near where they are expected."""
    found = [
        _searched(temperature * query, descriptors, places, near.deviation_px, picture.stride)
        for query, descriptors, places in zip(queries, picture.descriptors, near.places_px, strict=True)
    ]
    places, log_sums, spreads = zip(*found, strict=True)
    return Search(
        places_px=torch.stack(places), log_sums=torch.stack(log_sums), spread_px2=torch.stack(spreads)
    )


def _searched(
    queries: Tensor, descriptors: Tensor, expected_px: Tensor, deviation_px: float, stride: int
) -> tuple[Tensor, Tensor, Tensor]:
    """Return places (N, 2) [px], log sums (N,) and covariances (N, 2, 2) [px^2].

    queries: (N, K); descriptors: (K, rows, columns).
    """
    rows, columns = descriptors.shape[-2:]
    reach = math.ceil(REACH * deviation_px / stride)
    side = 2 * reach + 1
    size = queries.new_tensor([rows, columns])
    middle = ((expected_px + 0.5) / stride - 0.5).round().clamp(min=0).minimum(size - 1)
    samples = middle[:, None] + pixel_grid(side, side, like=queries) - reach  # (N, W, 2)
    inside = ((samples >= 0) & (samples < size)).all(-1)
    index = samples.clamp(min=0).minimum(size - 1).long()
    flat = descriptors.permute(1, 2, 0).reshape(rows * columns, -1)
    taken = flat[index[..., 0] * columns + index[..., 1]]  # (N, W, K)
    away_px = (samples + 0.5) * stride - 0.5 - expected_px[:, None]
    logits = (taken @ queries[..., None])[..., 0] - (away_px**2).sum(-1) / (2 * deviation_px**2)
    logits = logits.masked_fill(~inside, -math.inf)
    chances = logits.softmax(-1)[:, None]  # (N, 1, W)
    mean = chances @ away_px  # (N, 1, 2)
    off = away_px - mean
    return (
        expected_px + mean[:, 0],
        logits.logsumexp(-1),
        off.transpose(1, 2) @ (chances.transpose(1, 2) * off),
    )
