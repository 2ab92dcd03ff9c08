"""What the receiver makes of given echoes, with the beat signal kept: a small radar, signals for tests."""

import math
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray
from scipy.signal import windows

from echoscape.sim.datasets.beat_signal import BeatSignal
from echoscape.sim.echoes import point_echoes
from echoscape.sim.receiver.if_signal import echo_grid
from echoscape.sim.receiver.receiver import Received, receive
from echoscape.sim.sensor.cts350x import CTS350X
from echoscape.sim.settings.artefacts import Artefacts

SENSOR = replace(CTS350X, azimuths=30, sweep_ripple_db=())  # more rows than are processed together
RECEIVER = ("saturation", "phase_noise", "thermal_noise", "leakage", "quantisation")
QUIET = Artefacts(**dict.fromkeys(RECEIVER, False))


def received(
    range_m: NDArray, amplitude: NDArray, artefacts: Artefacts, *, keep_beat: bool = True, seed: int = 0
) -> Received:
    """What the receiver makes of echoes (rows, echoes) at ranges (rows, echoes)."""
    rows, count = range_m.shape
    echoes = point_echoes(
        azimuth=np.repeat(np.arange(rows), count),
        range_m=range_m.ravel(),
        amplitude=amplitude.ravel(),
        azimuths=SENSOR.azimuths,
    )
    noise_rng, phase_rng = (np.random.default_rng([seed, k]) for k in (0, 1))
    grid = echo_grid(echoes, SENSOR)
    return receive(grid, SENSOR, artefacts, noise_rng=noise_rng, phase_rng=phase_rng, keep_beat=keep_beat)


def kept(range_m: NDArray, amplitude: NDArray, artefacts: Artefacts) -> BeatSignal:
    beat = received(range_m, amplitude, artefacts).beat
    assert beat is not None
    return beat


def tones(range_m: float, power_w: float) -> tuple[NDArray, NDArray]:
    """An echo of `power_w` at the same range at every azimuth."""
    shape = (SENSOR.azimuths, 1)
    return np.full(shape, range_m), np.full(shape, math.sqrt(power_w) + 0j)


def full_scale_w() -> float:
    """The power of a sine that fills the converter: it is written `full_scale_db` above one unit."""
    hann = windows.hann(SENSOR.samples, sym=False)
    units_per_w = hann.sum() ** 2 / 2 * SENSOR.noise_units / (SENSOR.thermal_noise_w * (hann**2).sum())
    return 10 ** (SENSOR.full_scale_db / 10) / units_per_w
