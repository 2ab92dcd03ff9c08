import math
from dataclasses import replace

import numpy as np
from hypothesis import given, settings
from hypothesis import strategies as st

from echoscape.sim.echoes import Echoes, point_echoes
from echoscape.sim.receiver.if_signal import (
    analytic_beat,
    beat,
    beat_reference,
    echo_grid,
    spectrum,
    sweep_ripple,
)
from echoscape.sim.sensor.cts350x import CTS350X

SENSOR = replace(CTS350X, azimuths=2)


def random_echoes(count: int, seed: int, spread_db: float) -> Echoes:
    rng = np.random.default_rng(seed)
    size = 10 ** (rng.uniform(-spread_db, 0, count) / 20)
    return point_echoes(
        azimuth=rng.integers(0, 2, count),
        range_m=rng.uniform(0.11, SENSOR.range_m, count),
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
    assert 20 * math.log10(np.abs(found - expected).max() / expected.max() + 1e-12) < -55


@settings(max_examples=25, deadline=None)
@given(count=st.integers(0, 300), seed=st.integers(0, 2**31))
def test_grid_has_every_echo_in_four_cells_with_the_weights_of_a_cubic_b_spline(
    count: int, seed: int
) -> None:
    echoes = random_echoes(count, seed, 60)
    centre_m = (np.arange(SENSOR.fft_size // 4) * 2 + 0.5) * SENSOR.bin_m
    expected = np.zeros((2, len(centre_m)), np.complex128)
    for azimuth, range_m, amplitude in zip(echoes.azimuth, echoes.range_m, echoes.amplitude, strict=True):
        away = np.abs(centre_m - range_m) / (2 * SENSOR.bin_m)
        spline = (np.maximum(2 - away, 0) ** 3 - 4 * np.maximum(1 - away, 0) ** 3) / 6
        expected[azimuth] += spline * complex(amplitude)
    np.testing.assert_allclose(echo_grid(echoes, SENSOR), expected, atol=1e-5)


def test_echoes_at_both_ends_of_the_grid_are_clamped_to_it() -> None:
    ranges = np.array([0.0, 2.5 * SENSOR.bin_m, 1e3])
    echoes = point_echoes(azimuth=np.zeros(3), range_m=ranges, amplitude=np.array([1, 1, 2j]), azimuths=1)
    grid = echo_grid(echoes, replace(SENSOR, azimuths=1))[0]
    np.testing.assert_allclose(grid[:3], [1 / 3, 4 / 3, 1 / 3], atol=1e-6)  # both centred on the second cell
    np.testing.assert_allclose(grid[3:].sum(), 2j, atol=1e-6)
    np.testing.assert_allclose(grid[-4:].sum(), 2j, atol=1e-6)


def test_analytic_beat_has_the_beat_as_its_real_part() -> None:
    echoes = random_echoes(30, 3, 40)
    signal = beat_reference(echoes, SENSOR)
    analytic = analytic_beat(echo_grid(echoes, SENSOR), SENSOR, count=SENSOR.samples)
    middle = signal / sweep_ripple(SENSOR)
    inside = slice(
        40, -40
    )  # at the sweep's very ends the grid's aliases reach -40 dB, under the window's zero
    assert np.abs(analytic.real - middle)[:, inside].max() < 0.01 * np.abs(middle).max()


def test_sums_of_echoes_do_not_depend_on_their_order_beyond_rounding() -> None:
    echoes = random_echoes(200, 9, 20)
    order = np.random.default_rng(1).permutation(200)
    shuffled = point_echoes(
        azimuth=echoes.azimuth[order],
        range_m=echoes.range_m[order],
        amplitude=echoes.amplitude[order],
        azimuths=2,
    )
    np.testing.assert_allclose(echo_grid(shuffled, SENSOR), echo_grid(echoes, SENSOR), atol=1e-6)


def test_grid_of_no_echoes_is_empty() -> None:
    none = point_echoes(azimuth=np.zeros(0), range_m=np.zeros(0), amplitude=np.zeros(0), azimuths=2)
    assert not echo_grid(none, SENSOR).any()
