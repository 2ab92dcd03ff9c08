"""Headings of vectors in the plane."""

import numpy as np
from numpy.typing import NDArray

from echoscape.scenes.core import portable_math


def unwrapped_headings(vectors: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return the headings of successive vectors without jumps of a full turn.

    Args:
        vectors: Vectors (N, 2), none of them zero, of any length.

    Returns:
        Headings (N,) [rad], counter-clockwise from x, each within pi of the one before.
    """
    return np.unwrap(portable_math.arctan2(vectors[:, 1], vectors[:, 0]))
