"""Matching as `matching` has it, but piece by piece, without the matrix of all similarities.

Source: the sums of `matching.expected_matches`. The dense descriptors of the picture to be searched are made
once, on every pixel or between every four; similarities with them are made, used and forgotten while they are
in the processor's cache, and only the softmax's numerators are kept where gradients are asked for.
"""

from collections.abc import Iterator
from dataclasses import dataclass
from typing import Any

import torch
from torch import Tensor
from torch.autograd import Function
from torch.autograd.function import once_differentiable
from torch.nn.functional import avg_pool2d, interpolate, linear

from echoscape.learn.descriptors import sampled, unit
from echoscape.learn.matching import pixel_grid
from echoscape.learn.unet import Maps

STRIDES = (1, 2)
_SMALLEST_SUM = 1e-20
_PIECE = 1280
"""Samples whose similarities with 400 keypoints (2 MB) stay in the processor's cache."""
_LEAST_LOGIT = -60.0
"""e to this adds nothing; a little less would be a subnormal number, which processors are slow with."""
_EVERY = 15
"""Every how many samples the softmax's shift is looked for first."""


@dataclass(frozen=True, kw_only=True)
class DensePicture:
    """Unit descriptors of B pictures on a grid: (B, 248, rows, columns); stride: pixels a sample is wide."""

    descriptors: Tensor
    stride: int

    def similarity(self, queries: Tensor, places_px: Tensor) -> Tensor:
        """Return (B, N): the cosine of queries (B, N, 248) at places (B, N, 2) row, column [px].

        Interpolated bilinearly between the cosines of the samples, the outermost of which go on outside.
        """
        places = (places_px + 0.5) / self.stride - 0.5
        return (queries * sampled(self.descriptors, places)).sum(-1)


@dataclass(frozen=True, kw_only=True)
class Search:
    """What a search of N keypoints in B pictures says.

    places_px: (B, N, 2) expected row, column [px]; log_sums: (B, N), the logarithm of the sum over the
    samples of exp(T q . d): the softmax's denominator.
    """

    places_px: Tensor
    log_sums: Tensor


def dense_picture(maps: Maps, *, stride: int = 1) -> DensePicture:
    """Return the dense descriptors of maps (B, C, h, w) each; stride 2 looks between every four pixels.

    Raises:
        ValueError: the stride is none of `STRIDES`.
    """
    if stride not in STRIDES:
        raise ValueError(f"stride must be one of {STRIDES}, got {stride}")
    size = [length // stride for length in maps[0].shape[-2:]]
    finest = maps[0] if stride == 1 else avg_pool2d(maps[0], 2)
    coarse = [interpolate(each, size=size, mode="bilinear", align_corners=False) for each in maps[1:]]
    return DensePicture(descriptors=unit(torch.cat([finest, *coarse], 1), dim=1), stride=stride)


def fast_search(
    queries: Tensor, picture: DensePicture, *, temperature: float, dtype: torch.dtype = torch.float32
) -> Search:
    """Look for descriptors (B, N, 248) of unit length in pictures, with gradients.

    The places are those of `matching.expected_matches` on the picture's grid; dtype: of the products, whose
    sums stay float32.
    """
    rows, columns = picture.descriptors.shape[-2:]
    grid = pixel_grid(rows, columns, like=queries)
    weights = torch.cat([torch.ones_like(grid[:, :1]), grid], 1).T.contiguous()
    places, log_sums = [], []
    for query, descriptors in zip(queries, picture.descriptors, strict=True):
        place, log_sum = _Searched.apply(temperature * query, descriptors.flatten(1), weights, dtype)
        places.append((place + 0.5) * picture.stride - 0.5)
        log_sums.append(log_sum)
    return Search(places_px=torch.stack(places), log_sums=torch.stack(log_sums))


class _Searched(Function):
    """Softmax of queries (N, K) times descriptors (K, P): expected place in samples, and log sum."""

    @staticmethod
    def forward(  # type: ignore[override]
        ctx: Any, queries: Tensor, descriptors: Tensor, weights: Tensor, dtype: torch.dtype
    ) -> tuple[Tensor, Tensor]:
        left, right = queries.to(dtype), descriptors.to(dtype)
        kept: list[Tensor] = []
        keep = kept if any(ctx.needs_input_grad) else None
        shift = _largest(left, right, _EVERY)
        sums = _sums(left, right, shift, weights, keep)
        if not bool(sums.isfinite().all() and (sums[:, 0] > _SMALLEST_SUM).all()):
            kept.clear()
            shift = _largest(left, right, 1)
            sums = _sums(left, right, shift, weights, keep)
        places = sums[:, 1:] / sums[:, :1]
        ctx.save_for_backward(left, right, weights, sums[:, 0], places, *kept)
        return places, shift.to(sums.dtype) + sums[:, 0].log()

    @staticmethod
    @once_differentiable
    def backward(  # type: ignore[override]
        ctx: Any, slope: Tensor, log_slope: Tensor
    ) -> tuple[Tensor | None, ...]:
        """Return the derivatives by queries and descriptors.

        With P the softmax, x_p a sample's place, e the expected one, g the derivative by e and l that by the
        log sum, that by logit p is P_p (l + g . x_p - g . e).
        """
        left, right, weights, total, places, *kept = ctx.saved_tensors
        constant = log_slope[:, None] - (slope * places).sum(1, keepdim=True)
        factor = torch.cat([constant, slope], 1) / total[:, None]
        by_left, by_right = (
            torch.zeros_like(left, dtype=slope.dtype),
            torch.empty_like(right, dtype=slope.dtype),
        )
        for part, numerators in zip(_pieces(right), kept, strict=True):
            piece = (factor @ weights[:, part]).mul_(numerators).to(right.dtype)
            by_left += piece @ right[:, part].T
            by_right[:, part] = left.T @ piece
        return by_left, by_right, None, None


def _largest(left: Tensor, right: Tensor, every: int) -> Tensor:
    """Return (N,): the largest logit of every so many samples."""
    return (left @ right[:, ::every]).amax(1)


def _sums(left: Tensor, right: Tensor, shift: Tensor, weights: Tensor, keep: list[Tensor] | None) -> Tensor:
    """Return (N, 3): the sums over samples of e times weights (3, P), e = exp(left right - shift), kept."""
    total = weights.new_zeros(len(left), 3)
    # The shift goes into the product, so that in bfloat16 logits near the highest keep their digits.
    start = -shift[:, None]
    for part in _pieces(right):
        numerators = torch.addmm(start, left, right[:, part]).to(weights.dtype)
        numerators.clamp_(min=_LEAST_LOGIT).exp_()
        total += linear(numerators, weights[:, part])
        if keep is not None:
            keep.append(numerators.to(right.dtype))
    return total


def _pieces(right: Tensor) -> Iterator[slice]:
    for first in range(0, right.shape[1], _PIECE):
        yield slice(first, first + _PIECE)
