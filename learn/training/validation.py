"""Errors of a model on pairs that it is not trained on, as the training log has them."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
import torch

from echoscape.learn.data.augmentation import AugmentationConfig
from echoscape.learn.data.pair_batch import Pair
from echoscape.learn.data.scan_pairs import ScanPairs
from echoscape.learn.geometry.procrustes import ROBUST_SCALE_PX
from echoscape.learn.model.fast_keypoint_model import FastKeypointModel, Matching
from echoscape.learn.model.keypoint_model import pose_loss
from echoscape.learn.training.config import ALPHA_M
from echoscape.learn.training.losses import pose_errors


@dataclass(frozen=True, kw_only=True)
class PairErrors:
    """Errors over pairs.

    Attributes:
        median_m: Median error of the translation [m].
        mean_m: Mean error of the translation [m].
        median_rad: Median error of the rotation [rad].
        mean_rad: Mean error of the rotation [rad].
        loss_m: Mean loss of the pose [m].
    """

    median_m: float
    mean_m: float
    median_rad: float
    mean_rad: float
    loss_m: float


def fixed_pairs(
    pairs: ScanPairs, count: int, *, seed: int, max_rotation_rad: float = 0.0, gap_power: float = 0.0
) -> list[Pair]:
    """Draw the pairs of all validations of a run.

    Args:
        pairs: Where to draw from.
        count: Number of pairs.
        seed: Seed of the draws.
        max_rotation_rad: Largest rotation of the source's image against the destination's [rad].
        gap_power: Pairs g scans apart are drawn in proportion to g^-gap_power.

    Returns:
        The pairs.
    """
    augmentation = AugmentationConfig(
        shared_rotation=False, max_rotation_rad=max_rotation_rad, ramp_start_step=0, ramp_end_step=1
    )
    stream = np.random.SeedSequence([seed, 1])
    draws = map(np.random.default_rng, stream.spawn(count))
    return [pairs.draw(augmentation, 1, rng=each, gap_power=gap_power) for each in draws]


@torch.no_grad()
def pair_errors(
    model: FastKeypointModel,
    pairs: ScanPairs,
    chosen: Sequence[Pair],
    matching: Matching,
    dtype: torch.dtype,
    *,
    compensate: bool = False,
) -> PairErrors:
    """Compute the errors of a model over pairs, their poses solved robustly as inference does.

    Args:
        model: The model, on any device; it is left in the mode in which it was.
        pairs: Where the pairs are from.
        chosen: The pairs.
        matching: How matches are searched for.
        dtype: Number format of the convolutions.
        compensate: Whether to move points to mid-scan first, by the true velocities.

    Returns:
        The errors.
    """
    training, device = model.training, next(model.parameters()).device
    scale_m = ROBUST_SCALE_PX * model.settings.image.pixel_m
    model.eval()
    found = []
    for pair in chosen:
        batch = pairs.batch([pair]).to(device)
        matches = model(batch.source, batch.destination, matching, dtype)
        if compensate:
            matches = batch.truth.to_mid_scan(matches)
        motion = matches.motion(robust_scale_m=scale_m)
        off_m, off_rad = pose_errors(motion, batch.motion)
        found.append((float(off_m), float(off_rad), float(pose_loss(motion, batch.motion, alpha_m=ALPHA_M))))
    model.train(training)
    translation_m, rotation_rad, loss_m = np.array(found).T
    return PairErrors(
        median_m=float(np.median(translation_m)),
        mean_m=float(translation_m.mean()),
        median_rad=float(np.median(rotation_rad)),
        mean_rad=float(rotation_rad.mean()),
        loss_m=float(loss_m.mean()),
    )
