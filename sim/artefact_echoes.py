"""What artefacts make of traced echoes before the receiver: one trace serves any strengths.

Speckle is the interference of echoes. What of it is switched off adds up by power instead: on a grid of
amplitudes in phase, found step by step, whose range profile is the root of the expected power.
"""

from dataclasses import replace
from functools import lru_cache

import numpy as np
from numpy.typing import NDArray
from scipy.ndimage import convolve1d

from echoscape.sim.artefacts import Artefacts, Strengths
from echoscape.sim.decibels import power_ratio
from echoscape.sim.echoes import Echoes
from echoscape.sim.link import window
from echoscape.sim.rain import rain_gain
from echoscape.sim.sensor import Sensor
from echoscape.sim.waveform import echo_grid, grid_place, sample_times

_ROUNDS = 4
"""Steps of the even grid towards the root of the expected power."""
_REACH = 24
"""Bins to each side over which the even grid knows the point spread: down to -30 dB."""


def changed(echoes: Echoes, artefacts: Artefacts, sensor: Sensor) -> Echoes:
    """Return the echoes with ghosts, sidelobes, Doppler shift and rain as strong as `artefacts` says.

    What stands on the vehicle takes its share from the rows behind it.
    """
    strengths = artefacts.strengths(sensor)
    if strengths.doppler != sensor.doppler_beta_s:
        more = strengths.doppler / sensor.doppler_beta_s - 1
        shift_s = sensor.doppler_shift_s[echoes.row] * more
        echoes = replace(echoes, range_m=echoes.range_m + echoes.closing_mps * shift_s)
    gain = _power_gain(echoes, strengths)
    if gain is not None:
        echoes = echoes.select(gain > 0).scaled(gain[gain > 0])
    if sensor.row_loss_db.any():
        echoes = echoes.scaled(power_ratio(-sensor.row_loss_db)[echoes.row])
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

    Coherent targets have no speckle: their phases are theirs.
    """
    if speckle == 1:
        return echo_grid(echoes, sensor)
    rough = ~echoes.returns.coherent[echoes.source]
    even = even_grid(echoes.select(rough), sensor) * np.float32(np.sqrt(1 - speckle))
    fixed = echo_grid(echoes.select(~rough), sensor)
    if speckle == 0:
        return fixed + even
    return fixed + even + echo_grid(echoes.select(rough), sensor) * np.float32(np.sqrt(speckle))


def even_grid(echoes: Echoes, sensor: Sensor) -> NDArray[np.float32]:
    """Return amplitudes in phase (azimuths, fft_size / 2) [sqrt(W)] whose profile has the expected power.

    The expected power of a bin is the sum of the echoes' mean powers under the point spread, P * psf^2.
    Starting from the root of P, the grid g is multiplied by sqrt(P * psf^2) / (g * psf) until it fits.
    """
    bins = sensor.fft_size // 2
    place = np.clip(np.rint(grid_place(echoes.range_m, sensor)), 0, bins - 1).astype(np.int64)
    size = sensor.azimuths * bins
    power = np.bincount(echoes.row * np.int64(bins) + place, echoes.mean_power, size)
    power = power.reshape(sensor.azimuths, bins)
    spread = _point_spread(sensor)
    wanted = np.sqrt(np.maximum(convolve1d(power, spread**2, axis=1, mode="constant"), 0))
    grid = np.sqrt(power)
    for _ in range(_ROUNDS):
        found = convolve1d(grid, spread, axis=1, mode="constant")
        grid *= np.divide(wanted, found, out=np.zeros_like(wanted), where=found > 0)
    return grid.astype(np.float32)


@lru_cache(maxsize=8)
def _point_spread(sensor: Sensor) -> NDArray[np.float64]:
    """Return the amplitude of the range point spread at whole bins from its peak (2 REACH + 1,)."""
    offsets = np.arange(-_REACH, _REACH + 1)
    weight = window(sensor)
    return (
        np.cos(2 * np.pi * offsets[:, None] * sample_times(sensor) / sensor.fft_size) @ weight / weight.sum()
    )
