"""What training makes small: the error of the translation plus alpha times that of the rotation.

Source: Barnes & Posner 2020, equation 6: |t^ - t|_2 + alpha |R^ R^T - 1|_2 with alpha = 10.
"""

import torch
from torch import Tensor

from echoscape.learn.pose import Motion

ALPHA_M = 10.0
"""Weight of the rotation's error [m]."""


def pose_loss(estimate: Motion, truth: Motion, *, alpha_m: float = ALPHA_M) -> Tensor:
    """Return (B,) [m]: |t^ - t| + alpha |R^ R^T - 1|, both spectral norms.

    For plane rotations that differ by delta the second is 2 |sin(delta / 2)|: both columns of the matrix
    have that length and are at right angles. At an error of exactly 0 the gradient is 0.
    """
    shift = torch.linalg.vector_norm(estimate.translation_m - truth.translation_m, dim=-1)
    turn = estimate.rotation @ truth.rotation.transpose(1, 2) - torch.eye(2).to(estimate.rotation)
    return shift + alpha_m * torch.linalg.vector_norm(turn[..., 0], dim=-1)


def pose_errors(estimate: Motion, truth: Motion) -> tuple[Tensor, Tensor]:
    """Return the errors of the translation (B,) [m] and of the rotation (B,) [rad], 0 or more."""
    difference = estimate.yaw_rad - truth.yaw_rad
    turn = torch.atan2(difference.sin(), difference.cos()).abs()
    return torch.linalg.vector_norm(estimate.translation_m - truth.translation_m, dim=-1), turn
