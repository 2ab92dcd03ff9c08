import math
from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from echoscape.sim.cts350x import CTS350X
from echoscape.sim.echoes import Echoes, point_echoes
from echoscape.sim.waveform import analytic_beat, beat, beat_reference, echo_grid, spectrum

SENSOR = replace(CTS350X, azimuths=2)


def random_echoes(count: int, seed: int, spread_db: float) -> Echoes:
    rng = np.random.default_rng(seed)
    size = 10 ** (rng.uniform(-spread_db, 0, count) / 20)
    return point_echoes(
        row=rng.integers(0, 2, count),
        range_m=rng.uniform(0.03, SENSOR.range_m, count),
        amplitude=size * np.exp(2j * math.pi * rng.random(count)),
        azimuths=2,
    )


@settings(max_examples=25, deadline=None)
@given(count=st.integers(1, 60), seed=st.integers(0, 2**31), spread_db=st.floats(0, 80))
def test_gridded_beat_agrees_with_the_sum_of_tones(count: int, seed: int, spread_db: float) -> None:
    echoes = random_echoes(count, seed, spread_db)
    grid = echo_grid(echoes, SENSOR)
    expected = np.abs(spectrum(beat_reference(echoes, SENSOR).astype(np.float32), SENSOR))
    found = np.abs(spectrum(beat(grid, SENSOR), SENSOR))
    assert 20 * math.log10(np.abs(found - expected).max() / expected.max() + 1e-12) < -40


def test_analytic_beat_has_the_beat_as_its_real_part() -> None:
    echoes = random_echoes(30, 3, 40)
    signal = beat_reference(echoes, SENSOR)
    analytic = analytic_beat(echo_grid(echoes, SENSOR), SENSOR, count=SENSOR.samples)
    middle = signal
    inside = slice(
        40, -40
    )  # at the sweep's very ends the grid's aliases reach -40 dB, under the window's zero
    assert np.abs(analytic.real - middle)[:, inside].max() < 0.01 * np.abs(middle).max()


@pytest.mark.parametrize("range_m", [3.0, 17.345, 60.0123, 120.0, 160.0])
def test_point_target_peaks_in_its_bin(range_m: float) -> None:
    echoes = point_echoes(row=np.zeros(1), range_m=np.array([range_m]), amplitude=np.array([1.0]), azimuths=2)
    power = np.abs(spectrum(beat(echo_grid(echoes, SENSOR), SENSOR), SENSOR)[0]) ** 2
    peak = int(np.argmax(power))
    assert peak == math.floor(range_m / SENSOR.bin_m)  # bin k spans k to k + 1 times bin_m
    # Between bins: a parabola through the logarithm finds the place to a hundredth of a bin.
    low, middle, high = np.log(power[peak - 1 : peak + 2])
    place = peak + 0.5 * (low - high) / (low - 2 * middle + high)
    assert (place + 0.5) * SENSOR.bin_m == pytest.approx(range_m, abs=0.02 * SENSOR.bin_m)


def test_range_lobe_has_the_widths_of_a_hann_window() -> None:
    echoes = point_echoes(row=np.zeros(1), range_m=np.array([80.0]), amplitude=np.array([1.0]), azimuths=2)
    power = np.abs(spectrum(beat(echo_grid(echoes, SENSOR), SENSOR), SENSOR)[0]) ** 2
    level_db = 10 * np.log10(np.maximum(power / power.max(), 1e-12))
    peak = int(np.argmax(power))
    half = np.interp(3.01, -level_db[peak : peak + 12], np.arange(12.0))
    # -3 dB width 1.44 cells of c / 2B (Harris 1978), to the bin's quantisation of the peak.
    assert 2 * half * SENSOR.bin_m / SENSOR.resolution_m == pytest.approx(1.44, rel=0.1)
    sidelobes = level_db[peak + 12 : peak + 60]
    assert sidelobes.max() == pytest.approx(-31.5, abs=0.7)  # Harris 1978, on a grid of bins


def test_sums_of_echoes_do_not_depend_on_their_order_beyond_rounding() -> None:
    echoes = random_echoes(200, 9, 20)
    order = np.random.default_rng(1).permutation(200)
    shuffled = point_echoes(
        row=echoes.row[order], range_m=echoes.range_m[order], amplitude=echoes.amplitude[order], azimuths=2
    )
    np.testing.assert_allclose(echo_grid(shuffled, SENSOR), echo_grid(echoes, SENSOR), atol=1e-6)


def test_grid_of_no_echoes_is_empty() -> None:
    none = point_echoes(row=np.zeros(0), range_m=np.zeros(0), amplitude=np.zeros(0), azimuths=2)
    assert not echo_grid(none, SENSOR).any()
