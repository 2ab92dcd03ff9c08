"""Translation between two scans by phase correlation of their images (Kuglin & Hines, 1975)."""

import numpy as np
from numpy.typing import NDArray

PIXEL_M = 0.4
SIZE = 320
FINEST_M = 3.0
"""Structures smaller than this are left out: beams are metres wide far away [m]."""


def translation_m(
    first: NDArray[np.uint8],
    second: NDArray[np.uint8],
    *,
    azimuth_rad: NDArray[np.float64],
    bin_m: float,
    most_m: float = 5.0,
) -> tuple[float, float]:
    """Estimate how far a radar has moved between two scans, without rotation.

    Args:
        first: Codes of the earlier scan (azimuths, bins) in half decibels.
        second: Codes of the later scan.
        azimuth_rad: Directions of the azimuths (azimuths,), clockwise from ahead [rad].
        bin_m: Size of a range bin [m].
        most_m: Longest motion [m].

    Returns:
        Motion forward and to the right [m], to a pixel of 0.4 m.
    """
    spectra = [np.fft.fft2(_image(codes, azimuth_rad, bin_m)) for codes in (first, second)]
    cross = spectra[0] * np.conj(spectra[1])
    waves = np.fft.fftfreq(SIZE, PIXEL_M)
    smooth = np.exp(-((FINEST_M * waves) ** 2))
    peak = np.fft.ifft2(np.outer(smooth, smooth) * cross / np.sqrt(np.abs(cross) + 1e-9)).real
    shifts = np.fft.fftfreq(SIZE, 1 / SIZE) * PIXEL_M
    peak[np.hypot(*np.meshgrid(shifts, shifts, indexing="ij")) > most_m] = -np.inf
    row, column = np.unravel_index(int(peak.argmax()), peak.shape)
    return -float(shifts[row]), float(shifts[column])


def _image(codes: NDArray[np.uint8], azimuth_rad: NDArray[np.float64], bin_m: float) -> NDArray[np.float64]:
    """Return the strong echoes from above, forward up, interpolated along the azimuth, faded at the edges."""
    axis = (np.arange(SIZE) + 0.5 - SIZE / 2) * PIXEL_M
    forward, right = np.meshgrid(-axis, axis, indexing="ij")
    range_m, bearing = np.hypot(forward, right), np.arctan2(right, forward)
    place = (bearing - azimuth_rad[0]) / (2 * np.pi) * len(azimuth_rad)
    row, share = np.floor(place).astype(int), place % 1
    column = np.minimum((range_m / bin_m).astype(int), codes.shape[1] - 1)
    strong = np.maximum(codes.astype(float) - 40, 0)
    before, after = (strong[(row + step) % len(azimuth_rad), column] for step in (0, 1))
    fade = np.outer(np.hanning(SIZE), np.hanning(SIZE)) * (range_m > 5)
    return fade * ((1 - share) * before + share * after)
