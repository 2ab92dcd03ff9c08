"""From a grid of echoes to the signal at the converter: leakage, phase noise, thermal noise.

Everything before the converter is linear in the echoes, and its random draws depend on the scan alone, so
settings of artefacts share them: a result is kept for the next setting, and the order of settings changes no
byte.
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
from echoscape.sim.receiver.range_fft import azimuth_blocks, written_power
from echoscape.sim.sensor.sensor import Sensor

PART_STEP = 2
"""Parts of the power are computed in every second bin, since the point spread is some 8 bins wide."""
_KEPT = 4
"""Results of each kind that are kept: settings mostly differ from one of them in one strength."""

_Result = TypeVar("_Result")


@dataclass(frozen=True)
class Part:
    """The part of a signal that echoes or noise have alone, in every PART_STEP-th bin.

    Attributes:
        spectrum: Spectrum (azimuths, bins / PART_STEP) complex64 [sqrt(W)].
        power: Written power (azimuths, bins / PART_STEP) float32.
    """

    spectrum: NDArray[np.complex64]
    power: NDArray[np.float32]


class _Latest(Generic[_Result]):
    """Keeps the latest results."""

    def __init__(self) -> None:
        self._kept: dict[Hashable, _Result] = {}

    def get(self, key: Hashable, compute: Callable[[], _Result]) -> _Result:
        result = self._kept.pop(key) if key in self._kept else compute()
        self._kept[key] = result
        if len(self._kept) > _KEPT:
            del self._kept[next(iter(self._kept))]
        return result


def leakage_grid(sensor: Sensor) -> NDArray[np.complex64]:
    """Compute the transmit-receive leakage and the echoes of the radome, which are alike at all azimuths.

    Args:
        sensor: The radar.

    Returns:
        A grid of echoes (1, fft_size / 2) complex64 [sqrt(W)].
    """
    range_m, level_dbm = np.array(sensor.leakage_dbm).T
    phase = -4 * math.pi * range_m / sensor.wavelength_m
    amplitude = np.sqrt(power_ratio(level_dbm - 30)) * np.exp(1j * phase)
    echoes = point_echoes(
        azimuth=np.zeros(len(range_m)), range_m=range_m, amplitude=amplitude, azimuths=sensor.azimuths
    )
    return echo_grid(echoes, sensor, azimuths=1)


class NoiseRealisation:
    """The receiver's random draws of one scan, made when they are first needed."""

    def __init__(
        self, sensor: Sensor, *, noise_rng: np.random.Generator, phase_rng: np.random.Generator
    ) -> None:
        """Prepare without drawing.

        Args:
            sensor: The radar.
            noise_rng: Draws thermal noise.
            phase_rng: Draws phase noise.
        """
        self._sensor = sensor
        self._noise_rng, self._phase_rng = noise_rng, phase_rng
        self._white: NDArray[np.float32] | None = None
        self._phase: list[NDArray[np.float32]] = []
        self._thermal: _Latest[NDArray[np.float32]] = _Latest()
        self._parts: _Latest[Part] = _Latest()
        self._modulation: _Latest[list[Modulation]] = _Latest()

    def thermal(self, kelvin: float) -> NDArray[np.float32] | None:
        """Draw the thermal noise of all samples: white, of variance k T fs / 2.

        Args:
            kelvin: Noise temperature T [K].

        Returns:
            Noise (azimuths, samples) float32 [sqrt(W)], None at 0 K.
        """
        if not kelvin:
            return None
        return self._thermal.get(kelvin, lambda: self._draw_thermal(kelvin))

    def _draw_thermal(self, kelvin: float) -> NDArray[np.float32]:
        sensor = self._sensor
        if self._white is None:
            shape = (sensor.azimuths, sensor.samples)
            self._white = self._noise_rng.standard_normal(shape, dtype=np.float32)
        power_w = sensor.thermal_noise_w * (kelvin / sensor.noise_temperature_k)
        return self._white * np.float32(math.sqrt(power_w))

    def thermal_part(self, kelvin: float) -> Part:
        """Compute the part of the thermal noise.

        Args:
            kelvin: Noise temperature [K].

        Returns:
            Spectrum and written power of the noise alone.
        """
        return self._parts.get(kelvin, lambda: _part(self.thermal(kelvin), self._sensor))

    def modulation(self, level: float) -> list[Modulation]:
        """Draw the effect of phase noise.

        Args:
            level: Amplitude of the phase noise relative to the sensor's.

        Returns:
            The modulation of each block of azimuths.
        """
        return self._modulation.get(level, lambda: self._draw_modulation(level))

    def _draw_modulation(self, level: float) -> list[Modulation]:
        sensor = self._sensor
        if not self._phase:
            count = sample_count(sensor)
            self._phase = [
                phase_noise(sensor, azimuths=block.stop - block.start, count=count, rng=self._phase_rng)
                for block in azimuth_blocks(sensor.azimuths)
            ]
        return [modulation(each if level == 1 else each * np.float32(level), sensor) for each in self._phase]


class FrontEnd:
    """The receiver before the converter, for one grid of echoes."""

    def __init__(self, grid: NDArray[np.complex64], sensor: Sensor, draws: NoiseRealisation) -> None:
        """Prepare without computing.

        Args:
            grid: Echoes on the grid of range bins (azimuths, fft_size / 2) complex64 [sqrt(W)].
            sensor: The radar.
            draws: Random draws of the scan.
        """
        self.draws = draws
        self._grid, self._sensor = grid, sensor
        self._mixed: _Latest[NDArray[np.float32]] = _Latest()
        self._echo: _Latest[Part] = _Latest()

    def mixed(self, *, leakage: float, level: float) -> NDArray[np.float32]:
        """Compute the beat signal after the mixer, without thermal noise.

        Args:
            leakage: Power of the leakage relative to the sensor's.
            level: Amplitude of the phase noise relative to the sensor's.

        Returns:
            The beat signal (azimuths, samples) float32 [sqrt(W)].
        """
        return self._mixed.get((leakage, level), lambda: self._mix(leakage, level))

    def echo_part(self, *, leakage: float) -> Part:
        """Compute the part of echoes and leakage, without phase noise.

        Args:
            leakage: Power of the leakage relative to the sensor's.

        Returns:
            Spectrum and written power of echoes and leakage alone.
        """
        return self._echo.get(leakage, lambda: _part(self.mixed(leakage=leakage, level=0.0), self._sensor))

    def _mix(self, leakage: float, level: float) -> NDArray[np.float32]:
        sensor = self._sensor
        leak = leakage_grid(sensor) * np.float32(math.sqrt(leakage))
        signal = np.empty((sensor.azimuths, sensor.samples), np.float32)
        noisy = self.draws.modulation(level) if level else None
        for number, block in enumerate(azimuth_blocks(sensor.azimuths)):
            grid = (self._grid[block] + leak).astype(np.complex64, copy=False)
            signal[block] = modulated(grid, sensor, noisy[number]) if noisy else beat(grid, sensor)
        return signal


def _part(signal: NDArray[np.float32] | None, sensor: Sensor) -> Part:
    """Return the part of a signal (azimuths, samples), zeros where there is none."""
    shape = (sensor.azimuths, -(-sensor.bins // PART_STEP))
    found, power = np.zeros(shape, np.complex64), np.zeros(shape, np.float32)
    if signal is not None:
        for block in azimuth_blocks(sensor.azimuths):
            found[block] = spectrum(signal[block], sensor, step=PART_STEP)
            written_power(found[block], sensor, step=PART_STEP, out=power[block])
    return Part(found, power)
