"""What artefacts make of traced echoes before the receiver: one trace serves any strengths.

Speckle is the interference of echoes. What of it is switched off adds up by power instead: on a grid of
amplitudes in phase, found step by step, whose range profile is the root of the expected power.
"""

import math
from dataclasses import replace
from functools import lru_cache

import numpy as np
from numpy.typing import NDArray

from echoscape.sim.echoes import Echoes
from echoscape.sim.effects.rain import rain_gain
from echoscape.sim.numerics.decibels import power_ratio
from echoscape.sim.receiver.if_signal import beat, echo_grid, grid_place, spectrum, sweep_ripple
from echoscape.sim.receiver.range_fft import row_blocks
from echoscape.sim.sensor.link_budget import window
from echoscape.sim.sensor.sensor import Sensor
from echoscape.sim.settings.artefacts import Artefacts, Strengths

_ROUNDS = 2
"""Steps of the even grid towards the root of the expected power."""
_MOST_CHANGE = 4.0
"""Factor by which a step changes an amplitude at most: a profile may have zeros, which no factor fills."""


def changed(echoes: Echoes, artefacts: Artefacts, sensor: Sensor) -> Echoes:
    """Return the echoes with ghosts, sidelobes, Doppler shift and rain as strong as `artefacts` says.

    What stands on the vehicle takes its share from the rows behind it.
    """
    strengths = artefacts.strengths(sensor)
    if strengths.doppler != sensor.doppler_beta_s:
        more = strengths.doppler / sensor.doppler_beta_s - 1
        shift_s = sensor.doppler_shift_s[echoes.azimuth] * more
        echoes = replace(echoes, range_m=echoes.range_m + echoes.closing_mps * shift_s)
    gain = _power_gain(echoes, strengths)
    if gain is not None:
        echoes = echoes.select(gain > 0).scaled(gain[gain > 0])
    if sensor.row_loss_db.any():
        echoes = echoes.scaled(power_ratio(-sensor.row_loss_db)[echoes.azimuth])
    if strengths.rain:
        echoes = echoes.scaled(rain_gain(echoes.range_m, strengths.rain, sensor) ** 2)
    return echoes


def _power_gain(echoes: Echoes, strengths: Strengths) -> NDArray[np.float64] | None:
    """Return what becomes of each echo's power (E,); None where nothing changes."""
    if strengths.ghosts == strengths.sidelobes == 1:
        return None
    ghosts = np.where(echoes.bounces > 1, strengths.ghosts, 1.0)
    return ghosts * np.where(echoes.sidelobe, strengths.sidelobes, 1.0)


def speckled_grid(echoes: Echoes, sensor: Sensor, *, speckle: float) -> NDArray[np.complex64]:
    """Return the grid of echoes (azimuths, fft_size / 2) with a share of their power interfering [sqrt(W)].

    Coherent targets have no speckle: their phases are theirs, and they interfere with what is even as two
    mirrors would.
    """
    if speckle == 1:
        return echo_grid(echoes, sensor)
    rough = ~echoes.returns.coherent[echoes.source]
    even = even_grid(echoes.select(rough), sensor) * np.float32(np.sqrt(1 - speckle))
    grid = echo_grid(echoes.select(~rough), sensor)
    grid += even
    if speckle > 0:
        grid += echo_grid(echoes.select(rough), sensor) * np.float32(np.sqrt(speckle))
    return grid


def even_grid(echoes: Echoes, sensor: Sensor) -> NDArray[np.float32]:
    """Return amplitudes in phase (azimuths, fft_size / 2) [sqrt(W)] whose profile has the expected power.

    The expected power of a bin is the sum of the echoes' mean powers P under the point spread, P * |psf|^2.
    Starting from the root of P, the grid g is multiplied by sqrt(P * |psf|^2) / |g * psf| until it fits.
    """
    bins = sensor.fft_size // 2
    place = np.clip(np.rint(grid_place(echoes.range_m, sensor)), 0, bins - 1).astype(np.int64)
    power = np.bincount(echoes.azimuth * np.int64(bins) + place, echoes.mean_power, sensor.azimuths * bins)
    power = power.astype(np.float64, copy=False).reshape(sensor.azimuths, bins)
    grid = np.sqrt(power).astype(np.float32)
    for rows in row_blocks(sensor.azimuths):
        wanted = _expected_amplitude(power[rows], sensor)
        for _ in range(_ROUNDS):
            found = np.abs(spectrum(beat(grid[rows].astype(np.complex64), sensor), sensor))
            change = np.divide(wanted, found, out=np.ones_like(wanted), where=found > 0)
            grid[rows, : sensor.bins] *= np.clip(change, 1 / _MOST_CHANGE, _MOST_CHANGE)
    return grid


def _expected_amplitude(power: NDArray[np.float64], sensor: Sensor) -> NDArray[np.float32]:
    """Return the root of the expected |FFT|^2 (rows, bins) of independent powers on the grid [W]."""
    expected = np.fft.irfft(np.fft.rfft(power, sensor.fft_size) * _spread_spectrum(sensor))
    return np.sqrt(np.maximum(expected[:, : sensor.bins], 0)).astype(np.float32)


@lru_cache(maxsize=8)
def _spread_spectrum(sensor: Sensor) -> NDArray[np.complex128]:
    """Return the transform (fft_size / 2 + 1,) of what an echo of 1 W makes of |FFT|^2 around its bin."""
    spread = np.fft.fft(window(sensor) * sweep_ripple(sensor), sensor.fft_size) / math.sqrt(2)
    return np.fft.rfft(np.abs(spread) ** 2)
