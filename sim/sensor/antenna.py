"""The antenna's gain towards a direction, and the two-way patterns that rays are drawn from.

A pattern is separable: G(az, el) = G0 g_az(az) g_el(el). The beam rotates during a sweep, so the effective
two-way azimuth pattern is the antenna's averaged over that rotation (in amplitude, as the sweep integrates).
"""

import math
from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from echoscape.sim.numerics.angles import principal_angle
from echoscape.sim.sensor.antenna_pattern import azimuth_pattern, elevation_pattern
from echoscape.sim.sensor.sensor import Sensor

AZIMUTH_STEPS = 8192
ELEVATION_STEPS = 4096


@dataclass(frozen=True)
class Antenna:
    """Tables of the two-way azimuth and one-way elevation power patterns of a sensor (peak about 1).

    Attributes:
        sensor: The radar.
    """

    sensor: Sensor

    @property
    def peak_gain(self) -> float:
        """One-way peak power gain G0."""
        return 10 ** (self.sensor.antenna_gain_db / 10)

    @property
    def rotation_in_sweep_rad(self) -> float:
        """Rotation of the beam while it samples one sweep [rad]."""
        return 2 * math.pi * self.sensor.rotation_hz * self.sensor.sweep_s

    @cached_property
    def azimuth_grid_rad(self) -> NDArray[np.float64]:
        """Offsets (AZIMUTH_STEPS + 1,) from -pi to pi [rad]."""
        return np.linspace(-math.pi, math.pi, AZIMUTH_STEPS + 1)

    @cached_property
    def azimuth_two_way(self) -> NDArray[np.float64]:
        """Two-way azimuth power pattern on `azimuth_grid_rad`, averaged over the rotation within a sweep."""
        rotation = (np.arange(32) + 0.5) / 32 - 0.5
        offsets = self.azimuth_grid_rad[:, None] + rotation * self.rotation_in_sweep_rad
        at_rest = azimuth_pattern(self.sensor.azimuth_pattern_db, offsets)
        return np.sqrt(at_rest).mean(axis=1) ** 2

    @cached_property
    def elevation_grid_rad(self) -> NDArray[np.float64]:
        """Elevations (ELEVATION_STEPS + 1,) from -pi/2 to pi/2 [rad] above the beam's middle."""
        return np.linspace(-math.pi / 2, math.pi / 2, ELEVATION_STEPS + 1)

    @cached_property
    def elevation_one_way(self) -> NDArray[np.float64]:
        """One-way elevation power pattern on `elevation_grid_rad`."""
        return elevation_pattern(self.sensor.elevation_pattern_db, self.elevation_grid_rad)

    def two_way_gain(self, azimuth_rad: NDArray, elevation_rad: NDArray) -> NDArray[np.float64]:
        """Compute the two-way gain G0^2 g_az^2 g_el^2 towards directions.

        Args:
            azimuth_rad: Azimuths from the beam's middle, of any shape [rad].
            elevation_rad: Elevations from the beam's middle, of the same shape [rad].

        Returns:
            Gains of the same shape.
        """
        two_way = np.interp(principal_angle(azimuth_rad), self.azimuth_grid_rad, self.azimuth_two_way)
        one_way = np.interp(elevation_rad, self.elevation_grid_rad, self.elevation_one_way)
        return self.peak_gain**2 * two_way * one_way**2

    @cached_property
    def two_way_energy_sr(self) -> float:
        """Integral of (G / G0)^2 over the sphere [sr]."""
        azimuth = np.trapezoid(self.azimuth_two_way, self.azimuth_grid_rad)
        weight = self.elevation_one_way**2 * np.cos(self.elevation_grid_rad)
        return float(azimuth * np.trapezoid(weight, self.elevation_grid_rad))
