"""The receiver: leakage, phase noise, compression, thermal noise, converter, window, FFT, gain and quantiser.

Artefacts are not added to the image but arise in the signal: strong echoes are compressed together, from
which their ceiling and their intermodulation follow; one that clips the converter has harmonics; a strong far
echo carries its phase-noise skirt. The power is computed from the converter's integers alone
(`sim.receiver.range_fft`).
"""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from echoscape.sim.datasets.beat_signal import BeatSignal, finely_sampled, joined, sampled
from echoscape.sim.receiver.front_end import PART_STEP, FrontEnd, NoiseRealisation, coarse_power
from echoscape.sim.receiver.if_signal import spectrum
from echoscape.sim.receiver.range_fft import azimuth_blocks, thermal_power, written_power
from echoscape.sim.sensor.link_budget import full_scale_amplitude
from echoscape.sim.sensor.sensor import Sensor
from echoscape.sim.settings.artefacts import Artefacts, Strengths


@dataclass(frozen=True, kw_only=True)
class Received:
    """What the receiver makes of one scan, in units of written power.

    Attributes:
        power: What the quantiser takes (azimuths, bins) float32.
        echo: Part of the echoes (azimuths, bins / PART_STEP) float32, in every PART_STEP-th bin; without
            bins where parts were not asked for.
        noise: Expected part of the thermal noise (1, bins / PART_STEP) float32, alike at all azimuths.
        distortion: Part of everything non-linear (compression, clipping, converter steps, phase noise) and of
            other radars, as `echo`.
        saturated: Whether a sample of each azimuth was compressed by 1 dB or more, or clipped (azimuths,)
            bool.
        others: Part of other radars, as `echo`, None where they are silent.
        beat: The signal that the power was computed from, None unless it was asked for.
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
    """Convert a signal to integers.

    Args:
        signal: Beat signal (azimuths, samples) [sqrt(W)].
        sensor: The radar.
        artefacts: Strengths of saturation and quantisation; without quantisation an azimuth has the finest
            steps that 16 bits allow.

    Returns:
        The sampled signal, and whether each azimuth was clipped (azimuths,) bool.
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
    """Receive a scan.

    The distortion is what the converter gives beyond echoes and thermal noise, other radars included.

    Args:
        grid: Grid of echoes (azimuths, fft_size / 4) complex64 [sqrt(W)].
        sensor: The radar.
        artefacts: Strengths of the artefacts.
        noise_rng: Draws thermal noise.
        phase_rng: Draws phase noise.
        others: Signal of other radars (azimuths, samples) [sqrt(W)], None where they are silent.
        keep_beat: Whether the sampled signal is kept.
        parts: Whether the parts of the power are computed.

    Returns:
        The written power and its parts.
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
    """Receive a scan whose front end other settings of artefacts may share.

    Args:
        front_end: Front end with the grid of echoes and the random draws.
        sensor: The radar.
        artefacts: Strengths of the artefacts.
        others: As in `receive`, as are the following.
        keep_beat: Whether the sampled signal is kept.
        parts: Whether the parts of the power are computed.

    Returns:
        The written power and its parts.
    """
    strengths = artefacts.strengths(sensor)
    mixed = front_end.mixed(
        leakage=strengths.leakage,
        level=strengths.phase_noise / sensor.phase_noise_rad,
        saturation=min(strengths.saturation, 1.0),
    )
    thermal = front_end.draws.thermal(strengths.thermal_noise)
    added = [each for each in (thermal, others) if each is not None]
    power = np.empty((sensor.azimuths, sensor.bins), np.float32)
    rest = np.empty_like(mixed.signal) if parts and not strengths.linear else None
    clipped = np.zeros(sensor.azimuths, np.bool_)
    beats = []
    for block in azimuth_blocks(sensor.azimuths):
        signal = mixed.signal[block]
        for more in added:
            signal = signal + more[block]
        converted, clipped[block] = convert(signal, sensor, artefacts)
        amplitude = converted.amplitude()
        written_power(spectrum(amplitude, sensor), sensor, out=power[block])
        if rest is not None:
            rest[block] = amplitude if thermal is None else amplitude - thermal[block]
        if keep_beat:
            beats.append(converted)
    echo, noise, distortion = _parts(front_end, rest, sensor, strengths) if parts else 3 * (_nothing(sensor),)
    return Received(
        power=power,
        echo=echo,
        noise=noise,
        distortion=distortion,
        saturated=mixed.overdriven | clipped,
        others=coarse_power(others, sensor) if parts and others is not None else None,
        beat=joined(beats) if keep_beat else None,
    )


def _nothing(sensor: Sensor) -> NDArray[np.float32]:
    """Return a part without bins."""
    return np.empty((sensor.azimuths, 0), np.float32)


def _parts(
    front_end: FrontEnd, rest: NDArray[np.float32] | None, sensor: Sensor, strengths: Strengths
) -> tuple[NDArray[np.float32], NDArray[np.float32], NDArray[np.float32]]:
    """Return the written power of echoes, noise and distortion alone, in every PART_STEP-th bin.

    `rest` is the converter's signal without thermal noise, None where the receiver is linear.
    """
    echo = front_end.echo_power(leakage=strengths.leakage)
    noise = thermal_power(sensor, kelvin=strengths.thermal_noise)[None, ::PART_STEP]
    if rest is None:
        return echo, noise, np.zeros_like(echo)
    rest -= front_end.echo_signal(leakage=strengths.leakage)
    return echo, noise, coarse_power(rest, sensor)
