"""Where a keypoint is in another picture: the expected place under a softmax over all of its pixels.

Source: Barnes & Posner 2020, section III-B: softmax of T times the cosine similarity with every pixel's
descriptor. This is the plain form that `fast_matching` is held against; it builds the dense descriptors.
"""

import torch
from torch import Tensor

from echoscape.learn.model.descriptors import dense_descriptors, unit
from echoscape.learn.model.unet import Maps


def expected_matches(queries: Tensor, maps: Maps, *, temperature: float) -> Tensor:
    """Return (B, N, 2) row, column [px]: sum over pixels p of softmax_p(T q . d_p) p.

    queries: (B, N, 248) of unit length; maps: of the picture to search, whose d_p have unit length too.
    """
    return expected_matches_in(queries, unit(dense_descriptors(maps), dim=1), temperature=temperature)


def expected_matches_in(queries: Tensor, dense: Tensor, *, temperature: float) -> Tensor:
    """Return what `expected_matches` does, of dense descriptors (B, 248, H, W) of unit length."""
    weights = (temperature * (queries @ dense.flatten(2))).softmax(-1)
    return weights @ pixel_grid(*dense.shape[-2:], like=queries)


def match_weights(similarity: Tensor, source_scores: Tensor, matched_scores: Tensor) -> Tensor:
    """Return the weight of each match, (d_s . d_d + 1) / 2 s_s s_d, all of the same shape.

    similarity: the cosine of the descriptor and the one at the place matched to it.
    """
    return 0.5 * (similarity + 1) * source_scores * matched_scores


def pixel_grid(rows: int, columns: int, *, like: Tensor) -> Tensor:
    """Return (rows * columns, 2) row, column [px] of every pixel, row by row."""
    axes = [torch.arange(count, dtype=like.dtype, device=like.device) for count in (rows, columns)]
    return torch.stack(torch.meshgrid(*axes, indexing="ij"), -1).reshape(-1, 2)
