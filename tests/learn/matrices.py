"""Matrices for tests."""

import torch
from torch import Tensor

from echoscape.learn.geometry.procrustes import rotation_of_yaw


def covariance_of(first: float, second: float, angle: float) -> Tensor:
    """Return a 2 x 2 matrix with these eigenvalues, the first along `angle`."""
    axes = rotation_of_yaw(torch.tensor([angle], dtype=torch.float64))[0]
    return axes @ torch.diag(torch.tensor([first, second], dtype=torch.float64)) @ axes.T
