"""How well a model does on pairs that it does not learn from: errors of pairs, as training logs them."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
import torch

from echoscape.learn.data.augmentation import TurnSettings
from echoscape.learn.data.scan_pairs import Pair, PairSet
from echoscape.learn.geometry.procrustes import ROBUST_SCALE_PX
from echoscape.learn.model.keypoint_model import KeypointModel, Matching
from echoscape.learn.training.losses import pose_errors, pose_loss


@dataclass(frozen=True, kw_only=True)
class PairErrors:
    """Errors over pairs: of translation [m] and rotation [rad], and the mean loss [m]."""

    median_m: float
    mean_m: float
    median_rad: float
    mean_rad: float
    loss_m: float


def fixed_pairs(
    pairs: PairSet, count: int, *, seed: int, largest_rad: float = 0.0, gap_power: float = 0.0
) -> list[Pair]:
    """Return pairs drawn once and for all; largest_rad: of the source's turn, both headings at 0."""
    turns = TurnSettings(common=False, largest_rad=largest_rad, first_step=0, full_step=1)
    stream = np.random.SeedSequence([seed, 1])
    draws = map(np.random.default_rng, stream.spawn(count))
    return [pairs.drawn(turns, 1, rng=each, gap_power=gap_power) for each in draws]


@torch.no_grad()
def pair_errors(
    model: KeypointModel,
    pairs: PairSet,
    chosen: Sequence[Pair],
    matching: Matching,
    dtype: torch.dtype,
    *,
    compensate: bool = False,
) -> PairErrors:
    """Return the errors over the chosen pairs, solved robustly as inference does.

    compensate: move points to mid-scan first, by the true velocities.

    The model is in training mode afterwards if it was before.
    """
    training = model.training
    scale_m = ROBUST_SCALE_PX * model.settings.image.pixel_m
    model.eval()
    found = []
    for pair in chosen:
        batch = pairs.batch([pair])
        matches = model(batch.source, batch.destination, matching, dtype)
        if compensate:
            matches = batch.truth.to_mid_scan(matches)
        motion = matches.motion(robust_scale_m=scale_m)
        shift, turn = pose_errors(motion, batch.motion)
        found.append((float(shift), float(turn), float(pose_loss(motion, batch.motion))))
    model.train(training)
    shift_m, turn_rad, loss_m = np.array(found).T
    return PairErrors(
        median_m=float(np.median(shift_m)),
        mean_m=float(shift_m.mean()),
        median_rad=float(np.median(turn_rad)),
        mean_rad=float(turn_rad.mean()),
        loss_m=float(loss_m.mean()),
    )
