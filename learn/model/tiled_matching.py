"""Global search by tiles: `keypoint_model.matched_locations` without the matrix of all similarities.

Similarities with the dense descriptors, on every sample of the image, are computed, used and dropped while
they are in the processor's cache; only the softmax's numerators are kept where gradients are asked for.
"""

from collections.abc import Iterator
from dataclasses import dataclass
from typing import Any

import torch
from torch import Tensor
from torch.autograd import Function
from torch.autograd.function import once_differentiable
from torch.nn.functional import linear

from echoscape.learn.model.feature_pyramid import FeaturePyramid
from echoscape.learn.model.keypoint_model import MIN_NORM
from echoscape.learn.model.pixel_coords import pixel_grid

_SMALLEST_SUM = 1e-20
_PIECE = 1280
"""Samples whose similarities with 400 keypoints (2 MB) stay in the processor's cache."""
_LEAST_LOGIT = -60.0
"""e to this adds nothing; a little less would be a subnormal number, which processors are slow with."""
_EVERY = 15
"""Interval of the samples from which the softmax's shift is estimated first."""


@dataclass(frozen=True, kw_only=True)
class Search:
    """Result of a global search of N keypoints in B images.

    Attributes:
        places_px: Matched locations (B, N, 2): row, column [px].
        log_sums: Logarithm of the softmax's denominator, the sum over the samples of exp(T q . d) (B, N).
    """

    places_px: Tensor
    log_sums: Tensor


def match_global(queries: Tensor, pyramid: FeaturePyramid, *, temperature: float) -> Search:
    """Search for keypoints in whole images, with gradients.

    Args:
        queries: Descriptors (B, N, 248) of unit length; sums have their number format.
        pyramid: The images to search; products have its number format.
        temperature: T of the softmax.

    Returns:
        Locations as those of `matched_locations` over the image's samples, and the softmax's denominators.
    """
    grid = pixel_grid(*pyramid.shape, like=queries)
    weights = torch.cat([torch.ones_like(grid[:, :1]), grid], 1).T.contiguous()
    places, log_sums = [], []
    lengths = pyramid.lengths.detach().flatten(1)
    for query, descriptors, length in zip(queries, pyramid.stacked, lengths, strict=True):
        place, log_sum = _Searched.apply(temperature * query, descriptors, length, weights)
        places.append((place + 0.5) * pyramid.stride - 0.5)
        log_sums.append(log_sum)
    return Search(places_px=torch.stack(places), log_sums=torch.stack(log_sums))


class _Searched(Function):
    """Softmax of queries (N, K) times descriptors (K, P) over lengths (P,): place in samples, log sum."""

    @staticmethod
    def forward(  # type: ignore[override]
        ctx: Any, queries: Tensor, descriptors: Tensor, lengths: Tensor, weights: Tensor
    ) -> tuple[Tensor, Tensor]:
        left, right = queries.to(descriptors.dtype), _unit_pieces(descriptors, lengths)
        kept: list[Tensor] = []
        keep = kept if any(ctx.needs_input_grad) else None
        shift = _largest(left, right, _EVERY)
        sums = _sums(left, right, shift, weights, keep)
        if not bool(sums.isfinite().all() and (sums[:, 0] > _SMALLEST_SUM).all()):
            kept.clear()
            shift = _largest(left, right, 1)
            sums = _sums(left, right, shift, weights, keep)
        places = sums[:, 1:] / sums[:, :1]
        ctx.save_for_backward(left, lengths, weights, sums[:, 0], places, *(right if keep else []), *kept)
        return places, shift.to(sums.dtype) + sums[:, 0].log()

    @staticmethod
    @once_differentiable
    def backward(  # type: ignore[override]
        ctx: Any, slope: Tensor, log_slope: Tensor
    ) -> tuple[Tensor | None, ...]:
        """Return the derivatives by queries and descriptors.

        With P the softmax, x_p the location of a sample, e the matched one, g the derivative by e and l that
        by the log sum, that by logit p is P_p (l + g . x_p - g . e). With u = d / |d| and h the derivative by
        u, that by d is (h - u (u . h)) / |d|, of descriptors that are not too short to be made one long.
        """
        left, lengths, weights, total, places, *kept = ctx.saved_tensors
        constant = log_slope[:, None] - (slope * places).sum(1, keepdim=True)
        factor = torch.cat([constant, slope], 1) / total[:, None]
        by_left = torch.zeros_like(left, dtype=slope.dtype)
        by_descriptors = left.new_empty(left.shape[1], len(lengths))
        pieces = zip(_parts(len(lengths)), kept[: len(kept) // 2], kept[len(kept) // 2 :], strict=True)
        for part, unit, numerators in pieces:
            piece = (factor @ weights[:, part]).mul_(numerators).to(unit.dtype)
            by_left += piece @ unit.T
            by_unit, long = (left.T @ piece).to(slope.dtype), lengths[part] > MIN_NORM
            along = torch.where(long, (by_unit * unit).sum(0), 0.0)
            by_unit.addcmul_(unit.to(slope.dtype), along, value=-1)
            by_descriptors[:, part] = by_unit.div_(lengths[part])
        return by_left, by_descriptors, None, None


def _unit_pieces(descriptors: Tensor, lengths: Tensor) -> list[Tensor]:
    """Return descriptors (K, P) over their lengths, piece by piece."""
    inverse = 1 / lengths
    return [(descriptors[:, part] * inverse[part]).to(descriptors.dtype) for part in _parts(len(lengths))]


def _largest(left: Tensor, right: list[Tensor], every: int) -> Tensor:
    """Return (N,): the largest logit of every so many samples."""
    return (left @ torch.cat([piece[:, ::every] for piece in right], 1)).amax(1)


def _sums(
    left: Tensor, right: list[Tensor], shift: Tensor, weights: Tensor, keep: list[Tensor] | None
) -> Tensor:
    """Return (N, 3): the sums over samples of e times weights (3, P), e = exp(left right - shift), kept."""
    total = weights.new_zeros(len(left), 3)
    # The shift goes into the product, so that in bfloat16 logits near the highest keep their digits.
    start = -shift[:, None]
    for part, piece in zip(_parts(weights.shape[1]), right, strict=True):
        numerators = torch.addmm(start, left, piece).to(weights.dtype)
        numerators.clamp_(min=_LEAST_LOGIT).exp_()
        total += linear(numerators, weights[:, part])
        if keep is not None:
            keep.append(numerators.to(piece.dtype))
    return total


def _parts(samples: int) -> Iterator[slice]:
    for first in range(0, samples, _PIECE):
        yield slice(first, first + _PIECE)
