"""From a grid of echoes to the signal at the converter: leakage, phase noise, compression, thermal noise.

Its random draws depend on the scan alone, so that settings of artefacts share them: a result is kept for the
next setting, and the order of settings changes no byte.
"""

import math
from collections.abc import Callable, Hashable
from dataclasses import dataclass
from functools import lru_cache
from typing import Generic, TypeVar

import numpy as np
from numpy.typing import NDArray

from echoscape.sim.echoes import point_echoes
from echoscape.sim.numerics.decibels import power_ratio
from echoscape.sim.numerics.normal import standard_normal
from echoscape.sim.receiver.compression import ONE_DB, compression_gain, saturation_amplitude
from echoscape.sim.receiver.if_signal import CELL_BINS, analytic_beat, beat, echo_grid, spectrum, sweep_ripple
from echoscape.sim.receiver.phase_noise import Modulation, modulated, modulation, phase_noise, sample_count
from echoscape.sim.receiver.range_fft import azimuth_blocks, written_power
from echoscape.sim.sensor.sensor import Sensor

PART_STEP = CELL_BINS
"""Parts of the power are computed in every second bin, since the point spread is some 8 bins wide."""
_KEPT = 4
"""Results of each kind that are kept: settings mostly differ from one of them in one strength."""

_Result = TypeVar("_Result")


@dataclass(frozen=True)
class Mixed:
    """The beat signal after the mixer.

    Attributes:
        signal: The signal (azimuths, samples) float32 [sqrt(W)].
        overdriven: Whether echoes drove the receiver beyond its 1-dB compression point at each azimuth
            (azimuths,) bool.
    """

    signal: NDArray[np.float32]
    overdriven: NDArray[np.bool_]


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


@lru_cache(maxsize=8)
def leakage_grid(sensor: Sensor) -> NDArray[np.complex64]:
    """Compute the transmit-receive leakage and the echoes of the radome, which are alike at all azimuths.

    Args:
        sensor: The radar.

    Returns:
        A grid of echoes (1, fft_size / 4) complex64 [sqrt(W)].
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
            self._white = standard_normal(shape, rng=self._noise_rng)
        power_w = sensor.thermal_noise_w * (kelvin / sensor.noise_temperature_k)
        return self._white * np.float32(math.sqrt(power_w))

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
            grid: Grid of echoes (azimuths, fft_size / 4) complex64 [sqrt(W)].
            sensor: The radar.
            draws: Random draws of the scan.
        """
        self.draws = draws
        self._grid, self._sensor = grid, sensor
        self._mixed: _Latest[Mixed] = _Latest()
        self._echo: _Latest[NDArray[np.float32]] = _Latest()

    def mixed(self, *, leakage: float, level: float, saturation: float) -> Mixed:
        """Compute the beat signal after the mixer, without thermal noise.

        Args:
            leakage: Power of the leakage relative to the sensor's.
            level: Amplitude of the phase noise relative to the sensor's.
            saturation: Amplitude at the compressing stage relative to the sensor's; 0 does not compress.

        Returns:
            The beat signal.
        """
        return self._mixed.get((leakage, level, saturation), lambda: self._mix(leakage, level, saturation))

    def echo_signal(self, *, leakage: float) -> NDArray[np.float32]:
        """Compute the beat signal of echoes and leakage alone: neither phase noise nor compression.

        Args:
            leakage: Power of the leakage relative to the sensor's.

        Returns:
            The signal (azimuths, samples) float32 [sqrt(W)].
        """
        return self.mixed(leakage=leakage, level=0.0, saturation=0.0).signal

    def echo_power(self, *, leakage: float) -> NDArray[np.float32]:
        """Compute the power that echoes and leakage alone would write.

        Args:
            leakage: Power of the leakage relative to the sensor's.

        Returns:
            Written power (azimuths, bins / PART_STEP) float32, in every PART_STEP-th bin.
        """
        return self._echo.get(leakage, lambda: coarse_power(self.echo_signal(leakage=leakage), self._sensor))

    def _mix(self, leakage: float, level: float, saturation: float) -> Mixed:
        sensor = self._sensor
        leak = leakage_grid(sensor) * np.float32(math.sqrt(leakage))
        signal = np.empty((sensor.azimuths, sensor.samples), np.float32)
        overdriven = np.zeros(sensor.azimuths, np.bool_)
        noisy = self.draws.modulation(level) if level else None
        ripple = sweep_ripple(sensor).astype(np.float32)
        for number, block in enumerate(azimuth_blocks(sensor.azimuths)):
            grid = (self._grid[block] + leak).astype(np.complex64, copy=False)
            if not (noisy or saturation):
                signal[block] = beat(grid, sensor)
                continue
            if noisy:
                tones = modulated(grid, sensor, noisy[number])
            else:
                tones = analytic_beat(grid, sensor, count=sensor.samples)
            np.multiply(tones.real, ripple, out=signal[block])
            if saturation:
                gain = compression_gain(tones, saturation_amplitude(sensor) / saturation)
                overdriven[block] = gain.min(axis=1) < ONE_DB
                signal[block] *= gain
        return Mixed(signal, overdriven)


def coarse_power(signal: NDArray[np.float32], sensor: Sensor) -> NDArray[np.float32]:
    """Compute the power that a signal alone would write.

    Args:
        signal: The signal (azimuths, samples) [sqrt(W)].
        sensor: The radar.

    Returns:
        Written power (azimuths, bins / PART_STEP) float32, in every PART_STEP-th bin.
    """
    power = np.empty((len(signal), -(-sensor.bins // PART_STEP)), np.float32)
    for block in azimuth_blocks(len(signal)):
        found = spectrum(signal[block], sensor, step=PART_STEP)
        written_power(found, sensor, step=PART_STEP, out=power[block])
    return power
