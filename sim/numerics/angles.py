"""Angles reduced to one turn."""

import math

import numpy as np
from numpy.typing import ArrayLike, NDArray


def principal_angle(angle_rad: ArrayLike) -> NDArray:
    """Reduce angles to [-pi, pi).

    Args:
        angle_rad: Angles of any shape and floating type [rad].

    Returns:
        The same directions in [-pi, pi), of the same shape and type [rad].
    """
    return np.remainder(np.asarray(angle_rad) + math.pi, 2 * math.pi) - math.pi
