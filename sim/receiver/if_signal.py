"""From echoes to the sampled beat signal, and from that to its spectrum over range.

An echo of amplitude a [sqrt(W)] at range r is a beat tone sqrt(2) Re(a exp(j 2 pi f n / fs)), f = 2 B r / (c
T), with n counted from the sweep's middle. `beat_reference` sums the tones one by one; `beat` lays the echoes
on a grid of cells of two range bins with the weights of a cubic B-spline, transforms once, and divides the
weights' own spectrum (sinc^4) out. A sweep fills at most half of the period of the grid's transform; for the
CTS350-X aliases stay below -50 dB at its ends, where the window is 0, and -80 dB half-way to them.

Bin k of a spectrum is centred at (k + 1/2) bin_m, as the loaders of the real sensor's data take it: the delay
of the feed is calibrated so that a tone of frequency k fs / fft_size comes from there.
"""

import math
from functools import lru_cache

import numpy as np
from numpy.typing import NDArray
from scipy.sparse import csc_array

from echoscape.sim.echoes import Echoes
from echoscape.sim.numerics.fft import ifft, irfft, rfft
from echoscape.sim.sensor.link_budget import window
from echoscape.sim.sensor.sensor import Sensor

BIN_CENTRE = 0.5
"""Position in a bin at which an echo peaks."""
CELL_BINS = 2
"""Range bins of a cell of the grid of echoes, whose cell k is centred where bin k * CELL_BINS is."""


def sample_times(sensor: Sensor) -> NDArray[np.int64]:
    """List the times of a sweep's samples.

    Args:
        sensor: The radar.

    Returns:
        Times (samples,) from the sweep's middle, in sample steps.
    """
    return np.arange(sensor.samples) - sensor.samples // 2


def grid_place(range_m: NDArray, sensor: Sensor) -> NDArray[np.float64]:
    """Convert ranges to places on the grid of range bins.

    Args:
        range_m: Ranges of any shape [m].
        sensor: The radar.

    Returns:
        Places of the same shape [bins].
    """
    return np.asarray(range_m, np.float64) / sensor.bin_m - BIN_CENTRE


def grid_cells(sensor: Sensor) -> int:
    """Return the number of cells of a grid of echoes: all of the spectrum that real samples have.

    Args:
        sensor: The radar.

    Returns:
        fft_size / 4.
    """
    return sensor.fft_size // (2 * CELL_BINS)


def echo_grid(echoes: Echoes, sensor: Sensor, *, azimuths: int | None = None) -> NDArray[np.complex64]:
    """Sum echoes on the grid, each in four cells.

    Sums run in the order of the echoes, so the result does not depend on threads. Echoes nearer than two and
    a half bins or beyond the grid are clamped to its ends.

    Args:
        echoes: The echoes of a scan.
        sensor: The radar.
        azimuths: Number of azimuths, by default the sensor's.

    Returns:
        The grid (azimuths, fft_size / 4) complex64 [sqrt(W)].
    """
    cells, azimuths = grid_cells(sensor), sensor.azimuths if azimuths is None else azimuths
    place = np.clip(grid_place(echoes.range_m, sensor) * (1 / CELL_BINS), 1.0, cells - 2.001)
    cell = place.astype(np.int32)
    index = np.empty((len(echoes), 4), np.int32)
    first = echoes.azimuth.astype(np.int32, copy=False) * np.int32(cells) + cell - 1
    for k in range(4):
        np.add(first, k, out=index[:, k])
    ends = np.arange(0, index.size + 1, 4, dtype=np.int32)
    weight = _spline_weights((place - cell).astype(np.float32))
    # Every echo is a column with four weights: the product with the amplitudes adds them up in one pass.
    columns = csc_array((weight.ravel(), index.ravel(), ends), shape=(azimuths * cells, len(echoes)))
    return np.asarray(columns @ echoes.amplitude, np.complex64).reshape(azimuths, cells)


def _spline_weights(after: NDArray[np.float32]) -> NDArray[np.float32]:
    """Return the cubic B-spline weights (E, 4) of places `after` the second of four cells (E,) [cells]."""
    before, sixth = np.float32(1) - after, np.float32(1 / 6)
    weight = np.empty((len(after), 4), np.float32)
    weight[:, 0] = before * before * before * sixth
    weight[:, 3] = after * after * after * sixth
    two_thirds = np.float32(2 / 3)
    weight[:, 1] = two_thirds - after * after * (np.float32(1) - np.float32(0.5) * after)
    weight[:, 2] = two_thirds - before * before * (np.float32(1) - np.float32(0.5) * before)
    return weight


@lru_cache(maxsize=8)
def _weights_spectrum(sensor: Sensor, count: int) -> NDArray[np.float32]:
    """Return sqrt(2) over the spectrum (count,) of the grid's weights, sinc^4."""
    times = np.arange(count) - count // 2
    return (math.sqrt(2) / np.sinc(times * CELL_BINS / sensor.fft_size) ** 4).astype(np.float32)


@lru_cache(maxsize=8)
def sweep_ripple(sensor: Sensor) -> NDArray[np.float64]:
    """Compute the amplitude over a sweep: about 1, with ripples that all peak in its middle.

    Its mean under the window is 1, so that an echo peaks as high as without. A ripple of p periods in a sweep
    and amplitude 2 m makes sidelobes of m, p resolution cells to each side (paired echoes; Klauder et al.,
    Bell System Technical Journal 39(4), 1960).

    Args:
        sensor: The radar.

    Returns:
        Amplitude (samples,).
    """
    position = sample_times(sensor) / sensor.samples
    amplitude = np.ones(sensor.samples)
    for periods, level_db in sensor.sweep_ripple_db:
        amplitude += 2 * 10 ** (level_db / 20) * np.cos(2 * np.pi * periods * position)
    weight = window(sensor)
    return amplitude * (weight.sum() / (weight @ amplitude))


def beat(grid: NDArray[np.complex64], sensor: Sensor) -> NDArray[np.float32]:
    """Compute the beat signal of a grid of echoes.

    Args:
        grid: Grid of echoes (azimuths, fft_size / 4) complex64 [sqrt(W)].
        sensor: The radar.

    Returns:
        The beat signal (azimuths, samples) float32 [sqrt(W)].
    """
    size, half = sensor.fft_size // CELL_BINS, sensor.samples // 2
    # irfft halves all but the first bin against the sum over positive frequencies only.
    signal = irfft(grid, size)
    signal += grid[:, :1].real / np.float32(size)
    middle = np.concatenate([signal[:, -half:], signal[:, :half]], axis=1)
    middle *= _weights_spectrum(sensor, sensor.samples) * np.float32(size / 2)
    middle *= sweep_ripple(sensor).astype(np.float32)
    return middle


def analytic_beat(grid: NDArray[np.complex64], sensor: Sensor, *, count: int) -> NDArray[np.complex64]:
    """Compute the analytic form of the beat signal, without the sweep's ripple.

    Args:
        grid: Grid of echoes (azimuths, fft_size / 4) complex64 [sqrt(W)].
        sensor: The radar.
        count: Number of samples, even; they may reach beyond the sweep on both sides.

    Returns:
        Complex tones (azimuths, count) complex64 [sqrt(W)], whose real part is the beat signal.
    """
    size, half = sensor.fft_size // CELL_BINS, count // 2
    signal = ifft(grid, size)
    middle = np.concatenate([signal[:, -half:], signal[:, :half]], axis=1)
    middle *= _weights_spectrum(sensor, count) * np.float32(size)
    return middle


def beat_reference(echoes: Echoes, sensor: Sensor) -> NDArray[np.float64]:
    """Compute the beat signal one tone at a time: slow, the reference for `beat`.

    Args:
        echoes: The echoes of a scan.
        sensor: The radar.

    Returns:
        The beat signal (azimuths, samples) float64 [sqrt(W)].
    """
    signal = np.zeros((sensor.azimuths, sensor.samples))
    cycles = sample_times(sensor) / sensor.fft_size
    places = grid_place(echoes.range_m, sensor)
    for azimuth, place, amplitude in zip(echoes.azimuth, places, echoes.amplitude, strict=True):
        signal[azimuth] += math.sqrt(2) * (complex(amplitude) * np.exp(2j * np.pi * place * cycles)).real
    return signal * sweep_ripple(sensor)


def spectrum(signal: NDArray[np.float32], sensor: Sensor, *, step: int = 1) -> NDArray[np.complex64]:
    """Compute the windowed, zero-padded FFT of beat signals.

    An echo of amplitude a peaks with |a| sum(w) / sqrt(2) at its bin. Phases count from the first sample.

    Args:
        signal: Beat signals (azimuths, samples) [sqrt(W)].
        sensor: The radar.
        step: A power of two: only every step-th bin is computed, for less work.

    Returns:
        Spectra (azimuths, bins / step) complex64 [sqrt(W)].
    """
    weighted = signal * window(sensor).astype(np.float32)
    return rfft(weighted, sensor.fft_size // step)[:, : -(-sensor.bins // step)]
