"""Motion as a trajectory: a pose and a velocity at any time, smooth between knots.

Cubic Hermite interpolation of position and yaw makes the velocity continuous and exactly the derivative of
the position; the phase of an echo depends on position to a fraction of a wavelength.
"""

from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import ArrayLike, NDArray
from scipy.interpolate import CubicHermiteSpline

from echoscape.scenes.core.attitude import Attitude


@dataclass(frozen=True, kw_only=True)
class Trajectory:
    """Knots of a motion. Before the first and after the last knot the object stands still.

    Attributes:
        time_s: Increasing times (K,) float64 [s].
        state: x, y, z [m] and unwrapped yaw [rad], counter-clockwise from world x, (K, 4) float64.
        rate: Time derivative of `state` (K, 4) float64.
        attitude: Pitch and roll of the body; None stays level.
    """

    time_s: NDArray[np.float64]
    state: NDArray[np.float64]
    rate: NDArray[np.float64]
    attitude: Attitude | None = None

    def __post_init__(self) -> None:
        """Check shapes, times and values.

        Raises:
            ValueError: The knots do not define a motion; the message names the field.
        """
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
        """Interpolate the pose.

        Args:
            time_s: Times (...) [s].

        Returns:
            x, y, z [m] and yaw [rad] (..., 4) float64.
        """
        return self._spline(np.clip(time_s, self.time_s[0], self.time_s[-1]))

    def velocity(self, time_s: ArrayLike) -> NDArray[np.float64]:
        """Interpolate the velocity.

        Args:
            time_s: Times (...) [s].

        Returns:
            vx, vy, vz [m/s] and yaw rate [rad/s] in the world frame (..., 4) float64; 0 outside the time
            span.
        """
        time_s = np.asarray(time_s)
        inside = (time_s >= self.time_s[0]) & (time_s <= self.time_s[-1])
        rate = self._spline(np.clip(time_s, self.time_s[0], self.time_s[-1]), nu=1)
        return np.where(inside[..., None], rate, 0.0)

    def tilt(self, time_s: ArrayLike) -> NDArray[np.float64]:
        """Interpolate the attitude.

        Args:
            time_s: Times (...) [s].

        Returns:
            Pitch, nose up, and roll, right side down (..., 2) [rad]; 0 for a body that stays level.
        """
        if self.attitude is None:
            return np.zeros((*np.shape(time_s), 2))
        return self.attitude.angles(time_s)

    def tilt_rate(self, time_s: ArrayLike) -> NDArray[np.float64]:
        """Interpolate the rates of the attitude.

        Args:
            time_s: Times (...) [s].

        Returns:
            Time derivatives of pitch and roll (..., 2) [rad/s].
        """
        if self.attitude is None:
            return np.zeros((*np.shape(time_s), 2))
        return self.attitude.rates(time_s)
