"""Artefacts that change traced echoes before the receiver, so that one trace serves any strengths.

Speckle is the interference of echoes. The share of power that is not to interfere adds up by power instead:
on a grid of amplitudes in phase, found by iteration, whose range profile is the root of the expected power.
"""

import math
from dataclasses import replace
from functools import lru_cache

import numpy as np
from numpy.typing import NDArray

from echoscape.sim.echoes import Echoes
from echoscape.sim.effects.rain import rain_gain
from echoscape.sim.numerics.decibels import power_ratio
from echoscape.sim.receiver.if_signal import (
    CELL_BINS,
    beat,
    echo_grid,
    grid_cells,
    grid_place,
    spectrum,
    sweep_ripple,
)
from echoscape.sim.receiver.range_fft import azimuth_blocks
from echoscape.sim.sensor.link_budget import window
from echoscape.sim.sensor.sensor import Sensor
from echoscape.sim.settings.artefacts import Artefacts, Strengths

_ROUNDS = 2
"""Iterations of the speckle-free grid towards the root of the expected power."""
_MOST_CHANGE = 4.0
"""Largest factor on an amplitude per iteration: a profile may have zeros, which no factor fills."""


def scaled_echoes(echoes: Echoes, artefacts: Artefacts, sensor: Sensor) -> Echoes:
    """Return the echoes with the given strengths of ghosts, sidelobes, Doppler shift and rain.

    Azimuths that objects on the vehicle block are attenuated as the sensor describes.

    Args:
        echoes: Traced echoes.
        artefacts: The strengths.
        sensor: The radar.

    Returns:
        The changed echoes; those of no power are left out.
    """
    strengths = artefacts.strengths(sensor)
    if strengths.doppler != sensor.doppler_beta_s:
        more = strengths.doppler / sensor.doppler_beta_s - 1
        shift_s = sensor.doppler_shift_s[echoes.azimuth] * more
        echoes = replace(echoes, range_m=echoes.range_m + echoes.closing_mps * shift_s)
    gain = _power_gain(echoes, strengths)
    if gain is not None:
        echoes = echoes.select(gain > 0).scaled(gain[gain > 0])
    if sensor.azimuth_loss_db.any():
        echoes = echoes.scaled(power_ratio(-sensor.azimuth_loss_db)[echoes.azimuth])
    if strengths.rain:
        echoes = echoes.scaled(rain_gain(echoes.range_m, strengths.rain, sensor) ** 2)
    return echoes


def _power_gain(echoes: Echoes, strengths: Strengths) -> NDArray[np.float64] | None:
    """Return the factor on the power of each echo (E,), None where nothing changes."""
    if strengths.ghosts == strengths.sidelobes == 1:
        return None
    ghosts = np.where(echoes.bounces > 1, strengths.ghosts, 1.0)
    return ghosts * np.where(echoes.sidelobe, strengths.sidelobes, 1.0)


def speckled_grid(echoes: Echoes, sensor: Sensor, *, speckle: float) -> NDArray[np.complex64]:
    """Return the grid of echoes with a share of their power interfering.

    Coherent targets have no speckle: their phases are deterministic, and they interfere with the speckle-free
    part as two mirrors would.

    Args:
        echoes: Echoes of a scan.
        sensor: The radar.
        speckle: Share of the power that interferes, 0 to 1.

    Returns:
        Amplitudes (azimuths, fft_size / 4) complex64 [sqrt(W)].
    """
    if speckle == 1:
        return echo_grid(echoes, sensor)
    rough = ~echoes.returns.coherent[echoes.source]
    even = speckle_free_grid(echoes.select(rough), sensor) * np.float32(np.sqrt(1 - speckle))
    grid = echo_grid(echoes.select(~rough), sensor)
    grid += even
    if speckle > 0:
        grid += echo_grid(echoes.select(rough), sensor) * np.float32(np.sqrt(speckle))
    return grid


def speckle_free_grid(echoes: Echoes, sensor: Sensor) -> NDArray[np.float32]:
    """Return amplitudes in phase whose range profile has the expected power.

    The expected power of a cell is the sum of the mean powers P of the echoes under the point spread,
    P * |psf|^2. Starting from the root of P, the grid g is multiplied twice by sqrt(P * |psf|^2) / |g * psf|.

    Args:
        echoes: Echoes of a scan.
        sensor: The radar.

    Returns:
        Amplitudes (azimuths, fft_size / 4) float32 [sqrt(W)].
    """
    cells, heard = grid_cells(sensor), -(-sensor.bins // CELL_BINS)
    index = np.clip(np.rint(grid_place(echoes.range_m, sensor) / CELL_BINS), 0, cells - 1).astype(np.int64)
    power = np.bincount(echoes.azimuth * np.int64(cells) + index, echoes.mean_power, sensor.azimuths * cells)
    power = power.astype(np.float64, copy=False).reshape(sensor.azimuths, cells)
    grid = np.sqrt(power).astype(np.float32)
    for block in azimuth_blocks(sensor.azimuths):
        wanted = _expected_amplitude(power[block], sensor)
        for _ in range(_ROUNDS):
            signal = beat(grid[block].astype(np.complex64), sensor)
            found = np.abs(spectrum(signal, sensor, step=CELL_BINS))
            change = np.divide(wanted, found, out=np.ones_like(wanted), where=found > 0)
            grid[block, :heard] *= np.clip(change, 1 / _MOST_CHANGE, _MOST_CHANGE)
    return grid


def _expected_amplitude(power: NDArray[np.float64], sensor: Sensor) -> NDArray[np.float32]:
    """Return the root of the expected |FFT|^2 (azimuths, bins / CELL_BINS) of independent powers [W]."""
    expected = np.fft.irfft(np.fft.rfft(power, sensor.fft_size // CELL_BINS) * _spread_spectrum(sensor))
    return np.sqrt(np.maximum(expected[:, : -(-sensor.bins // CELL_BINS)], 0)).astype(np.float32)


@lru_cache(maxsize=8)
def _spread_spectrum(sensor: Sensor) -> NDArray[np.complex128]:
    """Return the transform (fft_size / 4 + 1,) of |FFT|^2 around the cell of an echo of 1 W."""
    size = sensor.fft_size // CELL_BINS
    spread = np.fft.fft(window(sensor) * sweep_ripple(sensor), size) / math.sqrt(2)
    return np.fft.rfft(np.abs(spread) ** 2)
