"""Decibels to ratios, with the same result on every processor.

NumPy's powers differ in their last bit between vector instruction sets; rounded to single precision they
agree, and so does everything computed from them.
"""

import numpy as np
from numpy.typing import ArrayLike, NDArray


def power_ratio(level_db: ArrayLike) -> NDArray[np.float64]:
    """Convert decibels to power ratios.

    Args:
        level_db: Levels of any shape [dB].

    Returns:
        10^(level / 10) of the same shape, float64 values rounded to single precision.
    """
    return np.asarray(10 ** (np.asarray(level_db, np.float64) / 10), np.float32).astype(np.float64)
