"""From a grid of echoes to the signal at the converter: leakage, phase noise, thermal noise.

Everything up to the converter is linear in the echoes, and its draws are those of the scan, so settings of
artefacts share them: what one of them made is kept for the next, and no order of settings changes a byte.
"""

import math
from collections.abc import Callable, Hashable
from dataclasses import dataclass
from typing import Generic, TypeVar

import numpy as np
from numpy.typing import NDArray

from echoscape.sim.echoes import point_echoes
from echoscape.sim.numerics.decibels import power_ratio
from echoscape.sim.receiver.if_signal import beat, echo_grid, spectrum
from echoscape.sim.receiver.phase_noise import Modulation, modulated, modulation, phase_noise, sample_count
from echoscape.sim.receiver.range_fft import row_blocks, written_power
from echoscape.sim.sensor.sensor import Sensor

PART_STEP = 2
"""The parts of the power are told in every second bin: the point spread is some 8 bins wide."""
_KEPT = 4
"""Results of each kind that are kept: settings mostly differ from one of them in one strength."""

_Made = TypeVar("_Made")


@dataclass(frozen=True)
class Part:
    """What echoes or noise have alone, in every PART_STEP-th bin (A, S).

    spectrum complex64 [sqrt(W)]; power float32: written power.
    """

    spectrum: NDArray[np.complex64]
    power: NDArray[np.float32]


class _Latest(Generic[_Made]):
    """Keeps the results that were asked for last."""

    def __init__(self) -> None:
        self._kept: dict[Hashable, _Made] = {}

    def get(self, key: Hashable, make: Callable[[], _Made]) -> _Made:
        made = self._kept.pop(key) if key in self._kept else make()
        self._kept[key] = made
        if len(self._kept) > _KEPT:
            del self._kept[next(iter(self._kept))]
        return made


def leakage_grid(sensor: Sensor) -> NDArray[np.complex64]:
    """Return the leakage as a row of the grid of echoes (1, fft_size / 2) [sqrt(W)], alike in all rows."""
    range_m, level_dbm = np.array(sensor.leakage_dbm).T
    phase = -4 * math.pi * range_m / sensor.wavelength_m
    amplitude = np.sqrt(power_ratio(level_dbm - 30)) * np.exp(1j * phase)
    echoes = point_echoes(
        azimuth=np.zeros(len(range_m)), range_m=range_m, amplitude=amplitude, azimuths=sensor.azimuths
    )
    return echo_grid(echoes, sensor, rows=1)


class NoiseRealisation:
    """The receiver's draws of one scan, made when first asked for."""

    def __init__(
        self, sensor: Sensor, *, noise_rng: np.random.Generator, phase_rng: np.random.Generator
    ) -> None:
        self._sensor = sensor
        self._noise_rng, self._phase_rng = noise_rng, phase_rng
        self._white: NDArray[np.float32] | None = None
        self._phase: list[NDArray[np.float32]] = []
        self._thermal: _Latest[NDArray[np.float32]] = _Latest()
        self._parts: _Latest[Part] = _Latest()
        self._modulation: _Latest[list[Modulation]] = _Latest()

    def thermal(self, kelvin: float) -> NDArray[np.float32] | None:
        """Return the noise of all samples (azimuths, samples) float32 [sqrt(W)], white, k T fs / 2."""
        if not kelvin:
            return None
        return self._thermal.get(kelvin, lambda: self._drawn_thermal(kelvin))

    def _drawn_thermal(self, kelvin: float) -> NDArray[np.float32]:
        sensor = self._sensor
        if self._white is None:
            shape = (sensor.azimuths, sensor.samples)
            self._white = self._noise_rng.standard_normal(shape, dtype=np.float32)
        power_w = sensor.thermal_noise_w * (kelvin / sensor.noise_temperature_k)
        return self._white * np.float32(math.sqrt(power_w))

    def thermal_part(self, kelvin: float) -> Part:
        """Return what the noise has alone."""
        return self._parts.get(kelvin, lambda: _part(self.thermal(kelvin), self._sensor))

    def modulation(self, level: float) -> list[Modulation]:
        """Return what phase noise does to each block of rows; `level`: its amplitude over the sensor's."""
        return self._modulation.get(level, lambda: self._drawn_modulation(level))

    def _drawn_modulation(self, level: float) -> list[Modulation]:
        sensor = self._sensor
        if not self._phase:
            self._phase = [
                phase_noise(
                    sensor, rows=rows.stop - rows.start, count=sample_count(sensor), rng=self._phase_rng
                )
                for rows in row_blocks(sensor.azimuths)
            ]
        return [modulation(each if level == 1 else each * np.float32(level), sensor) for each in self._phase]


class FrontEnd:
    """What comes of one grid of echoes (azimuths, fft_size / 2) [sqrt(W)] before the converter."""

    def __init__(self, grid: NDArray[np.complex64], sensor: Sensor, draws: NoiseRealisation) -> None:
        self.draws = draws
        self._grid, self._sensor = grid, sensor
        self._mixed: _Latest[NDArray[np.float32]] = _Latest()
        self._echo: _Latest[Part] = _Latest()

    def mixed(self, *, leakage: float, level: float) -> NDArray[np.float32]:
        """Return the beat signal (azimuths, samples) float32 [sqrt(W)] without thermal noise.

        leakage: its power over the sensor's; level: amplitude of phase noise over the sensor's.
        """
        return self._mixed.get((leakage, level), lambda: self._mix(leakage, level))

    def echo_part(self, *, leakage: float) -> Part:
        """Return what echoes and leakage have alone, without phase noise."""
        return self._echo.get(leakage, lambda: _part(self.mixed(leakage=leakage, level=0.0), self._sensor))

    def _mix(self, leakage: float, level: float) -> NDArray[np.float32]:
        sensor = self._sensor
        leak = leakage_grid(sensor) * np.float32(math.sqrt(leakage))
        signal = np.empty((sensor.azimuths, sensor.samples), np.float32)
        noisy = self.draws.modulation(level) if level else None
        for number, rows in enumerate(row_blocks(sensor.azimuths)):
            grid = (self._grid[rows] + leak).astype(np.complex64, copy=False)
            signal[rows] = modulated(grid, sensor, noisy[number]) if noisy else beat(grid, sensor)
        return signal


def _part(signal: NDArray[np.float32] | None, sensor: Sensor) -> Part:
    """Return the part of a signal (azimuths, samples), silence where there is none."""
    shape = (sensor.azimuths, -(-sensor.bins // PART_STEP))
    found, power = np.zeros(shape, np.complex64), np.zeros(shape, np.float32)
    if signal is not None:
        for rows in row_blocks(sensor.azimuths):
            found[rows] = spectrum(signal[rows], sensor, step=PART_STEP)
            written_power(found[rows], sensor, step=PART_STEP, out=power[rows])
    return Part(found, power)
