"""From echoes to the sampled beat signal, and from that to its spectrum over range.

An echo of amplitude a [sqrt(W)] at range r is a beat tone sqrt(2) Re(a exp(j 2 pi f n / fs)), f = 2 B r / (c
T), with n counted from the sweep's middle. `beat_reference` sums the tones one by one; `beat` lays the echoes
on the grid of range bins with linear weights and transforms once, then divides the weights' own spectrum
(sinc^2) out, which is exact but for aliases below -50 dB.

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


def echo_grid(echoes: Echoes, sensor: Sensor, *, azimuths: int | None = None) -> NDArray[np.complex64]:
    """Sum echoes on the grid of range bins, with linear weights.

    Sums run in the order of the echoes, so the result does not depend on threads. Echoes nearer than half a
    bin or beyond the grid are clamped to its ends.

    Args:
        echoes: The echoes of a scan.
        sensor: The radar.
        azimuths: Number of azimuths, by default the sensor's.

    Returns:
        The grid (azimuths, fft_size / 2) complex64 [sqrt(W)].
    """
    bins = sensor.fft_size // 2
    place = np.clip(grid_place(echoes.range_m, sensor), 0, bins - 1.001)
    cell = place.astype(np.int32)
    azimuths = sensor.azimuths if azimuths is None else azimuths
    index = np.empty((len(echoes), 2), np.int32)
    np.add(echoes.azimuth.astype(np.int32, copy=False) * np.int32(bins), cell, out=index[:, 0])
    np.add(index[:, 0], 1, out=index[:, 1])
    weight = np.empty((len(echoes), 2), np.float32)
    np.subtract(place, cell, out=weight[:, 1], casting="same_kind")
    np.subtract(1, weight[:, 1], out=weight[:, 0])
    ends = np.arange(0, index.size + 1, 2, dtype=np.int32)
    # Every echo is a column with two weights: the product with the amplitudes adds them up in one pass.
    columns = csc_array((weight.ravel(), index.ravel(), ends), shape=(azimuths * bins, len(echoes)))
    return np.asarray(columns @ echoes.amplitude, np.complex64).reshape(azimuths, bins)


@lru_cache(maxsize=8)
def _weights_spectrum(sensor: Sensor, count: int) -> NDArray[np.float32]:
    """Return sqrt(2) over the spectrum (count,) of the grid's linear weights, sinc^2."""
    times = np.arange(count) - count // 2
    return (math.sqrt(2) / np.sinc(times / sensor.fft_size) ** 2).astype(np.float32)


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
        grid: Grid of echoes (azimuths, fft_size / 2) complex64 [sqrt(W)].
        sensor: The radar.

    Returns:
        The beat signal (azimuths, samples) float32 [sqrt(W)].
    """
    size, half = sensor.fft_size, sensor.samples // 2
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
        grid: Grid of echoes (azimuths, fft_size / 2) complex64 [sqrt(W)].
        sensor: The radar.
        count: Number of samples, even; they may reach beyond the sweep on both sides.

    Returns:
        Complex tones (azimuths, count) complex64 [sqrt(W)], whose real part is the beat signal.
    """
    half = count // 2
    signal = ifft(grid, sensor.fft_size)
    middle = np.concatenate([signal[:, -half:], signal[:, :half]], axis=1)
    return middle * (_weights_spectrum(sensor, count) * np.float32(sensor.fft_size))


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
