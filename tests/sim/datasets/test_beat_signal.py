"""The beat signal: integers and the size of their steps."""

import math
from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from numpy.testing import assert_allclose, assert_array_equal
from numpy.typing import NDArray

from echoscape.sim.datasets.beat_signal import BeatSignal, finely_sampled, sampled
from echoscape.sim.receiver.range_fft import codes_of_beat
from echoscape.sim.settings.artefacts import Artefacts
from tests.sim.receiver.received import QUIET, SENSOR, full_scale_w, kept, tones


def test_samples_are_the_converters_steps() -> None:
    beat = kept(*tones(30.0, 0.01 * full_scale_w()), Artefacts())
    assert beat.samples.shape == (30, SENSOR.samples)
    assert beat.samples.dtype == np.int16
    # 12 bits share the span of a full-scale sine; a tenth of its amplitude takes a tenth of 2048 steps.
    assert_allclose(beat.scale, 2 * math.sqrt(2 * full_scale_w()) / 2**12, rtol=1e-6)
    assert np.abs(beat.samples).max() == pytest.approx(204.8, abs=6 * 18)  # the noise has some 18 steps


def test_clipped_azimuths_end_at_full_scale() -> None:
    beat = kept(*tones(30.0, 100 * full_scale_w()), Artefacts(saturation=10))
    assert_array_equal(np.abs(beat.samples.astype(int)).max(axis=1), 2**11)


def test_strong_echo_without_clipping_doubles_the_scale_of_its_azimuths_until_it_fits() -> None:
    range_m, amplitude = tones(30.0, 0.01 * full_scale_w())
    amplitude[3] *= 10 * 100  # a hundred times full scale: 204800 steps, of which 16 bits hold an eighth
    beat = kept(range_m, amplitude, replace(QUIET, quantisation=True))
    expected = np.ones(30)
    expected[3] = 8
    assert_allclose(beat.scale / beat.scale[0], expected, rtol=0)
    assert np.abs(beat.samples[3].astype(int)).max() == pytest.approx(204_800 / 8, rel=0.02)


@settings(max_examples=60, deadline=None)
@given(seed=st.integers(0, 2**31), level_db=st.floats(-40, 160), step=st.floats(1e-12, 1e3))
def test_doubled_steps_are_the_finest_that_fit(seed: int, level_db: float, step: float) -> None:
    rng = np.random.default_rng(seed)
    signal = (step * 10 ** (level_db / 20) * rng.standard_normal((3, 16))).astype(np.float32)
    steps = np.full(3, step, np.float32)
    beat = sampled(signal, steps)
    doublings = np.log2(beat.scale / steps)
    assert_array_equal(doublings, np.rint(doublings))
    peak = np.abs(signal).max(axis=1)
    assert ((beat.scale == steps) | (peak / (beat.scale / 2) > 32767)).all()
    # Half a step, and what float32 can tell of a sample.
    error = np.abs(beat.amplitude().astype(np.float64) - signal)
    assert (error <= (0.5 + 0.005) * beat.scale[:, None]).all()


def test_sample_at_the_edge_of_16_bits_keeps_its_sign() -> None:
    signal = np.array([[32767.5, 0], [-32767.5, 0], [32767.4, 0], [65535.5, 0]], np.float32)
    beat = sampled(signal, np.ones(4, np.float32))
    assert_array_equal(beat.scale, [2, 2, 1, 4])
    assert_array_equal(np.sign(beat.samples[:, 0]), [1, -1, 1, 1])


def test_finest_samples_lie_98_db_below_their_sine() -> None:
    sine = np.sin(np.arange(200_000) * 0.1234567).astype(np.float32)[None] * np.float32(3e-7)
    beat = finely_sampled(sine)
    assert np.abs(beat.samples.astype(int)).max() == 32767
    error = beat.amplitude().astype(np.float64) - sine
    sqnr_db = 10 * math.log10(np.mean(sine.astype(np.float64) ** 2) / np.mean(error**2))
    assert sqnr_db == pytest.approx(6.02 * 16 + 1.76, abs=0.1)


def test_silence_has_a_scale_and_codes_of_zero() -> None:
    nothing = np.zeros((30, 0))
    beat = kept(nothing, nothing + 0j, QUIET)
    assert not beat.samples.any()
    assert (beat.scale > 0).all()
    assert not codes_of_beat(beat, SENSOR).any()


@pytest.mark.parametrize(
    ("samples", "scale", "message"),
    [
        (np.zeros((2, 8), np.int32), np.ones(2, np.float32), r"samples must be .* int16, got \(2, 8\) int32"),
        (np.zeros(8, np.int16), np.ones(8, np.float32), r"samples must be .* got \(8,\) int16"),
        (np.zeros((2, 8), np.int16), np.ones(3, np.float32), r"scale must be \(2,\) float32, got \(3,\)"),
        (np.zeros((2, 8), np.int16), np.ones(2), r"scale must be \(2,\) float32, got \(2,\) float64"),
        (np.zeros((2, 8), np.int16), np.array([1, np.nan], np.float32), "scale must be finite and above 0"),
        (np.zeros((2, 8), np.int16), np.array([1, 0], np.float32), "scale must be finite and above 0"),
    ],
)
def test_what_is_no_beat_signal_is_refused(samples: NDArray, scale: NDArray, message: str) -> None:
    with pytest.raises(ValueError, match=message):
        BeatSignal(samples=samples, scale=scale)
