"""Matching without the dense descriptors: the same expected places as `matching`, tile by tile.

Source: the sums of `matching.expected_matches`, rearranged (`learn/tiles.py` says how). A row of tiles is
resized, compared with all keypoints and added to the softmax's numerator and denominator; the backward pass
makes each row again. Memory grows with the keypoints and the width of the picture, not with its area.
"""

import math
from collections.abc import Iterator
from dataclasses import dataclass
from typing import Any

import torch
from torch import Tensor
from torch.autograd import Function
from torch.autograd.function import once_differentiable
from torch.nn.functional import linear

from echoscape.learn.matching import pixel_grid
from echoscape.learn.tiles import Layer, layers
from echoscape.learn.unet import Maps

STRIDES = (1, 2)
_SMALLEST_NORM = 1e-6
_SMALLEST_SUM = 1e-20
_EVERY = 15
"""Every how many samples of a tile the softmax's shift is looked for: 15 meets each row and column of 16."""
_TILES_AT_ONCE = 10
"""Tiles whose similarities with 400 keypoints (4 MB) stay in the processor's cache."""


@dataclass(frozen=True, kw_only=True)
class Search:
    """What a search of N keypoints in B pictures says.

    places_px: (B, N, 2) expected row, column [px]; log_sums: (B, N), the logarithm of the sum over all pixels
    of exp(T q . d), the softmax's denominator.
    """

    places_px: Tensor
    log_sums: Tensor


def fast_expected_matches(
    queries: Tensor, maps: Maps, *, temperature: float, stride: int = 1, dtype: torch.dtype = torch.float32
) -> Tensor:
    """Return (B, N, 2) row, column [px]: what `matching.expected_matches` returns, with its gradients.

    Its arguments and errors are those of `fast_search`.
    """
    return fast_search(queries, maps, temperature=temperature, stride=stride, dtype=dtype).places_px


def fast_search(
    queries: Tensor, maps: Maps, *, temperature: float, stride: int = 1, dtype: torch.dtype = torch.float32
) -> Search:
    """Look for descriptors in pictures, with gradients.

    queries: (B, N, 248) of unit length; maps: (B, C, h, w) each; stride 2 searches every second pixel only,
    between the pixels, each in the place of 4; dtype: of the large products, whose sums stay float32.

    Raises:
        ValueError: the stride is none of `STRIDES`.
    """
    if stride not in STRIDES:
        raise ValueError(f"stride must be one of {STRIDES}, got {stride}")
    places, log_sums = [], []
    for index in range(queries.shape[0]):
        prepared = layers(tuple(each[index] for each in maps), stride)
        plan = _Plan(
            factors=tuple(each.factor for each in prepared),
            side=prepared[0].side,
            temperature=temperature,
            dtype=dtype,
        )
        place, log_sum = _Searched.apply(plan, queries[index], *[each.values for each in prepared])
        places.append((place + 0.5) * stride - 0.5)
        log_sums.append(log_sum + 2 * math.log(stride))
    return Search(places_px=torch.stack(places), log_sums=torch.stack(log_sums))


@dataclass(frozen=True, kw_only=True)
class _Plan:
    """What the tensors do not say: how the layers lie, the softmax's temperature, the type of products."""

    factors: tuple[int, ...]
    side: int
    temperature: float
    dtype: torch.dtype

    def layers(self, values: tuple[Tensor, ...]) -> list[Layer]:
        return [
            Layer(values=each, factor=factor, side=self.side)
            for each, factor in zip(values, self.factors, strict=True)
        ]


@dataclass(frozen=True, kw_only=True)
class _Rows:
    """A row of tiles: the layers' rows under it, and where they lie."""

    number: int
    starts: tuple[int, ...]
    slices: tuple[Tensor, ...]


class _Searched(Function):
    """Softmax over all samples of one picture: the expected place under it, in samples, and its log sum."""

    @staticmethod
    def forward(  # type: ignore[override]
        ctx: Any, plan: _Plan, queries: Tensor, *values: Tensor
    ) -> tuple[Tensor, Tensor]:
        sums, shift = _sums(plan, queries, values, every=_EVERY)
        if not bool(sums.isfinite().all() and (sums[:, 0] > _SMALLEST_SUM).all()):
            sums, shift = _sums(plan, queries, values, every=1)
        places = sums[:, 1:] / sums[:, :1]
        ctx.plan = plan
        ctx.save_for_backward(queries, shift, sums[:, 0], places, *values)
        return places, shift + sums[:, 0].log()

    @staticmethod
    @once_differentiable
    def backward(  # type: ignore[override]
        ctx: Any, slope: Tensor, log_slope: Tensor
    ) -> tuple[Tensor | None, ...]:
        queries, shift, total, places, *values = ctx.saved_tensors
        plan: _Plan = ctx.plan
        constant = log_slope[:, None] - (slope * places).sum(1, keepdim=True)
        factor = torch.cat([constant, slope], 1) / total[:, None]
        into_queries = torch.zeros_like(queries)
        into_values = [torch.zeros_like(each) for each in values]
        for rows in _rows(plan, tuple(values)):
            leaves = [each.detach().requires_grad_() for each in (queries, *rows.slices)]
            with torch.enable_grad():
                left, right = _operands(plan, leaves[0], tuple(leaves[1:]))
            slopes = _slopes(plan, left.detach(), right.detach(), shift, factor, rows.number)
            into, *into_slices = torch.autograd.grad([left, right], leaves, slopes)
            into_queries += into
            for whole, start, part in zip(into_values, rows.starts, into_slices, strict=True):
                whole[:, start : start + part.shape[1]] += part
        return None, into_queries, *into_values


def _rows(plan: _Plan, values: tuple[Tensor, ...]) -> Iterator[_Rows]:
    """Yield the rows of tiles of a picture."""
    found = plan.layers(values)
    for number in range(values[0].shape[1] // plan.side):
        starts = tuple(number * each.step for each in found)
        cut = tuple(
            each.values[:, start : start + each.patch] for each, start in zip(found, starts, strict=True)
        )
        yield _Rows(number=number, starts=starts, slices=cut)


def _operands(plan: _Plan, queries: Tensor, slices: tuple[Tensor, ...]) -> tuple[Tensor, Tensor]:
    """Return (tiles, N, K) and (tiles, K, side^2) whose product is T times the cosine similarities."""
    left, right, squares = [], [], []
    first = 0
    for layer in plan.layers(slices):
        query = queries[:, first : first + layer.values.shape[0]]
        first += layer.values.shape[0]
        patches, weights = layer.patches(layer.values), layer.weights()
        if weights is None or not layer.narrow:
            wide = patches if weights is None else patches @ weights
            left.append(query.expand(wide.shape[0], -1, -1))
            right.append(wide)
            squares.append((wide * wide).sum(1, keepdim=True))
        else:
            left.append(layer.patches((query @ layer.values.flatten(1)).unflatten(1, layer.values.shape[1:])))
            right.append(weights.expand(patches.shape[0], -1, -1))
            products = (patches.transpose(1, 2) @ patches) @ weights
            squares.append((products * weights).sum(1, keepdim=True))
    norm = torch.stack(squares).sum(0).clamp(min=_SMALLEST_NORM**2).sqrt()
    return torch.cat(left, 2), torch.cat(right, 1) * (plan.temperature / norm)


def _chunks(plan: _Plan, left: Tensor, right: Tensor, shift: Tensor) -> Iterator[tuple[slice, Tensor]]:
    """Yield, a few tiles at a time, their logits less `shift` (N,): (tiles, N, side^2) in plan.dtype."""
    # The shift goes into the product, so that in bfloat16 logits near the highest keep their digits.
    start, left, right = (each.to(plan.dtype) for each in (-shift[None, :, None], left, right))
    for first in range(0, left.shape[0], _TILES_AT_ONCE):
        part = slice(first, first + _TILES_AT_ONCE)
        yield part, torch.baddbmm(start, left[part], right[part])


def _sums(plan: _Plan, queries: Tensor, values: tuple[Tensor, ...], *, every: int) -> tuple[Tensor, Tensor]:
    """Return (N, 3), the sums of e, e row and e column over all samples, and (N,) the shift.

    e = exp(logit - shift); the shift is the highest logit among every `every`-th sample of the tiles, and the
    sums so far are rescaled where it grows.
    """
    total, shift = queries.new_zeros(queries.shape[0], 3), queries.new_full(queries.shape[:1], -torch.inf)
    grid = _grid(plan.side, like=queries)
    for rows in _rows(plan, values):
        left, right = _operands(plan, queries, rows.slices)
        higher = torch.maximum(shift, torch.bmm(left, right[..., ::every]).amax((0, 2)))
        total, shift = total * (shift - higher).exp()[:, None], higher
        for part, logits in _chunks(plan, left, right, shift):
            tile = linear(logits.to(queries.dtype).exp_(), grid)
            tile[..., 1] += tile[..., 0] * (rows.number * plan.side)
            tile[..., 2] += tile[..., 0] * _columns(plan.side, part.start, tile)
            total += tile.sum(0)
    return total, shift


def _slopes(
    plan: _Plan, left: Tensor, right: Tensor, shift: Tensor, factor: Tensor, number: int
) -> tuple[Tensor, Tensor]:
    """Return the loss's derivatives by `left` and `right` for a row of tiles.

    With P the softmax, x_p a sample's place, e the expected one, g the derivative by e and l that by the log
    sum, that by logit p is P_p (l + g . x_p - g . e); factor: (N, 3), l - g . e and g, over the denominator.
    """
    by_left, by_right = torch.empty_like(left), torch.empty_like(right)
    low_left, low_right = left.to(plan.dtype), right.to(plan.dtype)
    grid = _grid(plan.side, like=left)
    for part, logits in _chunks(plan, left, right, shift):
        tile = factor.expand(logits.shape[0], -1, -1).clone()
        tile[..., 0] += factor[:, 1] * (number * plan.side) + factor[:, 2] * _columns(
            plan.side, part.start, tile
        )
        slope = (tile @ grid).mul_(logits.to(left.dtype).exp_()).to(plan.dtype)
        by_left[part] = torch.bmm(slope, low_right[part].transpose(1, 2))
        by_right[part] = torch.bmm(low_left[part].transpose(1, 2), slope)
    return by_left, by_right


def _grid(side: int, *, like: Tensor) -> Tensor:
    """Return (3, side^2): 1, row and column of a tile's samples."""
    places = pixel_grid(side, side, like=like)
    return torch.cat([torch.ones_like(places[:, :1]), places], 1).T.contiguous()


def _columns(side: int, first: int, tiles: Tensor) -> Tensor:
    """Return (tiles, 1): the column at which each of some tiles begins."""
    return ((torch.arange(tiles.shape[0], device=tiles.device) + first) * side).to(tiles.dtype)[:, None]
