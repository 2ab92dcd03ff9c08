"""The receiver: leakage, phase noise, thermal noise, converter, window, FFT, gain and quantiser.

Nothing is painted on: a strong echo clips the converter, and its harmonics and the raised floor of the row
follow; a strong far echo carries its phase-noise skirt. What the converter gives are integers, kept or not,
and the power is made from them alone (`sim.range_processing`).
"""

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from echoscape.sim.artefacts import Artefacts
from echoscape.sim.beat_signal import BeatSignal, finely_sampled, joined, sampled
from echoscape.sim.decibels import power_ratio
from echoscape.sim.echoes import point_echoes
from echoscape.sim.link import full_scale_amplitude
from echoscape.sim.phase_noise import noisy_beat
from echoscape.sim.range_processing import row_blocks, written_power
from echoscape.sim.sensor import Sensor
from echoscape.sim.waveform import beat, echo_grid, spectrum

PART_STEP = 2
"""The parts of the power are told in every second bin: the point spread is some 8 bins wide."""


@dataclass(frozen=True, kw_only=True)
class Received:
    """What the receiver makes of one scan, in units of written power.

    power (A, bins) float32: what the quantiser takes; echo, noise, distortion (A, bins / PART_STEP) float32:
    the parts that echoes, thermal noise, and everything non-linear (clipping, converter steps, phase noise)
    have alone, in every PART_STEP-th bin (no bins where they were not asked for); saturated (A,) bool: a
    sample of the row was clipped; others, like the parts: what other radars send, None where they are silent;
    beat: what the power was made from, where it was asked for.
    """

    power: NDArray[np.float32]
    echo: NDArray[np.float32]
    noise: NDArray[np.float32]
    distortion: NDArray[np.float32]
    saturated: NDArray[np.bool_]
    others: NDArray[np.float32] | None = None
    beat: BeatSignal | None = None


def leakage_grid(sensor: Sensor) -> NDArray[np.complex64]:
    """Return the leakage as a row of the grid of echoes (1, fft_size / 2) [sqrt(W)], alike in all rows."""
    range_m, level_dbm = np.array(sensor.leakage_dbm).T
    phase = -4 * math.pi * range_m / sensor.wavelength_m
    amplitude = np.sqrt(power_ratio(level_dbm - 30)) * np.exp(1j * phase)
    echoes = point_echoes(
        row=np.zeros(len(range_m)), range_m=range_m, amplitude=amplitude, azimuths=sensor.azimuths
    )
    return echo_grid(echoes, sensor, rows=1)


def thermal_noise(sensor: Sensor, *, rng: np.random.Generator, kelvin: float) -> NDArray[np.float32] | None:
    """Draw the noise of all samples of a scan (azimuths, samples) float32 [sqrt(W)], white, k T fs / 2."""
    if not kelvin:
        return None
    draws = rng.standard_normal((sensor.azimuths, sensor.samples), dtype=np.float32)
    power_w = sensor.thermal_noise_w * (kelvin / sensor.noise_temperature_k)
    return draws * np.float32(math.sqrt(power_w))


def convert(
    signal: NDArray[np.float32], sensor: Sensor, artefacts: Artefacts
) -> tuple[BeatSignal, NDArray[np.bool_]]:
    """Return what the converter makes of a signal (rows, samples), and which rows (rows,) it clips.

    Without quantisation a row has the finest steps that 16 bits allow it.
    """
    strengths = artefacts.strengths(sensor)
    full_scale = full_scale_amplitude(sensor) / (strengths.saturation or 1.0)
    clipped = np.zeros(len(signal), np.bool_)
    if strengths.saturation:
        clipped = np.abs(signal).max(axis=1) > full_scale
        signal = np.clip(signal, -full_scale, full_scale)
    if not strengths.quantisation:
        return finely_sampled(signal), clipped
    step = np.full(len(signal), full_scale * strengths.quantisation, np.float32)
    return sampled(signal, step), clipped


def receive(
    grid: NDArray[np.complex64],
    sensor: Sensor,
    artefacts: Artefacts,
    *,
    noise_rng: np.random.Generator,
    phase_rng: np.random.Generator,
    others: NDArray[np.float32] | None = None,
    keep_beat: bool = False,
    parts: bool = True,
) -> Received:
    """Return the written power of a scan's grid of echoes (azimuths, fft_size / 2), and what made it.

    The linear parts (echo, noise) and the whole are transformed alike; what the whole has beyond them is
    distortion; `others` (azimuths, samples) [sqrt(W)], what other radars send, is part of it. With
    `keep_beat` the signal that the power was made from comes along; without `parts` the power alone is made.
    """
    strengths = artefacts.strengths(sensor)
    noise = thermal_noise(sensor, rng=noise_rng, kelvin=strengths.thermal_noise)
    leak = leakage_grid(sensor) * np.float32(math.sqrt(strengths.leakage))
    power = np.empty((sensor.azimuths, sensor.bins), np.float32)
    part_bins = -(-sensor.bins // PART_STEP) if parts else 0
    alone = np.empty((3, sensor.azimuths, part_bins), np.float32)
    saturated = np.zeros(sensor.azimuths, np.bool_)
    beats = []
    for rows in row_blocks(sensor.azimuths):
        noise_rows = None if noise is None else noise[rows]
        others_rows = None if others is None else others[rows]
        echoes = (grid[rows] + leak).astype(np.complex64, copy=False)
        signal, saturated[rows] = _converted(
            echoes, noise_rows, others_rows, sensor, artefacts, phase_rng=phase_rng
        )
        whole = spectrum(signal.amplitude(), sensor)
        written_power(whole, sensor, out=power[rows])
        if parts:
            found = _parts(whole, echoes, noise_rows, sensor, linear=strengths.linear)
            for values, into in zip(found, alone, strict=True):
                written_power(values, sensor, step=PART_STEP, out=into[rows])
        if keep_beat:
            beats.append(signal)
    return Received(
        power=power,
        echo=alone[0],
        noise=alone[1],
        distortion=alone[2],
        saturated=saturated,
        others=_others_power(others, sensor) if parts else None,
        beat=joined(beats) if keep_beat else None,
    )


def _others_power(others: NDArray[np.float32] | None, sensor: Sensor) -> NDArray[np.float32] | None:
    """Return the written power (azimuths, bins / PART_STEP) of what other radars send."""
    if others is None:
        return None
    power = np.empty((sensor.azimuths, -(-sensor.bins // PART_STEP)), np.float32)
    for rows in row_blocks(sensor.azimuths):
        written_power(spectrum(others[rows], sensor, step=PART_STEP), sensor, step=PART_STEP, out=power[rows])
    return power


def _converted(
    grid: NDArray[np.complex64],
    noise: NDArray[np.float32] | None,
    others: NDArray[np.float32] | None,
    sensor: Sensor,
    artefacts: Artefacts,
    *,
    phase_rng: np.random.Generator,
) -> tuple[BeatSignal, NDArray[np.bool_]]:
    """Return some rows' signal behind the converter, and which of them it clips."""
    level = artefacts.strengths(sensor).phase_noise / sensor.phase_noise_rad
    signal = noisy_beat(grid, sensor, rng=phase_rng, level=level) if level else beat(grid, sensor)
    for more in (noise, others):
        if more is not None:
            signal = signal + more
    return convert(signal, sensor, artefacts)


def _parts(
    whole: NDArray[np.complex64],
    grid: NDArray[np.complex64],
    noise: NDArray[np.float32] | None,
    sensor: Sensor,
    *,
    linear: bool,
) -> list[NDArray[np.complex64]]:
    """Return the spectra, in steps, of some rows' echoes, noise and distortion alone."""
    silence = np.zeros((len(grid), -(-sensor.bins // PART_STEP)), np.complex64)
    echo = spectrum(beat(grid, sensor), sensor, step=PART_STEP)
    thermal = silence if noise is None else spectrum(noise, sensor, step=PART_STEP)
    return [echo, thermal, silence if linear else whole[:, ::PART_STEP] - echo - thermal]
