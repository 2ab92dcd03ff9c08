"""Keypoints of images: locations, descriptors and scores.

Source: Barnes & Posner 2020, section III-B.
"""

from dataclasses import dataclass

import torch
from torch import Tensor

from echoscape.learn.model.descriptors import descriptors_at
from echoscape.learn.model.keypoint_model import Maps
from echoscape.learn.model.pixel_coords import sampled


@dataclass(frozen=True, kw_only=True)
class Keypoints:
    """N keypoints of each of B images.

    Attributes:
        points_px: Locations (B, N, 2): row, column [px].
        descriptors: Descriptors (B, N, 248) of unit length.
        scores: Scores (B, N) from 0 to 1.
    """

    points_px: Tensor
    descriptors: Tensor
    scores: Tensor


def keypoints_at(points_px: Tensor, maps: Maps, scores: Tensor | None) -> Keypoints:
    """Read descriptors and scores at keypoint locations.

    Args:
        points_px: Locations (B, N, 2): row, column [px].
        maps: Maps of the encoder.
        scores: Scores (B, 1, H, W) from 0 to 1; None for 1 everywhere.

    Returns:
        The keypoints.
    """
    found = torch.ones_like(points_px[..., 0]) if scores is None else sampled(scores, points_px)[..., 0]
    return Keypoints(points_px=points_px, descriptors=descriptors_at(maps, points_px), scores=found)
