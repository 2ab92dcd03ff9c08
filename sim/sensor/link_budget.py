"""From watts at the antenna to the integer power that the sensor writes, and back.

An echo of power P is a beat tone of amplitude sqrt(2 P) in N real samples; after a window w and an FFT its
peak is P (sum w)^2 / 2, and white noise of variance s^2 has the mean s^2 sum w^2 (Harris, Proc. IEEE 66(1),
1978). The written power is scaled so that thermal noise has the sensor's stated mean.
"""

import math
from functools import lru_cache

import numpy as np
from numpy.typing import NDArray

from echoscape.sim.numerics.decibels import power_ratio
from echoscape.sim.sensor.sensor import Sensor

_WINDOWS = {
    "hann": (0.5, 0.5),
    "hamming": (0.54, 0.46),
    "blackman": (0.42, 0.5, 0.08),
    "boxcar": (1.0,),
}
"""Coefficients of the cosines of each window (Harris, Proc. IEEE 66(1), 1978, section V)."""


@lru_cache(maxsize=8)
def window(sensor: Sensor) -> NDArray[np.float64]:
    """Compute the window over a sweep, DFT-even: its peak lies at sample `samples` / 2.

    Args:
        sensor: The radar.

    Returns:
        The window (samples,).
    """
    phase = np.linspace(-np.pi, np.pi, sensor.samples + 1)[:-1]
    terms = [share * np.cos(order * phase) for order, share in enumerate(_WINDOWS[sensor.window])]
    return np.sum(terms, axis=0)


def written_units(sensor: Sensor) -> float:
    """Compute the written power of a unit of |FFT|^2, with which thermal noise has the mean `noise_units`.

    Args:
        sensor: The radar.

    Returns:
        Units of written power per watt of |FFT|^2 [1/W].
    """
    noise = sensor.thermal_noise_w * float(np.sum(window(sensor) ** 2))
    return sensor.noise_units / noise


def units_per_watt(sensor: Sensor) -> float:
    """Compute the written peak power of an echo of 1 W, before the gain by range.

    Args:
        sensor: The radar.

    Returns:
        Units of written power per watt [1/W].
    """
    return written_units(sensor) * float(window(sensor).sum()) ** 2 / 2


def link_w_m2(sensor: Sensor) -> float:
    """Compute the link constant Pt G0^2 lambda^2 / ((4 pi)^2 L).

    Args:
        sensor: The radar.

    Returns:
        Received power times squared range per unit of BRDF times solid angle [W m^2].
    """
    gain = 10 ** ((2 * sensor.antenna_gain_db - sensor.system_loss_db) / 10)
    return sensor.tx_power_w * gain * sensor.wavelength_m**2 / (4 * math.pi) ** 2


def full_scale_amplitude(sensor: Sensor) -> float:
    """Compute the beat amplitude at which the converter clips.

    Args:
        sensor: The radar.

    Returns:
        Amplitude [sqrt(W)].
    """
    power_w = 10 ** (sensor.full_scale_db / 10) / units_per_watt(sensor)
    return math.sqrt(2 * power_w)


def range_gain(sensor: Sensor, range_m: NDArray) -> NDArray[np.float64]:
    """Interpolate the receiver's gain by range.

    Args:
        sensor: The radar.
        range_m: Ranges of any shape [m].

    Returns:
        Power gains of the same shape.
    """
    knots, gain_db = np.array(sensor.range_gain_db).T
    return power_ratio(np.interp(range_m, knots, gain_db))
