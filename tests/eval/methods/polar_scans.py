"""Scans of drawn codes: receiver noise with compact echoes in known cells."""

import numpy as np
from numpy.typing import NDArray

from echoscape.sim.datasets.polar_scan import PolarScan

BIN_M = 0.05


def scan_of_codes(codes: NDArray[np.number]) -> PolarScan:
    """A scan with these codes (azimuths, bins), the first azimuth straight ahead."""
    azimuths = len(codes)
    return PolarScan(
        codes=codes.astype(np.uint8),
        timestamp_us=625 * np.arange(azimuths),
        encoder=np.rint(5600 / azimuths * np.arange(azimuths)).astype(np.uint16),
        valid=np.ones(azimuths, bool),
        bin_m=BIN_M,
    )


def receiver_noise(azimuths: int, bins: int, *, seed: int = 0) -> NDArray[np.float64]:
    """Codes of noise behind a square-law detector: exponential power, in half decibels about 40."""
    power = np.random.default_rng(seed).exponential(size=(azimuths, bins))
    return np.clip(np.rint(40 + 20 * np.log10(power + 1e-2)), 0, 255)


def with_echo(codes: NDArray[np.float64], azimuth: int, centre: int, *, height: float = 120) -> NDArray:
    """Codes with an echo of some nine bins and three azimuths added."""
    bins = np.arange(codes.shape[1])
    echo = height * np.exp(-0.5 * ((bins - centre) / 3) ** 2)
    added = codes.copy()
    for step, share in ((-1, 0.7), (0, 1.0), (1, 0.7)):
        row = (azimuth + step) % len(codes)
        added[row] = np.maximum(added[row], share * echo)
    return np.rint(added)
