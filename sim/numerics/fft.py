"""SciPy's Fourier transforms of rows in single precision, with the types that they return.

SciPy picks an implementation at run time, so what it declares is of no use to a type checker.
"""

from typing import cast

import numpy as np
from numpy.typing import NDArray
from scipy import fft as scipy_fft


def rfft(signal: NDArray[np.float32], size: int | None = None) -> NDArray[np.complex64]:
    """Return the transform (rows, size // 2 + 1) of real rows, padded with zeros or cut to `size`."""
    return cast("NDArray[np.complex64]", scipy_fft.rfft(signal, size, axis=1))


def irfft(spectrum: NDArray[np.complex64], size: int) -> NDArray[np.float32]:
    """Return the real rows (rows, size) of a half spectrum."""
    return cast("NDArray[np.float32]", scipy_fft.irfft(spectrum, size, axis=1))


def fft(signal: NDArray[np.complex64], *, overwrite: bool = False) -> NDArray[np.complex64]:
    """Return the transform of complex rows; with `overwrite`, `signal` may be used as working space."""
    return cast("NDArray[np.complex64]", scipy_fft.fft(signal, axis=1, overwrite_x=overwrite))


def ifft(
    spectrum: NDArray[np.complex64], size: int | None = None, *, overwrite: bool = False
) -> NDArray[np.complex64]:
    """Return the inverse transform of complex rows, padded with zeros or cut to `size`."""
    return cast("NDArray[np.complex64]", scipy_fft.ifft(spectrum, size, axis=1, overwrite_x=overwrite))
