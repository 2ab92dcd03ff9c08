"""Motion along a path: a pose and a velocity at any time, smooth between knots.

Cubic Hermite interpolation of position and yaw, so that velocity is continuous and is the exact derivative
of position: radar phase follows position to a fraction of a wavelength.
"""

from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import ArrayLike, NDArray
from scipy.interpolate import CubicHermiteSpline


@dataclass(frozen=True, kw_only=True)
class Trajectory:
    """Knots of a motion; outside its time span it stands still at its first or last pose.

    time_s (K,) increasing; state (K, 4): x, y, z [m] and unwrapped yaw [rad, counter-clockwise from world x];
    rate (K, 4): the time derivative of `state`.
    """

    time_s: NDArray[np.float64]
    state: NDArray[np.float64]
    rate: NDArray[np.float64]

    def __post_init__(self) -> None:
        """Refuse knots that do not make a motion."""
        knots = len(self.time_s)
        if self.state.shape != (knots, 4) or self.rate.shape != (knots, 4):
            raise ValueError(
                f"state and rate must be ({knots}, 4), got {self.state.shape} and {self.rate.shape}"
            )
        if knots < 2 or not np.all(np.diff(self.time_s) > 0):
            raise ValueError(f"time_s must hold two or more increasing values, got {knots}")
        if not (np.isfinite(self.state).all() and np.isfinite(self.rate).all()):
            raise ValueError("state and rate must be finite")

    @cached_property
    def _spline(self) -> CubicHermiteSpline:
        return CubicHermiteSpline(self.time_s, self.state, self.rate)

    def pose(self, time_s: ArrayLike) -> NDArray[np.float64]:
        """Return (..., 4) float64 x, y, z [m], yaw [rad] at `time_s` (...) [s]."""
        return self._spline(np.clip(time_s, self.time_s[0], self.time_s[-1]))

    def velocity(self, time_s: ArrayLike) -> NDArray[np.float64]:
        """Return (..., 4) float64 vx, vy, vz [m/s], yaw rate [rad/s] in the world at `time_s` (...) [s]."""
        time_s = np.asarray(time_s)
        inside = (time_s >= self.time_s[0]) & (time_s <= self.time_s[-1])
        rate = self._spline(np.clip(time_s, self.time_s[0], self.time_s[-1]), nu=1)
        return np.where(inside[..., None], rate, 0.0)
