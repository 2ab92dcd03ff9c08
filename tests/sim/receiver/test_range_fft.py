"""Processing a kept beat signal gives the scan's own codes, and what theory says of its spectrum."""

import math
from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from numpy.testing import assert_allclose, assert_array_equal
from scipy.signal import windows

from echoscape.sim.datasets.beat_signal import BeatSignal
from echoscape.sim.datasets.files.beat_npz import read_beat, write_beat
from echoscape.sim.receiver.quantiser import codes
from echoscape.sim.receiver.range_fft import codes_of_beat, range_spectrum
from echoscape.sim.settings.artefacts import Artefacts
from tests.sim.receiver.received import QUIET, RECEIVER, SENSOR, full_scale_w, kept, received, tones


@settings(max_examples=25, deadline=None)
@given(
    switches=st.tuples(*(st.booleans() for _ in RECEIVER)),
    seed=st.integers(0, 2**31),
    level_db=st.floats(-150, -50),
    count=st.integers(0, 40),
)
def test_kept_signal_gives_the_scans_own_codes(
    tmp_path_factory: pytest.TempPathFactory,
    switches: tuple[bool, ...],
    seed: int,
    level_db: float,
    count: int,
) -> None:
    artefacts = Artefacts(**dict(zip(RECEIVER, switches, strict=True)))
    rng = np.random.default_rng(seed)
    range_m = rng.uniform(0.1, SENSOR.range_m, (30, count))
    spread = 10 ** ((level_db + rng.uniform(-60, 0, (30, count))) / 20)
    amplitude = spread * np.exp(2j * math.pi * rng.random((30, count)))
    whole = received(range_m, amplitude, artefacts, seed=seed)
    assert whole.beat is not None
    assert_array_equal(codes_of_beat(whole.beat, SENSOR), codes(whole.power))
    path = tmp_path_factory.getbasetemp() / "beat.npz"
    write_beat(path, whole.beat)
    assert_array_equal(codes_of_beat(read_beat(path, sensor=SENSOR), SENSOR), codes(whole.power))
    unkept = received(range_m, amplitude, artefacts, seed=seed, keep_beat=False)
    assert unkept.beat is None
    assert_array_equal(unkept.power, whole.power)


@pytest.mark.parametrize("off", [(), *((name,) for name in RECEIVER), RECEIVER])
def test_kept_signal_gives_the_codes_with_any_artefact_off(off: tuple[str, ...]) -> None:
    range_m, amplitude = tones(30.0, 3 * full_scale_w())  # clipped where that is on
    whole = received(range_m, amplitude, Artefacts(**dict.fromkeys(off, False)))
    assert whole.beat is not None
    assert whole.saturated.any() == ("saturation" not in off)
    assert_array_equal(codes_of_beat(whole.beat, SENSOR), codes(whole.power))


@pytest.mark.parametrize("range_m", [5.0, 30.01, 77.7, 150.0])
def test_own_processing_finds_an_echo_at_its_range_with_its_power(range_m: float) -> None:
    power_w = 1e-11
    beat = kept(*tones(range_m, power_w), Artefacts())
    signal = beat.samples * beat.scale[:, None].astype(np.float64)
    window = np.blackman(signal.shape[1])
    spectrum = np.fft.rfft(signal * window, 8192)[:, 50:3768]  # beyond the leakage
    power = 2 * np.abs(spectrum) ** 2 / window.sum() ** 2
    assert_array_equal(50 + power.argmax(axis=1), np.floor(range_m / 0.0432))
    # The noise lies 30 dB below, the grid's scalloping within a bin is 0.02 dB.
    assert_allclose(power.max(axis=1).mean(), power_w, rtol=0.03)


def test_noise_has_its_power() -> None:
    nothing = np.zeros((30, 0))
    beat = kept(nothing, nothing + 0j, Artefacts(leakage=False))
    noise_w = 1.380649e-23 * 290 * 10 ** (SENSOR.noise_figure_db / 10) * SENSOR.sample_hz / 2
    assert np.mean(beat.amplitude().astype(np.float64) ** 2) == pytest.approx(noise_w, rel=0.03)


def test_phase_at_the_sweeps_middle_is_the_echos() -> None:
    cells, phase = np.array([200, 1000, 3000]), np.array([0.3, -2.0, 2.9])
    range_m, amplitude = (cells + 0.5) * SENSOR.bin_m, 1e-6 * np.exp(1j * phase)
    beat = kept(range_m[:, None], amplitude[:, None], QUIET)
    turned = np.exp(2j * math.pi * cells * (SENSOR.samples // 2) / SENSOR.fft_size)
    found = range_spectrum(beat, SENSOR)[np.arange(3), cells] * turned
    assert_allclose(np.angle(found), phase, atol=1e-3)


def test_other_window_gives_its_own_spectrum() -> None:
    beat = kept(*tones(60.0, 1e-10), Artefacts())
    found = range_spectrum(beat, replace(SENSOR, window="blackman"))
    signal = beat.samples * beat.scale[:, None].astype(np.float64)
    expected = np.fft.rfft(signal * windows.blackman(SENSOR.samples, sym=False), 8192)[:, :3768]
    assert_allclose(found, expected, atol=1e-5 * np.abs(expected).max())  # float32 transforms


def test_signal_of_another_sensor_is_refused() -> None:
    beat = BeatSignal(samples=np.zeros((30, 100), np.int16), scale=np.ones(30, np.float32))
    for process in (codes_of_beat, range_spectrum):
        with pytest.raises(ValueError, match=r"beat must have the 1500 samples of a sweep .* got 100"):
            process(beat, SENSOR)


def test_no_azimuths_give_no_codes() -> None:
    none = BeatSignal(samples=np.zeros((0, SENSOR.samples), np.int16), scale=np.zeros(0, np.float32))
    assert codes_of_beat(none, SENSOR).shape == (0, SENSOR.bins)
