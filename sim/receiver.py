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
    have alone, in every PART_STEP-th bin; saturated (A,) bool: a sample of the row was clipped; beat: what
    the power was made from, where it was asked for.
    """

    power: NDArray[np.float32]
    echo: NDArray[np.float32]
    noise: NDArray[np.float32]
    distortion: NDArray[np.float32]
    saturated: NDArray[np.bool_]
    others: NDArray[np.float32] | None
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
) -> Received:
    """Return the written power of a scan's grid of echoes (azimuths, fft_size / 2), and what made it.

    The linear parts (echo, noise) and the whole are transformed alike; what the whole has beyond them is
    distortion; `others` (azimuths, samples) [sqrt(W)], what other radars send, is part of it. With
    `keep_beat` the signal that the power was made from comes along.
    """
    strengths = artefacts.strengths(sensor)
    noise = thermal_noise(sensor, rng=noise_rng, kelvin=strengths.thermal_noise)
    leak = leakage_grid(sensor) * np.float32(math.sqrt(strengths.leakage))
    steps = [1] + 3 * [PART_STEP]
    parts = [np.empty((sensor.azimuths, -(-sensor.bins // step)), np.float32) for step in steps]
    saturated = np.zeros(sensor.azimuths, np.bool_)
    beats = []
    for rows in row_blocks(sensor.azimuths):
        noise_rows = None if noise is None else noise[rows]
        others_rows = None if others is None else others[rows]
        signal, block, saturated[rows] = _block(
            grid[rows] + leak, noise_rows, others_rows, sensor, artefacts, phase_rng
        )
        for whole, values, step in zip(parts, block, steps, strict=True):
            written_power(values, sensor, step=step, out=whole[rows])
        if keep_beat:
            beats.append(signal)
    return Received(
        power=parts[0],
        echo=parts[1],
        noise=parts[2],
        distortion=parts[3],
        saturated=saturated,
        others=_others_power(others, sensor),
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


def _block(
    grid: NDArray[np.complex64],
    noise: NDArray[np.float32] | None,
    others: NDArray[np.float32] | None,
    sensor: Sensor,
    artefacts: Artefacts,
    phase_rng: np.random.Generator,
) -> tuple[BeatSignal, list[NDArray[np.complex64]], NDArray[np.bool_]]:
    """Return some rows' signal, spectra (whole; echoes, noise, distortion in steps), and what is clipped."""
    silence = np.zeros((len(grid), -(-sensor.bins // PART_STEP)), np.complex64)
    clean = beat(grid, sensor)
    strengths = artefacts.strengths(sensor)
    level = strengths.phase_noise / sensor.phase_noise_rad
    signal = noisy_beat(grid, sensor, rng=phase_rng, level=level) if level else clean
    for more in (noise, others):
        if more is not None:
            signal = signal + more
    converted, saturated = convert(signal, sensor, artefacts)
    whole = spectrum(converted.amplitude(), sensor)
    clean_spectrum = spectrum(clean, sensor, step=PART_STEP)
    noise_spectrum = silence if noise is None else spectrum(noise, sensor, step=PART_STEP)
    distortion = silence if strengths.linear else whole[:, ::PART_STEP] - clean_spectrum - noise_spectrum
    return converted, [whole, clean_spectrum, noise_spectrum, distortion], saturated
