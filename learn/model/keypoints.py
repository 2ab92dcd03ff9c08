"""Keypoints: one a cell of the picture, at the expected place under a softmax over the cell's pixels.

Source: Barnes & Posner 2020, section III-B: the picture is cut into 20 x 20 cells, 400 keypoints; the score
of a keypoint is the sigmoid of the score map, interpolated at the keypoint.
"""

from dataclasses import dataclass

import torch
from torch import Tensor

from echoscape.learn.model.descriptors import descriptors_at, sampled
from echoscape.learn.model.unet import Maps


@dataclass(frozen=True, kw_only=True)
class Keypoints:
    """N keypoints of each of B pictures.

    points_px (B, N, 2): row, column; descriptors (B, N, 248), of unit length; scores (B, N), from 0 to 1.
    """

    points_px: Tensor
    descriptors: Tensor
    scores: Tensor


def cell_centres(size: int, cells: int, *, like: Tensor) -> Tensor:
    """Return (cells^2, 2) row, column [px] of the cells' middles, row by row."""
    side = size / cells
    middle = (torch.arange(cells, dtype=like.dtype, device=like.device) + 0.5) * side - 0.5
    return torch.stack(torch.meshgrid(middle, middle, indexing="ij"), -1).reshape(-1, 2)


def expected_places(logits: Tensor, cells: int) -> Tensor:
    """Return (B, cells^2, 2): for each cell the sum over its pixels of softmax(logits) (row, column) [px].

    logits: (B, 1, H, H).

    Raises:
        ValueError: H is no multiple of `cells`.
    """
    batch, _, size, width = logits.shape
    if size != width or size % cells:
        raise ValueError(f"logits must be square and a multiple of {cells} wide, got {size} x {width}")
    side = size // cells
    tiles = logits.reshape(batch, cells, side, cells, side).transpose(2, 3)  # (B, cells, cells, side, side)
    weights = tiles.reshape(batch, cells * cells, side * side).softmax(-1)
    offset = torch.arange(side, dtype=logits.dtype, device=logits.device) - (side - 1) / 2
    grid = torch.stack(torch.meshgrid(offset, offset, indexing="ij"), -1).reshape(-1, 2)
    return cell_centres(size, cells, like=logits) + weights @ grid


def keypoints_at(points_px: Tensor, maps: Maps, scores: Tensor | None) -> Keypoints:
    """Return the keypoints at points (B, N, 2); scores: (B, 1, H, W) after the sigmoid, None for 1."""
    found = torch.ones_like(points_px[..., 0]) if scores is None else sampled(scores, points_px)[..., 0]
    return Keypoints(points_px=points_px, descriptors=descriptors_at(maps, points_px), scores=found)
