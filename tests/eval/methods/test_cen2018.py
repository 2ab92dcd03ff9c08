"""Keypoints of Cen & Newman 2018: where they lie, how many noise has, and what they do not depend on."""

import math
from typing import cast

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.optimize import brentq
from scipy.stats import norm

from echoscape.eval.methods.cen2018 import Cen2018, Cen2018Settings, noise_deviation, signal_to_noise
from echoscape.sim.datasets.scan_folder import open_folder
from tests.eval.methods.polar_scans import BIN_M, receiver_noise, scan_of_codes, with_echo
from tests.paths import SHARED

NOISE = receiver_noise(60, 1500)


@given(st.integers(0, 59), st.integers(60, 1400))
@settings(deadline=None, max_examples=20)
def test_a_point_target_is_found_at_its_range_and_azimuth(azimuth: int, centre: int) -> None:
    found = Cen2018().extract(scan_of_codes(with_echo(NOISE, azimuth, centre)))
    best = int(np.argmax(found.score))
    assert found.azimuth[best] == azimuth
    assert found.range_m[best] == pytest.approx((centre + 0.5) * BIN_M, abs=1.01 * BIN_M)
    step_rad = 2 * math.pi / 60
    assert found.azimuth_rad[best] == pytest.approx(azimuth * step_rad)
    # The echo is three azimuths wide, and there is nothing else.
    assert set((found.azimuth - azimuth + 1) % 60) <= {0, 1, 2}
    assert np.abs(found.bin - centre).max() <= 1


def test_receiver_noise_has_no_keypoints() -> None:
    assert len(Cen2018().extract(scan_of_codes(receiver_noise(400, 3768, seed=1)))) == 0


@pytest.mark.parametrize(("threshold", "factor"), [(2.0, 1.0), (3.0, 1.0), (2.5, math.sqrt(2))])
def test_gaussian_noise_exceeds_the_threshold_at_the_designed_rate(threshold: float, factor: float) -> None:
    cells, smoothing = (400, 4000), 17.0
    power = np.random.default_rng(2).normal(50, 8, size=cells)
    level = signal_to_noise(power, smoothing_bins=smoothing, noise_factor=factor)
    # v (1 - exp(-v^2 / 2)) of the high-pass part, whose variance is 1 - 2 g(0) + (g * g)(0) of the noise's.
    least = cast(float, brentq(lambda v: v * -math.expm1(-(v**2) / 2) - threshold, 0.1, 9))
    kept = 1 - 2 / (smoothing * math.sqrt(2 * math.pi)) + 1 / (2 * smoothing * math.sqrt(math.pi))
    expected = math.prod(cells) * float(norm.sf(factor * least / math.sqrt(kept)))
    # 4 standard deviations of a count, and 3 % for the low-pass part, which is left out here.
    assert (level > threshold).sum() == pytest.approx(expected, abs=4 * math.sqrt(expected) + 0.03 * expected)


def test_the_deviation_of_symmetric_noise_comes_from_its_lower_half() -> None:
    noise = np.random.default_rng(3).normal(0, [[2.0], [7.0]], size=(2, 200_000))
    # The standard error is 1 / sqrt(2 x 100,000) = 0.22 %.
    np.testing.assert_allclose(noise_deviation(noise), [2.0, 7.0], rtol=0.009)
    above = np.abs(noise)
    assert noise_deviation(above).tolist() == [0.0, 0.0]


@given(st.integers(1, 2), st.integers(0, 60))
@settings(deadline=None, max_examples=15)
def test_another_unit_or_zero_of_the_codes_changes_nothing(scale: int, offset: int) -> None:
    codes = with_echo(np.rint(NOISE / 2), 7, 400, height=90)
    plain = Cen2018().extract(scan_of_codes(codes))
    other = Cen2018().extract(scan_of_codes(scale * codes + offset))
    assert len(plain) > 0
    np.testing.assert_array_equal(other.azimuth, plain.azimuth)
    np.testing.assert_array_equal(other.bin, plain.bin)
    np.testing.assert_allclose(other.score, plain.score, rtol=1e-9)


@given(st.integers(1, 59))
@settings(deadline=None, max_examples=10)
def test_keypoints_rotate_with_the_scan(azimuths: int) -> None:
    codes = with_echo(with_echo(NOISE, 0, 200), 40, 900)
    plain = Cen2018().extract(scan_of_codes(codes))
    rotated = Cen2018().extract(scan_of_codes(np.roll(codes, azimuths, axis=0)))
    moved = sorted(zip((plain.azimuth + azimuths) % 60, plain.bin, plain.score, strict=True))
    assert moved == list(zip(rotated.azimuth, rotated.bin, rotated.score, strict=True))


@pytest.mark.parametrize("place", [slice(500, 900), slice(1100, 1500)])
def test_a_wide_echo_keeps_its_height_up_to_the_end_of_the_scan(place: slice) -> None:
    # Far from its edges the low-pass holds all of it, and the alternating rest is odd: it cancels in pairs.
    power = np.tile([-1.0, 1.0], (1, 750))
    power[:, place] += 60
    unbiased = power - power.mean()
    sigma = math.sqrt((unbiased[unbiased < 0] ** 2).mean())
    level = signal_to_noise(power, smoothing_bins=10, noise_factor=1)[0, place]
    inner = level[100:] if place.stop == 1500 else level[100:-100]
    height = (60 - 60 * 400 / 1500) / sigma
    expected = height * -math.expm1(-(height**2) / 2)
    np.testing.assert_allclose(inner.reshape(-1, 2).mean(axis=1), expected, rtol=1e-6)


def test_azimuths_of_one_code_have_neither_keypoints_nor_warnings() -> None:
    codes = with_echo(NOISE, 7, 400)
    codes[20:30] = 90
    scores = Cen2018().scores(scan_of_codes(codes))
    assert not scores[20:30].any()
    assert np.isfinite(scores).all()


def test_nothing_nearer_than_the_nearest_range() -> None:
    codes = with_echo(with_echo(NOISE, 10, 20), 30, 60)
    near = Cen2018(Cen2018Settings(near_m=0)).extract(scan_of_codes(codes))
    far = Cen2018().extract(scan_of_codes(codes))
    assert 20 in near.bin
    assert 10 not in far.azimuth
    assert (far.range_m >= 2.5).all()
    assert 60 in far.bin


def test_scores_are_the_highest_of_the_run() -> None:
    scan = scan_of_codes(with_echo(NOISE, 7, 400))
    found, scores = Cen2018().extract(scan), Cen2018().scores(scan)
    best = int(np.argmax(found.score))
    assert found.score[best] == scores.max()
    assert (found.score > 3).all()


@pytest.mark.parametrize(
    ("name", "value"),
    [
        ("threshold", 0.0),
        ("threshold", 32.0),
        ("threshold", math.nan),
        ("noise_factor", -1.0),
        ("smoothing_m", 0.0),
        ("smoothing_m", math.nan),
        ("near_m", -0.1),
        ("near_m", math.inf),
    ],
)
def test_bad_settings_are_refused(name: str, value: float) -> None:
    with pytest.raises(ValueError, match=f"{name} must be (finite and|above 0)"):
        Cen2018Settings(**{name: value})


def test_a_real_scan_has_as_many_as_the_public_implementation_finds() -> None:
    pair = SHARED / "real" / "oxford-pair"
    if not pair.is_dir():
        pytest.skip("needs real scans in shared/real/oxford-pair beside the checkout")
    found = Cen2018().extract(open_folder(pair).read(0))
    # The public implementation, run on the same scan: 1662, of which 1016 within 25 m and 15 beyond 100 m.
    # It cuts the low-pass off at 1.5 standard deviations.
    assert len(found) == pytest.approx(1662, rel=0.02)
    assert (found.range_m < 25).sum() == pytest.approx(1016, rel=0.02)
    assert (found.range_m > 100).sum() == pytest.approx(15, abs=3)
