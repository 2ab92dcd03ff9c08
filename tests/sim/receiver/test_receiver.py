"""The receiver as a whole: noise, echoes, clipping, and the parts of the power."""

from dataclasses import replace

import numpy as np
import pytest

from echoscape.sim.echoes import point_echoes
from echoscape.sim.receiver.if_signal import beat, echo_grid, spectrum
from echoscape.sim.receiver.quantiser import codes
from echoscape.sim.receiver.receiver import PART_STEP, Received, receive
from echoscape.sim.sensor.cts350x import CTS350X
from echoscape.sim.sensor.link_budget import full_scale_amplitude, range_gain, units_per_watt
from echoscape.sim.settings.artefacts import Artefacts

FLAT = replace(CTS350X, range_gain_db=((0.0, 0.0), (163.0, 0.0)), sweep_ripple_db=())
SMALL = replace(FLAT, azimuths=8)
QUIET = Artefacts(thermal_noise=False, leakage=False, phase_noise=False, saturation=False, quantisation=False)


def received(
    range_m: list[float], power_w: list[float], artefacts: Artefacts, sensor=SMALL, seed: int = 0
) -> Received:
    """What the receiver makes of echoes that are the same at every azimuth."""
    rows = np.repeat(np.arange(sensor.azimuths), len(range_m))
    amplitude = np.sqrt(np.tile(power_w, sensor.azimuths))
    echoes = point_echoes(
        azimuth=rows, range_m=np.tile(range_m, sensor.azimuths), amplitude=amplitude, azimuths=sensor.azimuths
    )
    rngs = [np.random.default_rng([seed, k]) for k in (0, 1)]
    return receive(echo_grid(echoes, sensor), sensor, artefacts, noise_rng=rngs[0], phase_rng=rngs[1])


def test_noise_has_the_measured_law_and_code_shares() -> None:
    noise = received([], [], Artefacts(leakage=False), sensor=FLAT).power
    # Neighbouring bins are correlated over some 6: 400 x 3768 / 6 independent draws.
    assert noise.mean() == pytest.approx(FLAT.noise_units, rel=0.01)
    assert noise.std() / noise.mean() == pytest.approx(1.0, rel=0.02)  # exponential
    far = noise * 10 ** (
        CTS350X.range_gain_db[-1][1] / 10
    )  # as the far range has it, where shares are measured
    counts = np.bincount(codes(far).ravel(), minlength=19) / noise.size
    # n = floor(P + 0.74), P exponential: the share of code 0 is P < 1.26, of 6 is 1.26 <= P < 2.26, ...
    edges = np.exp(-np.array([0, 1.26, 2.26, 3.26, 4.26, 5.26]) / far.mean())
    np.testing.assert_allclose(counts[[0, 6, 9, 12, 14]], edges[:-1] - edges[1:], rtol=0.03)
    np.testing.assert_allclose(counts[[0, 6, 9, 12, 14]], [0.601, 0.203, 0.099, 0.048, 0.024], rtol=0.15)


def test_echo_has_its_power_over_thermal_noise() -> None:
    # SNR after the transform = P T / (ENBW k T0 F): Hann's noise bandwidth is 1.5 cells.
    power_w = 1e-13
    noise_w_hz = 1.380649e-23 * 290 * 10 ** (FLAT.noise_figure_db / 10)
    expected = power_w * FLAT.sweep_s / (1.5 * noise_w_hz) * FLAT.noise_units
    at = (1000 + 0.5) * FLAT.bin_m
    found = received([at], [power_w], QUIET).power[0, 1000]
    # A rest of the sweep shorter than two samples goes unused; the grid's aliases add up to 0.5 %.
    assert power_w * units_per_watt(FLAT) == pytest.approx(expected, rel=2 / FLAT.samples)
    assert found == pytest.approx(expected, rel=0.01)


def test_gain_by_range_scales_everything_alike() -> None:
    shaped = replace(SMALL, range_gain_db=((0.0, 0.0), (50.0, 6.0), (163.0, 6.0)))
    flat, scaled = received([90.0], [1e-13], QUIET), received([90.0], [1e-13], QUIET, sensor=shaped)
    ranges = (np.arange(SMALL.bins) + 0.5) * SMALL.bin_m
    np.testing.assert_allclose(scaled.power, flat.power * range_gain(shaped, ranges), rtol=1e-5)


def replace_artefacts(artefacts: Artefacts, **changes: bool) -> Artefacts:
    return replace(artefacts, **changes)


def test_weak_echoes_do_not_clip() -> None:
    found = received(
        [20.0], [1e-3 * full_scale_amplitude(SMALL) ** 2], replace_artefacts(QUIET, saturation=True)
    )
    assert not found.saturated.any()
    assert found.distortion.max() < 1e-4 * found.power.max()


def test_switching_one_artefact_off_leaves_the_others_draws_alone() -> None:
    # Phase noise of an echo 12 dB above the noise lies far below that.
    both = received([30.0], [1e-14], Artefacts(leakage=False))
    without = received([30.0], [1e-14], Artefacts(leakage=False, phase_noise=False))
    other = received([30.0], [1e-14], Artefacts(leakage=False), seed=1)
    assert np.abs(both.power - without.power).mean() < 0.05 * both.power.mean()
    assert np.abs(both.power - other.power).mean() > 0.5 * both.power.mean()


def test_parts_add_up_by_power_in_the_mean() -> None:
    sensor = FLAT
    grid = echo_grid(
        point_echoes(
            azimuth=np.arange(400), range_m=np.full(400, 50.0), amplitude=np.full(400, 1e-7), azimuths=400
        ),
        sensor,
    )
    clean = spectrum(beat(grid, sensor), sensor, step=PART_STEP)
    found = receive(
        grid,
        sensor,
        replace_artefacts(QUIET, thermal_noise=True),
        noise_rng=np.random.default_rng(0),
        phase_rng=np.random.default_rng(1),
    )
    strong = np.abs(clean) > np.abs(clean).max() * 1e-3
    echo_units = found.echo[strong] / np.abs(clean[strong]) ** 2
    assert np.ptp(echo_units) < 1e-3 * echo_units.max()
    assert not found.distortion.any()
    # Noise is exponential and independent at every azimuth, so its mean over 400 of them scatters by 5 %; 16
    # steps of range are more than its correlation.
    excess = (found.power[:, ::PART_STEP] - found.echo).mean(axis=0)
    away = ~strong.any(axis=0)
    assert excess[away][::16] == pytest.approx(found.noise[0, away][::16], rel=0.25)
    assert (excess / found.noise[0])[away].mean() == pytest.approx(1, abs=0.01)
