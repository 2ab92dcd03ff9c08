"""The receiver: leakage, phase noise, thermal noise, converter, window, FFT, gain and quantiser.

Nothing is painted on: a strong echo clips the converter, and its harmonics and the raised floor of the row
follow; a strong far echo carries its phase-noise skirt. What the converter gives are integers, kept or not,
and the power is made from them alone (`sim.receiver.range_fft`).
"""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from echoscape.sim.datasets.beat_signal import BeatSignal, finely_sampled, joined, sampled
from echoscape.sim.receiver.front_end import PART_STEP, FrontEnd, NoiseRealisation
from echoscape.sim.receiver.if_signal import spectrum
from echoscape.sim.receiver.range_fft import row_blocks, written_power
from echoscape.sim.sensor.link_budget import full_scale_amplitude
from echoscape.sim.sensor.sensor import Sensor
from echoscape.sim.settings.artefacts import Artefacts, Strengths


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
    draws = NoiseRealisation(sensor, noise_rng=noise_rng, phase_rng=phase_rng)
    front_end = FrontEnd(grid, sensor, draws)
    return received(front_end, sensor, artefacts, others=others, keep_beat=keep_beat, parts=parts)


def received(
    front_end: FrontEnd,
    sensor: Sensor,
    artefacts: Artefacts,
    *,
    others: NDArray[np.float32] | None = None,
    keep_beat: bool = False,
    parts: bool = True,
) -> Received:
    """Return what `receive` does of the grid of a front end, which settings of artefacts may share."""
    strengths = artefacts.strengths(sensor)
    level = strengths.phase_noise / sensor.phase_noise_rad
    mixed = front_end.mixed(leakage=strengths.leakage, level=level)
    added = [each for each in (front_end.draws.thermal(strengths.thermal_noise), others) if each is not None]
    power = np.empty((sensor.azimuths, sensor.bins), np.float32)
    coarse = np.empty((sensor.azimuths, -(-sensor.bins // PART_STEP) if parts else 0), np.complex64)
    saturated = np.zeros(sensor.azimuths, np.bool_)
    beats = []
    for rows in row_blocks(sensor.azimuths):
        signal = mixed[rows]
        for more in added:
            signal = signal + more[rows]
        converted, saturated[rows] = convert(signal, sensor, artefacts)
        whole = spectrum(converted.amplitude(), sensor)
        written_power(whole, sensor, out=power[rows])
        if parts:
            coarse[rows] = whole[:, ::PART_STEP]
        if keep_beat:
            beats.append(converted)
    silence = np.empty((sensor.azimuths, 0), np.float32)
    echo, noise, distortion = _parts(front_end, coarse, sensor, strengths) if parts else 3 * (silence,)
    return Received(
        power=power,
        echo=echo,
        noise=noise,
        distortion=distortion,
        saturated=saturated,
        others=_others_power(others, sensor) if parts else None,
        beat=joined(beats) if keep_beat else None,
    )


def _parts(
    front_end: FrontEnd, whole: NDArray[np.complex64], sensor: Sensor, strengths: Strengths
) -> tuple[NDArray[np.float32], NDArray[np.float32], NDArray[np.float32]]:
    """Return the written power, in steps, that echoes, noise and distortion have alone."""
    echo = front_end.echo_part(leakage=strengths.leakage)
    thermal = front_end.draws.thermal_part(strengths.thermal_noise)
    distortion = np.zeros_like(echo.power)
    if not strengths.linear:
        for rows in row_blocks(sensor.azimuths):
            rest = whole[rows] - echo.spectrum[rows] - thermal.spectrum[rows]
            written_power(rest, sensor, step=PART_STEP, out=distortion[rows])
    return echo.power, thermal.power, distortion


def _others_power(others: NDArray[np.float32] | None, sensor: Sensor) -> NDArray[np.float32] | None:
    """Return the written power (azimuths, bins / PART_STEP) of what other radars send."""
    if others is None:
        return None
    power = np.empty((sensor.azimuths, -(-sensor.bins // PART_STEP)), np.float32)
    for rows in row_blocks(sensor.azimuths):
        written_power(spectrum(others[rows], sensor, step=PART_STEP), sensor, step=PART_STEP, out=power[rows])
    return power
