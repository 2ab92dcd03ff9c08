"""Attitude of a car body: pitch and roll at any time, and the axes that they give the body.

Angles turn the vehicle frame (x forward, y right, z down) in the order yaw, pitch, roll, as in SAE J670:
pitch is positive with the nose up, roll positive with the right side down.
"""

from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import ArrayLike, NDArray
from scipy.interpolate import CubicHermiteSpline

from echoscape.scenes.core import portable_math

STEEPEST_RAD = 0.5
"""Largest pitch and roll of a car on its wheels [rad]."""


@dataclass(frozen=True, kw_only=True)
class Attitude:
    """Knots of pitch and roll. Before the first and after the last knot they keep their values.

    Attributes:
        time_s: Increasing times (K,) float64 [s].
        angle_rad: Pitch and roll (K, 2) float64 [rad].
        rate_rps: Time derivative of `angle_rad` (K, 2) float64 [rad/s].
    """

    time_s: NDArray[np.float64]
    angle_rad: NDArray[np.float64]
    rate_rps: NDArray[np.float64]

    def __post_init__(self) -> None:
        """Check shapes, times and values.

        Raises:
            ValueError: The knots do not define an attitude; the message names the field.
        """
        knots = len(self.time_s)
        if self.angle_rad.shape != (knots, 2) or self.rate_rps.shape != (knots, 2):
            raise ValueError(
                f"angle_rad and rate_rps must be ({knots}, 2), got {self.angle_rad.shape} and "
                f"{self.rate_rps.shape}"
            )
        if knots < 2 or not np.all(np.diff(self.time_s) > 0):
            raise ValueError(f"time_s must hold two or more increasing values, got {knots}")
        if not np.all(np.abs(self.angle_rad) <= STEEPEST_RAD):
            raise ValueError(f"angle_rad must be between -{STEEPEST_RAD} and {STEEPEST_RAD}")
        if not np.isfinite(self.rate_rps).all():
            raise ValueError("rate_rps must be finite")

    @cached_property
    def _spline(self) -> CubicHermiteSpline:
        return CubicHermiteSpline(self.time_s, self.angle_rad, self.rate_rps)

    def angles(self, time_s: ArrayLike) -> NDArray[np.float64]:
        """Interpolate pitch and roll.

        Args:
            time_s: Times (...) [s].

        Returns:
            Pitch, nose up, and roll, right side down (..., 2) [rad].
        """
        return self._spline(np.clip(time_s, self.time_s[0], self.time_s[-1]))

    def rates(self, time_s: ArrayLike) -> NDArray[np.float64]:
        """Interpolate the rates of pitch and roll.

        Args:
            time_s: Times (...) [s].

        Returns:
            Time derivatives (..., 2) [rad/s]; 0 outside the time span.
        """
        time_s = np.asarray(time_s)
        inside = (time_s >= self.time_s[0]) & (time_s <= self.time_s[-1])
        rate = self._spline(np.clip(time_s, self.time_s[0], self.time_s[-1]), nu=1)
        return np.where(inside[..., None], rate, 0.0)


def body_axes(yaw_rad: ArrayLike, angle_rad: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return the axes of the body in the world.

    Args:
        yaw_rad: Headings (...), counter-clockwise from world x [rad].
        angle_rad: Pitch, nose up, and roll, right side down (..., 2) [rad].

    Returns:
        Unit vectors forward, to the right and up (..., 3, 3), one a row.
    """
    sin_yaw, cos_yaw = np.sin(yaw_rad), np.cos(yaw_rad)
    (sin_pitch, sin_roll), (cos_pitch, cos_roll) = (
        np.moveaxis(part(angle_rad), -1, 0) for part in (np.sin, np.cos)
    )
    flat = np.zeros_like(sin_yaw)
    level_right = np.stack([sin_yaw, -cos_yaw, flat], axis=-1)
    pitched_up = np.stack([-cos_yaw * sin_pitch, -sin_yaw * sin_pitch, cos_pitch + flat], axis=-1)
    forward = np.stack([cos_yaw * cos_pitch, sin_yaw * cos_pitch, sin_pitch + flat], axis=-1)
    sin_roll, cos_roll = sin_roll[..., None], cos_roll[..., None]
    right = cos_roll * level_right - sin_roll * pitched_up
    up = cos_roll * pitched_up + sin_roll * level_right
    return np.stack([forward, right, up], axis=-2)


def bearing_and_elevation(
    axes: NDArray[np.float64], away: NDArray[np.float64]
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Return the direction of vectors in the frame of the body.

    Args:
        axes: Axes of the body (..., 3, 3) from `body_axes`.
        away: Vectors in the world (..., 3), not 0.

    Returns:
        Bearings, clockwise from straight ahead, and elevations above the plane of the body (...) [rad].
    """
    # Not a matrix product: those of BLAS round differently from processor to processor.
    forward, right, up = np.moveaxis((axes * away[..., None, :]).sum(axis=-1), -1, 0)
    return portable_math.arctan2(right, forward), portable_math.arctan2(up, np.hypot(forward, right))
