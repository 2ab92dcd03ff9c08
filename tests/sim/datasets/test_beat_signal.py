"""The beat signal: its integers and their scale, and that processing it gives the scan's own bytes."""

import math
from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from numpy.testing import assert_allclose, assert_array_equal
from numpy.typing import NDArray
from scipy.signal import windows

from echoscape.sim.datasets.beat_signal import BeatSignal, finely_sampled, sampled
from echoscape.sim.datasets.files.beat_npz import read_beat, write_beat
from echoscape.sim.echoes import point_echoes
from echoscape.sim.receiver.if_signal import echo_grid
from echoscape.sim.receiver.quantiser import codes
from echoscape.sim.receiver.range_fft import codes_of_beat, range_spectrum
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
    """An echo of `power_w` at the same range in every row."""
    shape = (SENSOR.azimuths, 1)
    return np.full(shape, range_m), np.full(shape, math.sqrt(power_w) + 0j)


def full_scale_w() -> float:
    """The power of a sine that fills the converter: it is written `full_scale_db` above one unit."""
    hann = windows.hann(SENSOR.samples, sym=False)
    units_per_w = hann.sum() ** 2 / 2 * SENSOR.noise_units / (SENSOR.thermal_noise_w * (hann**2).sum())
    return 10 ** (SENSOR.full_scale_db / 10) / units_per_w


# ---------------------------------------------------------------------- integers and their scale


def test_samples_are_the_converters_steps() -> None:
    beat = kept(*tones(30.0, 0.01 * full_scale_w()), Artefacts())
    assert beat.samples.shape == (30, SENSOR.samples)
    assert beat.samples.dtype == np.int16
    # 12 bits share the span of a full-scale sine; a tenth of its amplitude takes a tenth of 2048 steps.
    assert_allclose(beat.scale, 2 * math.sqrt(2 * full_scale_w()) / 2**12, rtol=1e-6)
    assert np.abs(beat.samples).max() == pytest.approx(204.8, abs=6 * 18)  # the noise has some 18 steps


def test_clipped_rows_end_at_full_scale() -> None:
    beat = kept(*tones(30.0, 100 * full_scale_w()), Artefacts())
    assert_array_equal(np.abs(beat.samples.astype(int)).max(axis=1), 2**11)


def test_strong_echo_without_clipping_doubles_the_scale_of_its_rows_until_it_fits() -> None:
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


# ---------------------------------------------------------------------- processing


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


def test_no_rows_give_no_codes() -> None:
    none = BeatSignal(samples=np.zeros((0, SENSOR.samples), np.int16), scale=np.zeros(0, np.float32))
    assert codes_of_beat(none, SENSOR).shape == (0, SENSOR.bins)
