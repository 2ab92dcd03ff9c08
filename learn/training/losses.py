"""What training makes small: the error of the pose, and, where it is asked for, that of every match.

Source: Barnes & Posner 2020, equation 6: |t^ - t|_2 + alpha |R^ R^T - 1|_2 with alpha = 10. The losses of
matches are ours: true motions say where each keypoint is in the other scan, which real logs rarely know well.
"""

import torch
from torch import Tensor

from echoscape.learn.geometry.matches import Matches
from echoscape.learn.geometry.procrustes import Motion, shares

ALPHA_M = 10.0
"""Weight of the rotation's error [m]."""

_SMALLEST_WEIGHT = 1e-12
_SMALLEST_DOUBT = 1e-6
_LEAST_CARE = 0.1


def pose_loss(estimate: Motion, truth: Motion, *, alpha_m: float = ALPHA_M) -> Tensor:
    """Return (B,) [m]: |t^ - t| + alpha |R^ R^T - 1|, both spectral norms.

    For plane rotations that differ by delta the second is 2 |sin(delta / 2)|: both columns of the matrix
    have that length and are at right angles. At an error of exactly 0 the gradient is 0.
    """
    shift = torch.linalg.vector_norm(estimate.translation_m - truth.translation_m, dim=-1)
    turn = estimate.rotation @ truth.rotation.transpose(1, 2) - torch.eye(2).to(estimate.rotation)
    return shift + alpha_m * torch.linalg.vector_norm(turn[..., 0], dim=-1)


def match_loss(matches: Matches, truth: Motion) -> Tensor:
    """Return (B,) [m]: the weighted mean distance of matches from where the true motion puts their keypoints.

    The weights are given: this loss teaches places alone. (Taught by it, they would gather on the one best
    match, which says nothing of the rotation.)
    """
    distance_m = matches.errors_m(truth)
    return (shares(matches.weights.detach()) * distance_m).sum(1)


def likelihood_loss(matches: Matches) -> Tensor:
    """Return (B,) [nat]: the weighted mean surprisal of where the keypoints truly are.

    The cross entropy of the matching softmax (InfoNCE, van den Oord et al. 2018, over all pixels): it pulls
    on descriptors at once where an expected place, a mean over a whole picture, hardly moves. The weights,
    plus a tenth so that none is left out, are given: this loss does not teach them.

    Raises:
        ValueError: the matches were found without the true motion.
    """
    if matches.surprisal is None:
        raise ValueError("matches must hold their surprisal, which takes the true motion")
    return (shares(matches.weights.detach() + _LEAST_CARE) * matches.surprisal).sum(1)


def score_loss(matches: Matches, truth: Motion, *, scale_m: float) -> Tensor:
    """Return (B,) [nat]: the mean cross entropy between weights and how right their matches are.

    A match e off is right by exp(-e^2 / (2 scale_m^2)), so that a weight becomes the chance that its match is
    a right one, each for itself. Places are given: this loss teaches weights alone.
    """
    distance_m = matches.errors_m(truth).detach()
    right = torch.exp(-0.5 * (distance_m / scale_m) ** 2)
    weights = matches.weights.clamp(_SMALLEST_WEIGHT, 1 - _SMALLEST_DOUBT)
    return -(right * weights.log() + (1 - right) * torch.log1p(-weights)).mean(1)


def pose_errors(estimate: Motion, truth: Motion) -> tuple[Tensor, Tensor]:
    """Return the errors of the translation (B,) [m] and of the rotation (B,) [rad], 0 or more."""
    difference = estimate.yaw_rad - truth.yaw_rad
    turn = torch.atan2(difference.sin(), difference.cos()).abs()
    return torch.linalg.vector_norm(estimate.translation_m - truth.translation_m, dim=-1), turn
