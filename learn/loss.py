"""What training makes small: the error of the pose, and, where it is asked for, that of every match.

Source: Barnes & Posner 2020, equation 6: |t^ - t|_2 + alpha |R^ R^T - 1|_2 with alpha = 10. The error of
matches is ours: true motions say where each keypoint is in the other scan, which real logs rarely know well.
"""

import torch
from torch import Tensor

from echoscape.learn.model import Matches
from echoscape.learn.pose import Motion, residuals_m

ALPHA_M = 10.0
"""Weight of the rotation's error [m]."""

_SMALLEST_WEIGHT = 1e-12


def pose_loss(estimate: Motion, truth: Motion, *, alpha_m: float = ALPHA_M) -> Tensor:
    """Return (B,) [m]: |t^ - t| + alpha |R^ R^T - 1|, both spectral norms.

    For plane rotations that differ by delta the second is 2 |sin(delta / 2)|: both columns of the matrix
    have that length and are at right angles. At an error of exactly 0 the gradient is 0.
    """
    shift = torch.linalg.vector_norm(estimate.translation_m - truth.translation_m, dim=-1)
    turn = estimate.rotation @ truth.rotation.transpose(1, 2) - torch.eye(2).to(estimate.rotation)
    return shift + alpha_m * torch.linalg.vector_norm(turn[..., 0], dim=-1)


def match_loss(matches: Matches, truth: Motion, *, reach_m: float) -> Tensor:
    """Return (B,) [m]: the weighted mean distance of matches from where the true motion puts their keypoints.

    With e = |d - (R s + t)| and shares v = w / sum w it is sum v e, whose slopes go into the places, plus
    sum v min(e, reach_m), whose slopes go into the weights alone: matches gone astray pull their places back
    with full force, but teach the weights no more than a bounded lesson.
    """
    distance_m = residuals_m(matches.source_m, matches.destination_m, truth)
    share = matches.weights / matches.weights.sum(1, keepdim=True).clamp(min=_SMALLEST_WEIGHT)
    places = (share.detach() * distance_m).sum(1)
    return places + (share * distance_m.detach().clamp(max=reach_m)).sum(1)


def likelihood_loss(matches: Matches) -> Tensor:
    """Return (B,) [nat]: the weighted mean surprisal of where the keypoints truly are.

    The cross entropy of the matching softmax (InfoNCE, van den Oord et al. 2018, over all pixels): it pulls
    on descriptors at once where an expected place, a mean over a whole picture, hardly moves. The weights are
    given: this loss does not teach them.

    Raises:
        ValueError: the matches were found without the true motion.
    """
    if matches.surprisal is None:
        raise ValueError("matches must hold their surprisal, which takes the true motion")
    weights = matches.weights.detach()
    share = weights / weights.sum(1, keepdim=True).clamp(min=_SMALLEST_WEIGHT)
    return (share * matches.surprisal).sum(1)


def pose_errors(estimate: Motion, truth: Motion) -> tuple[Tensor, Tensor]:
    """Return the errors of the translation (B,) [m] and of the rotation (B,) [rad], 0 or more."""
    difference = estimate.yaw_rad - truth.yaw_rad
    turn = torch.atan2(difference.sin(), difference.cos()).abs()
    return torch.linalg.vector_norm(estimate.translation_m - truth.translation_m, dim=-1), turn
