"""Phase noise of the synthesiser, correlated between transmitted and received wave by the echo's delay.

A beat tone carries exp(j (phi(t) - phi(t - tau))): near echoes cancel it, S_beat = S 4 sin^2(pi f tau)
(Budge & Burt, IEEE RADAR 1993). Delay and beat frequency belong together, tau = f / slope, so delaying every
tone by its own tau is the all-pass filter D = exp(-j pi f^2 / slope) of residual video phase. A tone f that
is multiplied by a modulation of frequency v must get exp(-j 2 pi f v / slope) = D(f + v) / (D(f) D(v)): take
D out of the tones and of the modulation exp(-j phi), multiply, apply D, and multiply by exp(+j phi). That is
exact for any strength of noise, but for sidebands that fall beyond half the sampling rate, with no loop over
echoes.
"""

from functools import lru_cache

import numpy as np
from numpy.typing import NDArray
from scipy.fft import rfftfreq

from echoscape.sim.sensor import Sensor
from echoscape.sim.transforms import fft, ifft, irfft, rfft
from echoscape.sim.waveform import analytic_beat, sweep_ripple


def phase_noise(sensor: Sensor, *, rows: int, count: int, rng: np.random.Generator) -> NDArray[np.float32]:
    """Draw the synthesiser's phase (rows, count) float32 [rad] at the converter's rate.

    Its one-sided density is twice the single-sideband level L0 / (1 + (f / corner)^2) [rad^2/Hz].
    """
    white = rng.standard_normal((rows, count), dtype=np.float32)
    return irfft(rfft(white) * _shape(sensor, count), count)


@lru_cache(maxsize=8)
def _shape(sensor: Sensor, count: int) -> NDArray[np.float32]:
    """Return the amplitude (count / 2 + 1,) that gives white noise of variance 1 the phase's density."""
    frequency = rfftfreq(count, 1 / sensor.sample_hz)
    level = 10 ** (sensor.phase_noise_dbc_hz / 10) / (1 + (frequency / sensor.phase_noise_corner_hz) ** 2)
    # White noise of variance 1 has the one-sided density 2 / fs.
    shape = np.sqrt(level * sensor.sample_hz)
    shape[0] = 0.0  # a constant phase is no noise
    return shape.astype(np.float32)


def _count(sensor: Sensor) -> int:
    """Return how many samples hold a sweep with room at its ends for the delays of the farthest echoes."""
    return 1 << int(np.ceil(np.log2(sensor.samples * 1.05)))


@lru_cache(maxsize=8)
def _delay(sensor: Sensor, step_hz: float, count: int) -> NDArray[np.complex64]:
    """Return the filter (count,) that delays tones of beat frequency f = 0, step, ... by f / slope each.

    Frequencies beyond the middle of a full transform are the negative ones.
    """
    frequency_hz = np.arange(count) * step_hz
    nyquist_hz = sensor.sample_hz / 2
    frequency_hz = (frequency_hz + nyquist_hz) % sensor.sample_hz - nyquist_hz
    return np.exp(-1j * np.pi * frequency_hz**2 / sensor.slope_hz_s).astype(np.complex64)


def noisy_beat(
    grid: NDArray[np.complex64], sensor: Sensor, *, rng: np.random.Generator, level: float = 1.0
) -> NDArray[np.float32]:
    """Return the beat signal (rows, samples) float32 [sqrt(W)] of a grid of echoes, phase noise included.

    `level`: amplitude of the phase over the sensor's own.
    """
    phase = phase_noise(sensor, rows=len(grid), count=_count(sensor), rng=rng)
    return with_phase(grid, sensor, phase if level == 1 else phase * np.float32(level))


def with_phase(
    grid: NDArray[np.complex64], sensor: Sensor, phase: NDArray[np.float32]
) -> NDArray[np.float32]:
    """Return the beat signal (rows, samples) of a grid under the synthesiser's phase (rows, count) [rad]."""
    count, size = phase.shape[1], sensor.fft_size
    step_hz = sensor.sample_hz / size
    early = grid * _delay(sensor, step_hz, grid.shape[1]).conj()
    carrier = np.empty(phase.shape, np.complex64)
    carrier.real, carrier.imag = np.cos(phase), np.sin(phase)
    delay = _delay(sensor, step_hz * (size // count), count)
    modulation = fft(carrier.conj(), overwrite=True)
    modulation *= delay.conj()
    received = analytic_beat(early, sensor, count=count)
    received *= ifft(modulation, overwrite=True)
    tones = fft(received, overwrite=True)
    tones *= delay
    full = ifft(tones, overwrite=True)
    first = count // 2 - sensor.samples // 2
    inside = slice(first, first + sensor.samples)
    tone, turn = full[:, inside], carrier[:, inside]
    mixed = np.asarray(tone.real * turn.real - tone.imag * turn.imag, np.float32)
    return mixed * sweep_ripple(sensor).astype(np.float32)
