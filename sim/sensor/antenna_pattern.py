"""Antenna patterns from tables of measured levels, and the largest gain that a pattern allows.

Between its rows a table in dB is interpolated monotonically (Fritsch & Carlson, SIAM J. Numer. Anal. 17(2),
1980); the directivity is 4 pi over the pattern's integral (IEEE Std 145-2013).
"""

import math
from functools import lru_cache

import numpy as np
from numpy.typing import NDArray
from scipy.interpolate import PchipInterpolator

from echoscape.sim.numerics.angles import principal_angle
from echoscape.sim.numerics.decibels import power_ratio

_AZIMUTH_STEPS, _ELEVATION_STEPS = 32768, 4096


def azimuth_pattern(
    table: tuple[tuple[float, float], ...], offset_rad: NDArray[np.float64]
) -> NDArray[np.float64]:
    """Interpolate a symmetric azimuth pattern.

    Args:
        table: Rows of offset from 0 on [deg] and level [dB].
        offset_rad: Offsets of any shape and size [rad].

    Returns:
        Power pattern of the same shape.
    """
    offset_deg, gain_db = np.array(table).T
    curve = PchipInterpolator(np.append(-offset_deg[1], offset_deg), np.append(gain_db[1], gain_db))
    folded = np.abs(principal_angle(offset_rad))
    return power_ratio(curve(np.minimum(np.degrees(folded), offset_deg[-1])))


def elevation_pattern(
    table: tuple[tuple[float, float], ...], elevation_rad: NDArray[np.float64]
) -> NDArray[np.float64]:
    """Interpolate an elevation pattern.

    Args:
        table: Rows of elevation [deg] and level [dB], constant beyond its ends.
        elevation_rad: Elevations of any shape [rad].

    Returns:
        Power pattern of the same shape.
    """
    elevation_deg, gain_db = np.array(table).T
    curve = PchipInterpolator(elevation_deg, gain_db)
    return power_ratio(curve(np.clip(np.degrees(elevation_rad), elevation_deg[0], elevation_deg[-1])))


@lru_cache(maxsize=32)
def directivity_db(
    azimuth_two_way_db: tuple[tuple[float, float], ...], elevation_db: tuple[tuple[float, float], ...]
) -> float:
    """Compute the directivity 4 pi / (integral of g_az g_el dOmega) of a separable antenna.

    Args:
        azimuth_two_way_db: Two-way azimuth table, whose root is the pattern of the antenna.
        elevation_db: One-way elevation table.

    Returns:
        Directivity [dBi].
    """
    azimuth = np.linspace(-math.pi, math.pi, _AZIMUTH_STEPS + 1)
    elevation = np.linspace(-math.pi / 2, math.pi / 2, _ELEVATION_STEPS + 1)
    across = np.trapezoid(np.sqrt(azimuth_pattern(azimuth_two_way_db, azimuth)), azimuth)
    upright = np.trapezoid(elevation_pattern(elevation_db, elevation) * np.cos(elevation), elevation)
    return 10 * math.log10(4 * math.pi / float(across * upright))
