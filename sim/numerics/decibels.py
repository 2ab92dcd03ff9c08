"""Decibels to ratios, alike on every processor.

NumPy's powers differ in their last bit between vector instruction sets; rounded to single precision they
agree, and so does all that follows from them.
"""

import numpy as np
from numpy.typing import ArrayLike, NDArray


def power_ratio(level_db: ArrayLike) -> NDArray[np.float64]:
    """Return 10^(level / 10) as float64 values of single precision, of the shape of `level_db`."""
    return np.asarray(10 ** (np.asarray(level_db, np.float64) / 10), np.float32).astype(np.float64)
