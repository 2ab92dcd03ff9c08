"""From the sampled beat signal to a scan's codes: window, transform, power, gain by range, quantiser.

What the sensor's own processor does (Harris, Proc. IEEE 66(1), 1978, for windows). The receiver works with
the functions of this module, so that a kept beat signal gives the bytes of its scan.
"""

from collections.abc import Iterator
from functools import lru_cache

import numpy as np
from numpy.typing import NDArray

from echoscape.sim.datasets.beat_signal import BeatSignal
from echoscape.sim.receiver.if_signal import BIN_CENTRE, spectrum
from echoscape.sim.receiver.quantiser import codes
from echoscape.sim.sensor.link_budget import range_gain, written_units
from echoscape.sim.sensor.sensor import Sensor

_BLOCK = 25
"""Azimuths that are processed together, so that their data stay in the processor's cache."""


def azimuth_blocks(azimuths: int) -> Iterator[slice]:
    """Split a scan into the blocks in which it is processed.

    Args:
        azimuths: Number of azimuths.

    Yields:
        Slices of azimuths.
    """
    for start in range(0, azimuths, _BLOCK):
        yield slice(start, min(start + _BLOCK, azimuths))


def range_spectrum(beat: BeatSignal, sensor: Sensor) -> NDArray[np.complex64]:
    """Compute the windowed, zero-padded FFT of a beat signal.

    An echo of P watts peaks with sqrt(P / 2) sum(w) at its bin. Phases count from the first sample: times
    exp(2 pi j k (samples / 2) / fft_size) in bin k they count from the sweep's middle, where the phase of an
    echo is -4 pi r / lambda plus that of its reflections.

    Args:
        beat: The beat signal.
        sensor: The radar that took it, or one with another window.

    Returns:
        Spectra (azimuths, bins) complex64 [sqrt(W)].

    Raises:
        ValueError: The signal has another number of samples than the sensor's sweeps.
    """
    _check(beat, sensor)
    found = np.empty((len(beat), sensor.bins), np.complex64)
    for block in azimuth_blocks(len(beat)):
        found[block] = spectrum(beat.select(block).amplitude(), sensor)
    return found


def codes_of_beat(beat: BeatSignal, sensor: Sensor) -> NDArray[np.uint8]:
    """Compute the codes that a sensor writes for a beat signal.

    Args:
        beat: The beat signal.
        sensor: The radar that took it, which gives the scan's own codes, byte for byte; or one with another
            window or gain by range.

    Returns:
        Codes (azimuths, bins) uint8.

    Raises:
        ValueError: The signal has another number of samples than the sensor's sweeps.
    """
    _check(beat, sensor)
    found = np.empty((len(beat), sensor.bins), np.uint8)
    for block in azimuth_blocks(len(beat)):
        found[block] = codes(written_power(spectrum(beat.select(block).amplitude(), sensor), sensor))
    return found


def written_power(
    values: NDArray[np.complex64], sensor: Sensor, *, step: int = 1, out: NDArray[np.float32] | None = None
) -> NDArray[np.float32]:
    """Compute the power that the quantiser takes.

    Args:
        values: Spectra (azimuths, bins / step) [sqrt(W)], of every step-th bin.
        sensor: The radar, which gives scale and gain by range.
        step: Step between the bins of the spectra.
        out: Array for the result, of the same shape.

    Returns:
        Power (azimuths, bins / step) float32 [units of written power].
    """
    power = np.square(values.real)
    power += np.square(values.imag)
    return np.multiply(power, _written_gain(sensor)[::step], out=out)


def thermal_power(sensor: Sensor, *, kelvin: float) -> NDArray[np.float32]:
    """Compute the expected written power of thermal noise.

    Args:
        sensor: The radar; before the gain by range it writes noise of its own temperature as `noise_units`.
        kelvin: Noise temperature [K].

    Returns:
        Power (bins,) float32 [units of written power].
    """
    ranges = (np.arange(sensor.bins) + BIN_CENTRE) * sensor.bin_m
    level = sensor.noise_units * kelvin / sensor.noise_temperature_k
    return (level * range_gain(sensor, ranges)).astype(np.float32)


@lru_cache(maxsize=8)
def _written_gain(sensor: Sensor) -> NDArray[np.float32]:
    """Return the written power (bins,) of a unit of |FFT|^2."""
    ranges = (np.arange(sensor.bins) + BIN_CENTRE) * sensor.bin_m
    return (written_units(sensor) * range_gain(sensor, ranges)).astype(np.float32)


def _check(beat: BeatSignal, sensor: Sensor) -> None:
    if beat.samples.shape[1] != sensor.samples:
        raise ValueError(
            f"beat must have the {sensor.samples} samples of a sweep of {sensor.name}, "
            f"got {beat.samples.shape[1]}"
        )
