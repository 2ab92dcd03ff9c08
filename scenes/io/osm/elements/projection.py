"""Transverse Mercator projection about the centre of an extract: x east and y north in metres.

Krueger's series to the fourth order in the third flattening, as in Karney, "Transverse Mercator with an
accuracy of a few nanometers", Journal of Geodesy 85 (2011), eqs. 7 to 11, 35 and 36, on the WGS84 ellipsoid
(NIMA TR8350.2), with scale 1 on the central meridian. The scale at a distance d east or west of it is
1 + d^2 / (2 R^2), 4e-8 at 2 km.
"""

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray

from echoscape.scenes.core import portable_math

_A_M = 6_378_137.0
_F = 1 / 298.257223563
_N = _F / (2 - _F)
_E = np.sqrt(_F * (2 - _F))
_RADIUS_M = _A_M / (1 + _N) * (1 + _N**2 / 4 + _N**4 / 64)
_ALPHA = (
    _N / 2 - 2 / 3 * _N**2 + 5 / 16 * _N**3 + 41 / 180 * _N**4,
    13 / 48 * _N**2 - 3 / 5 * _N**3 + 557 / 1440 * _N**4,
    61 / 240 * _N**3 - 103 / 140 * _N**4,
    49561 / 161280 * _N**4,
)
_BETA = (
    _N / 2 - 2 / 3 * _N**2 + 37 / 96 * _N**3 - 1 / 360 * _N**4,
    1 / 48 * _N**2 + 1 / 15 * _N**3 - 437 / 1440 * _N**4,
    17 / 480 * _N**3 - 37 / 840 * _N**4,
    4397 / 161280 * _N**4,
)
_NEWTON_STEPS = 6


@dataclass(frozen=True, kw_only=True)
class LocalProjection:
    """A plane about an origin.

    Attributes:
        origin_deg: Latitude and longitude of the origin, WGS84 [deg].
    """

    origin_deg: tuple[float, float]

    def to_plane(self, lat_deg: ArrayLike, lon_deg: ArrayLike) -> NDArray[np.float64]:
        """Project places.

        Args:
            lat_deg: Latitudes (...) [deg].
            lon_deg: Longitudes (...) [deg].

        Returns:
            x east and y north of the origin (..., 2) [m].
        """
        lat = np.deg2rad(np.asarray(lat_deg, np.float64))
        lon = np.deg2rad(np.asarray(lon_deg, np.float64) - self.origin_deg[1])
        plane = _forward(lat, lon)
        return plane - _forward(np.deg2rad(np.array(self.origin_deg[0])), np.array(0.0))

    def to_wgs84(self, places: ArrayLike) -> NDArray[np.float64]:
        """Return the latitudes and longitudes of places.

        Args:
            places: x and y (..., 2) [m].

        Returns:
            Latitude and longitude (..., 2) [deg].
        """
        plane = np.asarray(places, np.float64)
        plane = plane + _forward(np.deg2rad(np.array(self.origin_deg[0])), np.array(0.0))
        return np.rad2deg(_inverse(plane)) + np.array([0.0, self.origin_deg[1]])


def _conformal(tau: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return the tangent of the conformal latitude from that of the geographic one (Karney, eqs. 7 to 9)."""
    sigma = portable_math.sinh(_E * portable_math.arctanh(_E * tau / np.hypot(1, tau)))
    return tau * np.hypot(1, sigma) - sigma * np.hypot(1, tau)


def _forward(lat: NDArray[np.float64], lon: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return x and y (..., 2) from the equator and the central meridian [m]."""
    tau = _conformal(portable_math.tan(lat))
    xi = portable_math.arctan2(tau, np.cos(lon))
    eta = portable_math.arcsinh(np.sin(lon) / np.hypot(tau, np.cos(lon)))
    north, east = xi.copy(), eta.copy()
    for order, factor in enumerate(_ALPHA, 1):
        north = north + factor * np.sin(2 * order * xi) * portable_math.cosh(2 * order * eta)
        east = east + factor * np.cos(2 * order * xi) * portable_math.sinh(2 * order * eta)
    return _RADIUS_M * np.stack([east, north], axis=-1)


def _inverse(plane: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return latitude and longitude (..., 2) [rad] of x and y from the equator and the central meridian."""
    eta, xi = np.moveaxis(plane / _RADIUS_M, -1, 0)
    north, east = xi.copy(), eta.copy()
    for order, factor in enumerate(_BETA, 1):
        north = north - factor * np.sin(2 * order * xi) * portable_math.cosh(2 * order * eta)
        east = east - factor * np.cos(2 * order * xi) * portable_math.sinh(2 * order * eta)
    wanted = np.sin(north) / np.hypot(portable_math.sinh(east), np.cos(north))
    tau = wanted / (1 - _E**2)
    for _ in range(_NEWTON_STEPS):  # Karney, eqs. 19 to 21
        found = _conformal(tau)
        slope = (1 - _E**2) * np.hypot(1, tau) * np.hypot(1, found) / (1 + (1 - _E**2) * tau**2)
        tau = tau + (wanted - found) / slope
    return np.stack(
        [portable_math.arctan(tau), portable_math.arctan2(portable_math.sinh(east), np.cos(north))], axis=-1
    )
