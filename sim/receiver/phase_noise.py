"""Phase noise of the synthesiser, correlated between transmitted and received wave by the echo's delay.

A beat tone carries exp(j (phi(t) - phi(t - tau))): near echoes cancel it, S_beat = S 4 sin^2(pi f tau)
(Budge & Burt, IEEE RADAR 1993). Delay and beat frequency belong together, tau = f / slope, so delaying every
tone by its own tau is the all-pass filter D = exp(-j pi f^2 / slope) of residual video phase. A tone f that
is multiplied by a modulation of frequency v must get exp(-j 2 pi f v / slope) = D(f + v) / (D(f) D(v)): take
D out of the tones and of the modulation exp(-j phi), multiply, apply D, and multiply by exp(+j phi). That is
exact for any strength of noise, but for sidebands that fall beyond half the sampling rate, with no loop over
echoes.
"""

import math
from dataclasses import dataclass
from functools import lru_cache
from typing import cast

import numpy as np
from numpy.typing import NDArray
from scipy.fft import next_fast_len, rfftfreq

from echoscape.sim.numerics.fft import fft, ifft, irfft
from echoscape.sim.numerics.normal import standard_normal
from echoscape.sim.receiver.if_signal import CELL_BINS, analytic_beat
from echoscape.sim.sensor.sensor import Sensor


def phase_noise(
    sensor: Sensor, *, azimuths: int, count: int, rng: np.random.Generator
) -> NDArray[np.float32]:
    """Draw the synthesiser's phase at the converter's rate.

    Its one-sided density is twice the single-sideband level L0 / (1 + (f / corner)^2) [rad^2/Hz]. It is drawn
    in frequency, where its values are independent.

    Args:
        sensor: The radar.
        azimuths: Number of azimuths.
        count: Samples of each, even.
        rng: Draws the phase.

    Returns:
        Phase (azimuths, count) float32 [rad].
    """
    drawn = standard_normal((azimuths, count + 2), rng=rng).view(np.complex64)
    drawn *= _shape(sensor, count)
    return irfft(drawn, count)


@lru_cache(maxsize=8)
def _shape(sensor: Sensor, count: int) -> NDArray[np.float32]:
    """Return the standard deviation (count / 2 + 1,) of real and imaginary part of the phase's transform."""
    frequency = rfftfreq(count, 1 / sensor.sample_hz)
    level = 10 ** (sensor.phase_noise_dbc_hz / 10) / (1 + (frequency / sensor.phase_noise_corner_hz) ** 2)
    # White noise of variance 1 has the one-sided density 2 / fs, and `count` as mean square of its transform.
    shape = np.sqrt(level * sensor.sample_hz * count / 2)
    shape[0] = 0.0  # a constant phase is no noise
    shape[-1] *= math.sqrt(2)  # half the sampling rate has a real part only
    return shape.astype(np.float32)


def sample_count(sensor: Sensor) -> int:
    """Compute how many samples hold a sweep with room at its ends for the delays of the farthest echoes.

    Args:
        sensor: The radar.

    Returns:
        A multiple of 32 that is quick to transform, without prime factors above 5.
    """
    return 32 * cast("int", next_fast_len(math.ceil(sensor.samples * 1.05 / 32), real=True))


@lru_cache(maxsize=8)
def _delay(sensor: Sensor, step_hz: float, count: int) -> NDArray[np.complex64]:
    """Return the filter (count,) that delays tones of beat frequency f = 0, step, ... by f / slope each.

    Frequencies beyond the middle of a full transform are the negative ones.
    """
    frequency_hz = np.arange(count) * step_hz
    nyquist_hz = sensor.sample_hz / 2
    frequency_hz = (frequency_hz + nyquist_hz) % sensor.sample_hz - nyquist_hz
    return np.exp(-1j * np.pi * frequency_hz**2 / sensor.slope_hz_s).astype(np.complex64)


@dataclass(frozen=True)
class Modulation:
    """The effect of the synthesiser's phase phi on the beat tones of some azimuths.

    Attributes:
        turn: exp(j phi) within the sweep (azimuths, samples) complex64.
        late: exp(-j phi) with D taken out (azimuths, count) complex64.
    """

    turn: NDArray[np.complex64]
    late: NDArray[np.complex64]


def modulation(phase: NDArray[np.float32], sensor: Sensor) -> Modulation:
    """Compute the effect of a phase on beat tones.

    Args:
        phase: Phase (azimuths, count) [rad].
        sensor: The radar.

    Returns:
        The modulation.
    """
    count = phase.shape[1]
    carrier = np.empty(phase.shape, np.complex64)
    carrier.real, carrier.imag = np.cos(phase), np.sin(phase)
    tones = fft(carrier.conj(), overwrite=True)
    tones *= _wide_delay(sensor, count).conj()
    return Modulation(carrier[:, _inside(sensor, count)].copy(), ifft(tones, overwrite=True))


def modulated(grid: NDArray[np.complex64], sensor: Sensor, modulation: Modulation) -> NDArray[np.complex64]:
    """Compute the beat tones of a grid of echoes under phase noise, without the sweep's ripple.

    Args:
        grid: Grid of echoes (azimuths, fft_size / 4) complex64 [sqrt(W)].
        sensor: The radar.
        modulation: The effect of the phase.

    Returns:
        Complex tones (azimuths, samples) complex64 [sqrt(W)], whose real part is the beat signal.
    """
    count = modulation.late.shape[1]
    early = grid * _delay(sensor, CELL_BINS * sensor.sample_hz / sensor.fft_size, grid.shape[1]).conj()
    received = analytic_beat(early, sensor, count=count)
    received *= modulation.late
    tones = fft(received, overwrite=True)
    tones *= _wide_delay(sensor, count)
    return ifft(tones, overwrite=True)[:, _inside(sensor, count)] * modulation.turn


def _wide_delay(sensor: Sensor, count: int) -> NDArray[np.complex64]:
    """Return the delaying filter (count,) of tones that last `count` samples."""
    return _delay(sensor, sensor.sample_hz / count, count)


def _inside(sensor: Sensor, count: int) -> slice:
    """Return the slice of `count` samples that the sweep takes."""
    first = count // 2 - sensor.samples // 2
    return slice(first, first + sensor.samples)
