"""SciPy's Fourier transforms along the last axis of matrices, in single precision, with exact types.

SciPy chooses an implementation at run time, so its declared return types are of no use to a type checker.
"""

from typing import cast

import numpy as np
from numpy.typing import NDArray
from scipy import fft as scipy_fft


def rfft(signal: NDArray[np.float32], size: int | None = None) -> NDArray[np.complex64]:
    """Transform real signals.

    Args:
        signal: Signals (N, samples).
        size: Length to which they are padded with zeros or cut, by default their own.

    Returns:
        Half spectra (N, size // 2 + 1).
    """
    return cast("NDArray[np.complex64]", scipy_fft.rfft(signal, size, axis=1))


def irfft(spectrum: NDArray[np.complex64], size: int) -> NDArray[np.float32]:
    """Transform half spectra back to real signals.

    Args:
        spectrum: Half spectra (N, bins), padded with zeros or cut.
        size: Length of the signals.

    Returns:
        Signals (N, size).
    """
    return cast("NDArray[np.float32]", scipy_fft.irfft(spectrum, size, axis=1))


def fft(signal: NDArray[np.complex64], *, overwrite: bool = False) -> NDArray[np.complex64]:
    """Transform complex signals.

    Args:
        signal: Signals (N, samples).
        overwrite: Whether `signal` may be used as working space.

    Returns:
        Spectra (N, samples).
    """
    return cast("NDArray[np.complex64]", scipy_fft.fft(signal, axis=1, overwrite_x=overwrite))


def ifft(
    spectrum: NDArray[np.complex64], size: int | None = None, *, overwrite: bool = False
) -> NDArray[np.complex64]:
    """Transform complex spectra back to signals.

    Args:
        spectrum: Spectra (N, bins).
        size: Length to which they are padded with zeros or cut, by default their own.
        overwrite: Whether `spectrum` may be used as working space.

    Returns:
        Signals (N, size).
    """
    return cast("NDArray[np.complex64]", scipy_fft.ifft(spectrum, size, axis=1, overwrite_x=overwrite))
