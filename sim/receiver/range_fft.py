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
"""Rows that are processed together, so that what is being worked on stays in the processor's cache."""


def row_blocks(rows: int) -> Iterator[slice]:
    """Yield the slices in which the rows of a scan are processed."""
    for start in range(0, rows, _BLOCK):
        yield slice(start, min(start + _BLOCK, rows))


def range_spectrum(beat: BeatSignal, sensor: Sensor) -> NDArray[np.complex64]:
    """Return the windowed, zero-padded FFT (rows, bins) complex64 [sqrt(W)] of a beat signal.

    An echo of P watts peaks with sqrt(P / 2) sum(w) at its bin. Phases count from the first sample: times
    exp(2 pi j k (samples / 2) / fft_size) in bin k they count from the sweep's middle, where an echo's is its
    own, -4 pi r / lambda and what the reflection adds.

    Raises:
        ValueError: the signal has another number of samples than the sensor's sweeps.
    """
    _check(beat, sensor)
    found = np.empty((len(beat), sensor.bins), np.complex64)
    for rows in row_blocks(len(beat)):
        found[rows] = spectrum(beat.select(rows).amplitude(), sensor)
    return found


def codes_of_beat(beat: BeatSignal, sensor: Sensor) -> NDArray[np.uint8]:
    """Return the codes (rows, bins) uint8 that a sensor writes for a beat signal.

    The beat signal of a scan and the sensor that took it give the scan's own codes, byte for byte. A sensor
    with another window or gain by range gives what it would have written.

    Raises:
        ValueError: the signal has another number of samples than the sensor's sweeps.
    """
    _check(beat, sensor)
    found = np.empty((len(beat), sensor.bins), np.uint8)
    for rows in row_blocks(len(beat)):
        found[rows] = codes(written_power(spectrum(beat.select(rows).amplitude(), sensor), sensor))
    return found


def written_power(
    values: NDArray[np.complex64], sensor: Sensor, *, step: int = 1, out: NDArray[np.float32] | None = None
) -> NDArray[np.float32]:
    """Return the power (rows, bins / step) float32 that the quantiser takes for spectra.

    They hold every `step`-th bin. `out` takes the result where given.
    """
    power = np.square(values.real) + np.square(values.imag)
    return np.multiply(power, _written_gain(sensor)[::step], out=out)


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
