"""Whether an echo over several surfaces shows where none of them is.

A radar shows an echo at half the length of its path and where the pattern of its beam is largest, between the
directions in which the path leaves and returns. That of a car behind a mirroring wall is empty; that of a
corner between wall and ground is the corner, although its path met two surfaces.
"""

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from echoscape.sim.sensor.antenna import Antenna
from echoscape.sim.sensor.sensor import Sensor

RANGE_CELLS = 2.0
"""Resolution cells of range within which an echo lies at a surface: half the main lobe of a Hann window."""
BEAM_WIDTHS = 1.0
"""Two-way beam widths of azimuth within which it does."""


@dataclass(frozen=True, kw_only=True)
class Tolerance:
    """How far from a surface an echo may lie and still show it.

    Attributes:
        range_m: Largest difference of range [m].
        azimuth_rad: Largest difference of azimuth [rad].
    """

    range_m: float
    azimuth_rad: float


def tolerance(sensor: Sensor, antenna: Antenna) -> Tolerance:
    """Return the tolerance of a sensor: RANGE_CELLS resolution cells and BEAM_WIDTHS beam widths.

    Args:
        sensor: The radar.
        antenna: Its patterns, of which the two-way azimuth pattern has its width at -3 dB.

    Returns:
        The tolerance.
    """
    pattern, grid = antenna.azimuth_two_way, antenna.azimuth_grid_rad
    width = np.count_nonzero(pattern >= pattern.max() / 2) * (grid[1] - grid[0])
    return Tolerance(range_m=RANGE_CELLS * sensor.resolution_m, azimuth_rad=BEAM_WIDTHS * float(width))


def displaced(
    out: NDArray[np.float64],
    back: NDArray[np.float64],
    surfaces: Sequence[NDArray[np.float64]],
    allowed: Tolerance,
) -> NDArray[np.bool_]:
    """Return which echoes lie at none of the surfaces that their paths met.

    All points are relative to the antenna at the time of the echo. The Doppler shift of range is no
    displacement; nor is height, which a polar scan does not show.

    Args:
        out: Image of the last point of each path along its first leg, unfolded (3, N) [m].
        back: The same along its last leg (3, N) [m].
        surfaces: Points where the paths met their first surface, their second and so on, each (3, N) [m].
        allowed: How far from a surface an echo may lie and still show it.

    Returns:
        Whether no surface lies within the tolerance in both range and azimuth (N,).
    """
    out_m, back_m = _length(out), _length(back)
    range_m, shown = (out_m + back_m) / 2, out[:2] / out_m + back[:2] / back_m
    # Angles are compared by their cosines: products and roots are the same on all processors.
    least = _length(shown) * math.cos(allowed.azimuth_rad)
    at_surface = np.zeros(out.shape[1], np.bool_)
    for point in surfaces:
        in_range = np.abs(range_m - _length(point)) <= allowed.range_m
        along = shown[0] * point[0] + shown[1] * point[1]
        at_surface |= in_range & (along >= least * _length(point[:2]))
    return ~at_surface


def _length(vectors: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return the lengths (N,) of vectors (2 or 3, N), summed in order."""
    return np.sqrt(sum(np.square(each) for each in vectors))
