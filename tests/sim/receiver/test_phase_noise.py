"""Phase noise has its density, and decorrelates with the delay of each echo."""

import math
from dataclasses import replace

import numpy as np
import pytest
from scipy import signal as sig

from echoscape.sim.echoes import point_echoes
from echoscape.sim.receiver.if_signal import echo_grid, grid_place, sample_times
from echoscape.sim.receiver.phase_noise import modulated, modulation, phase_noise
from echoscape.sim.sensor.cts350x import CTS350X

FLAT = replace(CTS350X, range_gain_db=((0.0, 0.0), (163.0, 0.0)), sweep_ripple_db=())
SMALL = replace(FLAT, azimuths=8)


def test_phase_noise_filter_is_the_sum_over_echoes_with_their_own_delays() -> None:
    rng = np.random.default_rng(2)
    ranges, sensor = np.array([7.0, 41.3, 80.2]), replace(SMALL, azimuths=1)
    echoes = point_echoes(
        azimuth=np.zeros(3), range_m=ranges, amplitude=np.array([1.0, 0.5j, -0.3]), azimuths=1
    )
    # Strong, so that small-angle shortcuts would show; slow, so that no sideband passes half the rate.
    slow = np.fft.rfft(10 * phase_noise(sensor, azimuths=1, count=2048, rng=rng))
    slow[:, 300:] = 0
    phase = np.fft.irfft(slow).astype(np.float32)
    found = modulated(echo_grid(echoes, sensor), sensor, modulation(phase, sensor))[0].real
    frequency = np.fft.fftfreq(2048, 1 / sensor.sample_hz)
    inside = slice(1024 - sensor.samples // 2, 1024 + sensor.samples // 2)
    expected = np.zeros(sensor.samples)
    for place, amplitude in zip(grid_place(ranges, sensor), echoes.amplitude, strict=True):
        tau = place / sensor.fft_size * sensor.sample_hz / sensor.slope_hz_s
        late = np.fft.ifft(np.fft.fft(phase[0]) * np.exp(-2j * math.pi * frequency * tau)).real
        turned = (
            2j * math.pi * place * sample_times(sensor) / sensor.fft_size + 1j * (phase[0] - late)[inside]
        )
        expected += math.sqrt(2) * (complex(amplitude) * np.exp(turned)).real
    middle = slice(60, -60)
    assert np.abs(found - expected)[middle].max() < 0.015 * np.abs(expected).max()


def test_phase_noise_has_its_density() -> None:
    phase = phase_noise(CTS350X, azimuths=400, count=2048, rng=np.random.default_rng(4))
    frequency, density = sig.welch(phase, CTS350X.sample_hz, nperseg=2048, axis=1)
    level = 10 * np.log10(density.mean(axis=0) / 2)  # one-sided density is twice the single-sideband level
    assert level[np.searchsorted(frequency, 60e3)] == pytest.approx(
        CTS350X.phase_noise_dbc_hz - 0.17, abs=0.6
    )
    assert level[np.searchsorted(frequency, 1.5e6)] == pytest.approx(
        CTS350X.phase_noise_dbc_hz - 14.15, abs=0.6
    )
