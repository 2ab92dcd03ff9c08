"""Statistics find the laws that were planted: noise, point spread, peaks, spokes, levels, ranks."""

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from echoscape.eval.fidelity import point_spread as spread
from echoscape.eval.fidelity import scan_statistics as stats
from echoscape.sim.receiver import quantiser

BIN_M = 0.0432
BINS = 3768
RANGE_M = (np.arange(BINS) + 0.5) * BIN_M


def _noise(rng: np.random.Generator, mean: float, shape: tuple[int, int]) -> np.ndarray:
    return quantiser.codes(np.rint(rng.exponential(mean, shape)))


def _dark(azimuths: int = 40) -> np.ndarray:
    return np.zeros((azimuths, BINS), np.uint8)


# ---------------------------------------------------------------------- noise


def test_exponential_noise_has_the_shares_that_its_law_gives() -> None:
    # rounded to n: P(n) = exp(-(n - 1/2) / m) - exp(-(n + 1/2) / m); 0 and 1 are written as 0, 2 as 6, 3 as 9
    codes = _noise(np.random.default_rng(1), 1.6, (400, BINS))
    share = stats.range_histograms(codes, RANGE_M).sum(axis=0) / codes.size
    expected = {0: 1 - math.exp(-1.5 / 1.6), **dict.fromkeys((6, 9, 12), 0.0)}
    for code, count in ((6, 2), (9, 3), (12, 4)):
        expected[code] = math.exp(-(count - 0.5) / 1.6) - math.exp(-(count + 0.5) / 1.6)
    for code, probability in expected.items():
        assert share[code] == pytest.approx(probability, abs=5 * math.sqrt(probability / codes.size))


def test_noise_mean_follows_from_cells_of_code_zero() -> None:
    codes = _noise(np.random.default_rng(2), 1.6, (400, BINS))
    assert stats.noise_mean(float((codes == 0).mean())) == pytest.approx(1.6, rel=0.01)
    assert math.isnan(stats.noise_mean(1.0))


def test_noise_region_is_the_quiet_tenth_of_the_azimuths_in_the_last_quarter() -> None:
    codes = _noise(np.random.default_rng(3), 20.0, (400, BINS))
    codes[100:140] = _noise(np.random.default_rng(4), 1.6, (40, BINS))
    quiet, far = stats.noise_region(codes, RANGE_M)
    assert np.flatnonzero(quiet).tolist() == list(range(100, 140))
    assert far.sum() == pytest.approx(BINS / 4, abs=1)
    assert far[-1]


def test_autocorrelation_of_smoothed_noise_is_that_of_its_window() -> None:
    # complex noise through a boxcar of 8 bins: the field correlates as a triangle, the power as its square
    rng = np.random.default_rng(5)
    field = rng.normal(size=(200, 4000)) + 1j * rng.normal(size=(200, 4000))
    window = np.ones(8)
    smooth = np.array([np.convolve(azimuth, window, "valid") for azimuth in field])
    found = stats.range_correlation(np.abs(smooth) ** 2)
    expected = np.maximum(1 - np.arange(stats.LAGS + 1) / 8, 0) ** 2
    np.testing.assert_allclose(found, expected, atol=0.02)


def test_azimuths_and_scans_of_noise_correlate_as_much_as_they_share() -> None:
    rng = np.random.default_rng(6)
    shared = rng.exponential(1.0, (1, 5000))
    power = shared + rng.exponential(1.0, (6, 5000))  # equal variances: coefficient 1/2
    quiet = np.array([True, True, True, False, True, True])
    assert stats.azimuth_correlation(power, quiet) == pytest.approx(0.5, abs=0.05)
    assert stats.azimuth_correlation(rng.exponential(1.0, (6, 5000)), quiet) == pytest.approx(0.0, abs=0.05)
    assert math.isnan(stats.azimuth_correlation(power, np.array([True, False] * 3)))


# ---------------------------------------------------------------------- levels


@given(st.lists(st.integers(0, 254), min_size=1, max_size=200), st.sampled_from([0.1, 0.5, 0.9]))
def test_histogram_gives_the_statistics_of_its_cells(cells: list[int], share: float) -> None:
    histogram = np.bincount(cells, minlength=256)
    mean, deviation = stats.moments(histogram)
    assert mean == pytest.approx(np.mean(cells))
    assert deviation == pytest.approx(np.std(cells), abs=1e-6)
    assert stats.quantile(histogram, share) == np.quantile(cells, share, method="inverted_cdf")
    assert stats.exceedance(histogram)[100] == pytest.approx(np.mean(np.array(cells) >= 100))


def test_codes_stand_for_the_powers_that_make_them() -> None:
    power = np.array([2, 3, 100, 5000, 10**6])
    np.testing.assert_allclose(
        stats.CODE_POWER[quantiser.codes(power)], power, rtol=0.13
    )  # half a step of 1 dB
    assert stats.CODE_POWER[0] == 0.5
    assert np.flatnonzero(~stats.VALID_CODES[:18]).tolist() == [1, 2, 3, 4, 5, 7, 8, 10, 11, 13, 16]


def test_bands_hold_the_cells_of_their_ranges() -> None:
    codes = _dark(2)
    codes[:, (RANGE_M >= 10) & (RANGE_M < 12.5)] = 60
    bands = stats.range_histograms(codes, RANGE_M)
    assert np.flatnonzero(bands[:, 60]).tolist() == [4]
    assert bands.sum() == codes.size


def test_lower_envelope_band_has_the_mean_power() -> None:
    codes = _noise(np.random.default_rng(7), 30.0, (20, BINS))
    powers = stats.band_powers(codes, RANGE_M)
    assert powers[:, 5].mean() == pytest.approx(30.0, rel=0.03)
    assert np.isnan(stats.band_powers(codes[:, :1000], RANGE_M[:1000])[:, -1]).all()


def test_ranks_are_those_beyond_the_leakage() -> None:
    codes = _dark(3)
    codes[:, :40] = 120  # within 1.8 m
    codes[:, 1000:1004] = [90, 80, 70, 60]
    ranks = stats.strongest(codes, RANGE_M, np.array([1, 3, 400]))
    assert [stats.quantile(counts, 0.5) for counts in ranks] == [90, 70, 0]


def test_spokes_are_azimuths_whose_far_half_is_bright() -> None:
    codes = _dark(10)
    codes[2:5, 1300:] = 15
    codes[7, :1300] = 90
    assert np.flatnonzero(stats.spoke_azimuths(stats.far_medians(codes, RANGE_M))).tolist() == [2, 3, 4]
    assert np.isnan(stats.far_medians(codes[:, :100], RANGE_M[:100])).all()


# ---------------------------------------------------------------------- peaks


def test_planted_maxima_are_counted() -> None:
    codes = _dark()
    columns = np.arange(200, 3700, 50)
    codes[::10, columns] = np.arange(58, 58 + len(columns))
    codes[::10, columns + 7] = 57  # below the least level
    codes[5, 60] = 99  # within 4 m
    assert stats.local_maxima(codes, RANGE_M) == 4 * len(columns)
    codes[::10, columns + 3] = 57 + np.arange(len(columns))  # in the shade of the others
    assert stats.local_maxima(codes, RANGE_M) == 4 * len(columns)


def test_planted_strong_peaks_are_counted_across_the_seam() -> None:
    codes = _dark(400)
    codes[::20, 1000] = 85
    codes[::20, 3000] = 85  # beyond 100 m
    codes[399, 1005] = 84  # beside the peak of azimuth 0
    assert stats.strong_peaks(codes, RANGE_M) == 20


def _planted(range_db_per_bin2: float, azimuth_db_per_row2: float) -> tuple[np.ndarray, np.ndarray]:
    """Gaussian peaks of 60 dB in darkness, apart from each other; their azimuths and columns."""
    level = np.full((400, BINS), -np.inf)
    azimuths, columns = np.arange(20, 400, 40), np.arange(300, 3600, 300)
    for azimuth in azimuths:
        for column in columns:
            d_row, d_column = np.mgrid[-15:16, -100:101]
            shape = 60 - range_db_per_bin2 * d_column**2 - azimuth_db_per_row2 * d_row**2
            level[azimuth - 15 : azimuth + 16, column - 100 : column + 101] = shape
    peaks = np.array([(azimuth, column) for azimuth in azimuths for column in columns])
    return np.clip(np.rint(2 * level), 0, 254).astype(np.uint8), peaks


@given(st.floats(0.02, 0.4), st.floats(1.0, 4.0))
def test_widths_of_gaussian_peaks_are_theirs(per_bin2: float, per_row2: float) -> None:
    # in decibels a Gaussian is a parabola: it falls by L at an offset of sqrt(L / curvature)
    offsets = np.arange(-60, 61)
    along = np.rint(-2 * per_bin2 * offsets[None] ** 2) / 2
    for level in (6.0, 10.0, 20.0):
        expected = 2 * math.sqrt(level / per_bin2)
        found = spread.median_width(along.astype(np.float32), level)
        # half a code, and a chord instead of the parabola, at the slope of the crossing
        slope = 2 * math.sqrt(level * per_bin2)
        assert found == pytest.approx(expected, abs=2 * (0.25 + per_bin2) / slope + 1e-6)


def test_isolated_peaks_are_found_with_their_widths() -> None:
    codes, planted = _planted(0.3, 1.0)
    peaks = spread.isolated_peaks(codes, RANGE_M, BIN_M)
    np.testing.assert_array_equal(peaks, planted)
    along, across = spread.profiles(codes, peaks, BIN_M)
    assert spread.median_width(along, 20.0) == pytest.approx(2 * math.sqrt(20 / 0.3), abs=0.15)
    assert spread.median_width(across, 9.0) == pytest.approx(6.0, abs=0.1)
    assert spread.level_at(spread.median_profile(along), 5) == pytest.approx(-7.5, abs=0.25)
    assert math.isnan(spread.level_at(spread.median_profile(along), 61))
    assert math.isnan(spread.median_width(along[:0], 3.0))


def test_peaks_beside_stronger_ones_are_not_isolated() -> None:
    codes = _dark(400)
    codes[50, 1000], codes[55, 1040] = 100, 90  # within 8 azimuths and 60 bins
    codes[50, 1200] = 90
    codes[200, 1000], codes[200, 20] = 79, 100  # too weak; within 2.5 m
    assert spread.isolated_peaks(codes, RANGE_M, BIN_M).tolist() == [[50, 1000], [50, 1200]]
