"""Training losses of matches, beside the paper's loss of the pose (`learn.model.keypoint_model.pose_loss`).

These are ours: true motions give the place of each keypoint in the other scan, which real logs rarely have at
that accuracy.
"""

import torch
from torch import Tensor

from echoscape.learn.geometry.matches import Matches
from echoscape.learn.geometry.procrustes import Motion, shares

_SMALLEST_WEIGHT = 1e-12
_SMALLEST_DOUBT = 1e-6
_LEAST_CARE = 0.1


def match_loss(matches: Matches, truth: Motion) -> Tensor:
    """Compute the weighted mean distance of matches from where the true motion puts their keypoints.

    The weights are constants here, so that this loss trains places only. (Trained by it, they would gather on
    the one best match, which does not determine the rotation.)

    Args:
        matches: B sets of N matches.
        truth: True motions.

    Returns:
        The loss (B,) [m].
    """
    distance_m = matches.errors_m(truth)
    return (shares(matches.weights.detach()) * distance_m).sum(1)


def likelihood_loss(matches: Matches) -> Tensor:
    """Compute the weighted mean negative log-likelihood of the keypoints' true places.

    This is the cross entropy of the matching softmax (InfoNCE, van den Oord et al. 2018, over all pixels).
    Its gradient on descriptors is large from the start, where an expected place, a mean over a whole image,
    hardly moves. The weights, plus a tenth so that no match is left out, are constants here.

    Args:
        matches: B sets of N matches with their surprisal.

    Returns:
        The loss (B,) [nat].

    Raises:
        ValueError: The matches were found without the true motion.
    """
    if matches.surprisal is None:
        raise ValueError("matches must hold their surprisal, which takes the true motion")
    return (shares(matches.weights.detach() + _LEAST_CARE) * matches.surprisal).sum(1)


def score_loss(matches: Matches, truth: Motion, *, scale_m: float) -> Tensor:
    """Compute the mean cross entropy between the weights of matches and their correctness.

    A match with an error e is correct to exp(-e^2 / (2 scale_m^2)), so that each weight becomes the
    probability that its match is correct. Places are constants here: this loss trains weights only.

    Args:
        matches: B sets of N matches.
        truth: True motions.
        scale_m: Standard deviation within which a match counts as correct [m].

    Returns:
        The loss (B,) [nat].
    """
    distance_m = matches.errors_m(truth).detach()
    correct = torch.exp(-0.5 * (distance_m / scale_m) ** 2)
    weights = matches.weights.clamp(_SMALLEST_WEIGHT, 1 - _SMALLEST_DOUBT)
    return -(correct * weights.log() + (1 - correct) * torch.log1p(-weights)).mean(1)


def pose_errors(estimate: Motion, truth: Motion) -> tuple[Tensor, Tensor]:
    """Compute the errors of estimated motions.

    Args:
        estimate: Estimated motions, B of them.
        truth: True motions.

    Returns:
        Errors of the translation (B,) [m] and of the rotation (B,) [rad], 0 or more.
    """
    difference = estimate.yaw_rad - truth.yaw_rad
    rotation_rad = torch.atan2(difference.sin(), difference.cos()).abs()
    return torch.linalg.vector_norm(estimate.translation_m - truth.translation_m, dim=-1), rotation_rad
