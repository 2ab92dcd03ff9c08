"""Whether an echo over several surfaces shows where none of them is.

A radar shows an echo at half the length of its path and where the pattern of its beam is largest, between the
directions in which the path leaves and returns. That of a car behind a mirroring wall is empty; that of a
corner between wall and ground is the corner, although its path met two surfaces.
"""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from echoscape.sim.numerics.angles import principal_angle
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
    surfaces: NDArray[np.float64],
    allowed: Tolerance,
) -> NDArray[np.bool_]:
    """Return which echoes lie at none of the surfaces that their paths met.

    All points are relative to the antenna at the time of the echo. The Doppler shift of range is no
    displacement; nor is height, which a polar scan does not show.

    Args:
        out: Image of the last point of each path along its first leg, unfolded (N, 3) [m].
        back: The same along its last leg (N, 3) [m].
        surfaces: Points where the path met surfaces (N, D, 3) [m].
        allowed: How far from a surface an echo may lie and still show it.

    Returns:
        Whether no surface lies within the tolerance in both range and azimuth (N,).
    """
    out_m, back_m = np.linalg.norm(out, axis=1), np.linalg.norm(back, axis=1)
    shown = out / out_m[:, None] + back / back_m[:, None]
    beyond = (out_m + back_m)[:, None] / 2 - np.linalg.norm(surfaces, axis=2)  # (N, D)
    aside = _azimuth(shown)[:, None] - _azimuth(surfaces)  # (N, D)
    at_surface = (np.abs(beyond) <= allowed.range_m) & (np.abs(principal_angle(aside)) <= allowed.azimuth_rad)
    return ~at_surface.any(axis=1)


def _azimuth(points: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return the azimuth of points (..., 3), counter-clockwise from the x axis [rad]."""
    return np.arctan2(points[..., 1], points[..., 0])
