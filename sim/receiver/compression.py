"""Compression of the receiver by strong echoes, before the mixer: a ceiling without harmonics.

A solid-state amplifier follows Rapp's curve (C. Rapp, Proc. 2nd European Conf. Satellite Communications,
1991): an envelope a leaves it as a / (1 + (a / A)^2p)^(1 / 2p), never above the saturation amplitude A. At
radio frequency its harmonics lie at multiples of the carrier, outside the receiver's band, so that only the
envelope of all echoes together is compressed: one echo stays one tone, several gain intermodulation products
around them. A converter that clips the beat signal itself adds harmonics (`sim.receiver.receiver`).
"""

import math

import numpy as np
from numpy.typing import NDArray

from echoscape.sim.sensor.sensor import Sensor

ONE_DB = 10 ** (-1 / 20)
"""Factor on the amplitude at the 1-dB compression point."""
SMOOTHNESS = 1
"""Rapp's p. Calibrated: the strongest cells thin out towards the ceiling as in real scans, without piling up
below it, for which the values usual for solid-state amplifiers, 2 to 3, are too sharp."""


def one_db_amplitude(sensor: Sensor) -> float:
    """Compute the envelope that leaves the receiver 1 dB weaker than a small one would.

    Args:
        sensor: The radar, with its 1-dB compression point.

    Returns:
        Amplitude sqrt(2 P) of a tone of P watts [sqrt(W)].
    """
    return math.sqrt(2 * 10 ** (sensor.compression_dbm / 10 - 3))


def saturation_amplitude(sensor: Sensor) -> float:
    """Compute the envelope that leaves the receiver when the strongest comes in: Rapp's A.

    Args:
        sensor: The radar.

    Returns:
        Amplitude, 5.87 dB above that of the 1-dB point for p = 1 [sqrt(W)].
    """
    return one_db_amplitude(sensor) / (10 ** (SMOOTHNESS / 10) - 1) ** (1 / (2 * SMOOTHNESS))


def compression_gain(tones: NDArray[np.complex64], limit: float) -> NDArray[np.float32]:
    """Compute the factor on the amplitude of beat tones by which their common envelope is compressed.

    Args:
        tones: Analytic beat signals (azimuths, samples) [sqrt(W)].
        limit: Saturation amplitude [sqrt(W)].

    Returns:
        Factors (azimuths, samples) float32, above 0 and at most 1.
    """
    # With p = 1 by root and division alone, which are exact on every processor.
    gain = np.square(tones.real)
    gain += np.square(tones.imag)
    gain *= np.float32(1 / limit**2)
    gain += np.float32(1)
    np.sqrt(gain, out=gain)
    return np.divide(np.float32(1), gain, out=gain)
