"""Gaussian smoothing, with a kernel that is the same on every processor."""

import numpy as np
from numpy.typing import NDArray
from scipy.ndimage import correlate1d

from echoscape.scenes.core import portable_math


def gaussian_filter1d(
    values: NDArray[np.float64], sigma: float, *, axis: int = -1, mode: str = "reflect", truncate: float = 4.0
) -> NDArray[np.float64]:
    """Smooth along one axis, as SciPy's function of this name does.

    Args:
        values: Values of any shape.
        sigma: Standard deviation of the kernel [samples].
        axis: The axis.
        mode: How values go on beyond the ends, as in SciPy.
        truncate: Half width of the kernel in standard deviations.

    Returns:
        The smoothed values.
    """
    radius = int(truncate * float(sigma) + 0.5)
    kernel = portable_math.exp(-0.5 / (sigma * sigma) * np.square(np.arange(-radius, radius + 1)))
    return correlate1d(values, kernel / kernel.sum(), axis=axis, mode=mode)
