"""Keypoints of Cen & Newman 2019: the loop of the paper's algorithm, and what they do not depend on."""

import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from echoscape.eval.methods.cen2019 import (
    Cen2019,
    Cen2019Settings,
    highest_cells,
    low_gradient_power,
    side_by_side,
    strongest,
)
from echoscape.eval.methods.runs import Runs
from echoscape.sim.datasets.scan_folder import open_folder
from tests.eval.methods.polar_scans import BIN_M, receiver_noise, scan_of_codes, with_echo
from tests.paths import SHARED

NOISE = receiver_noise(60, 800)


def by_the_loop(power: np.ndarray, count: int) -> list[tuple[int, int]]:
    """Algorithm 1 cell by cell, without its score: H is given by `low_gradient_power`."""
    scores, mean = low_gradient_power(power), power.mean()
    azimuths, bins = power.shape
    marked = np.zeros(power.shape, bool)
    regions: list[tuple[int, int, int]] = []
    for cell in np.argsort(-scores, axis=None):
        a, r = divmod(int(cell), bins)
        if len(regions) == count or power[a, r] <= mean:
            break
        if marked[a, r]:
            continue
        low, high = r, r
        while low > 0 and power[a, low - 1] > mean:
            low -= 1
        while high < bins - 1 and power[a, high + 1] > mean:
            high += 1
        marked[a, low : high + 1] = True
        regions.append((a, low, high))
    found = []
    for a, low, high in regions:
        if marked[a - 1, low : high + 1].any() or marked[(a + 1) % azimuths, low : high + 1].any():
            found.append((a, low + int(np.argmax(scores[a, low : high + 1]))))
    return sorted(found)


@given(st.integers(0, 2**32 - 1), st.integers(1, 60))
@settings(deadline=None, max_examples=40)
def test_keypoints_are_those_of_the_loop(seed: int, count: int) -> None:
    power = np.random.default_rng(seed).normal(size=(12, 30))
    scores = low_gradient_power(power)
    runs = side_by_side(strongest(Runs.of(power > power.mean()), scores, count))
    assert list(zip(runs.azimuth, runs.peaks(scores), strict=True)) == by_the_loop(power, count)


def test_the_score_is_the_power_above_the_mean_less_by_the_gradient() -> None:
    power = np.array([[0, 0, 4, 6, 0, 0, 2, 0], [4, 4, 4, 4, 0, 4, 0, 0]], float)
    # The mean is 2; differences of the neighbours are mirrored at the ends, the largest is 6.
    first = [-2 * (1 - 0 / 6), -2 * (1 - 4 / 6), 2 * (1 - 6 / 6), 4 * (1 - 4 / 6)]
    first += [-2 * (1 - 6 / 6), -2 * (1 - 2 / 6), 0, -2 * (1 - 0 / 6)]
    np.testing.assert_allclose(low_gradient_power(power)[0], first, atol=1e-12)
    assert not low_gradient_power(np.full((3, 5), 7)).any()


@given(st.integers(0, 59), st.integers(60, 760))
@settings(deadline=None, max_examples=20)
def test_a_point_target_is_found_at_its_range_and_azimuth(azimuth: int, centre: int) -> None:
    scan = scan_of_codes(with_echo(NOISE, azimuth, centre))
    found = Cen2019(Cen2019Settings(regions=3)).extract(scan)
    best = int(np.argmax(found.score))
    assert found.azimuth[best] == azimuth
    assert found.range_m[best] == pytest.approx((centre + 0.5) * BIN_M, abs=1e-9)
    assert sorted((found.azimuth - azimuth + 1) % 60) == [0, 1, 2]
    assert np.abs(found.bin - centre).max() <= 1


def test_an_echo_in_a_single_azimuth_gives_no_keypoint() -> None:
    codes = with_echo(NOISE, 20, 500)
    alone = codes.copy()
    alone[[19, 21]] = np.minimum(alone[[19, 21]], 45)
    extractor = Cen2019(Cen2019Settings(regions=3))
    assert 20 in extractor.extract(scan_of_codes(codes)).azimuth
    assert 20 not in extractor.extract(scan_of_codes(alone)).azimuth


def test_no_more_keypoints_than_stretches_are_marked() -> None:
    scan = scan_of_codes(NOISE)
    counts = [len(Cen2019(Cen2019Settings(regions=count)).extract(scan)) for count in (1, 50, 1000, 10**6)]
    assert counts == sorted(counts)
    assert counts[0] == 0  # alone it has no neighbour
    assert counts[1] <= 50 < counts[2] <= 1000 < counts[3]


@given(st.integers(1, 2), st.integers(0, 60))
@settings(deadline=None, max_examples=15)
def test_another_unit_or_zero_of_the_codes_scales_the_scores_only(scale: int, offset: int) -> None:
    codes = with_echo(np.rint(NOISE / 2), 7, 400, height=90)
    plain = Cen2019(Cen2019Settings(regions=200)).extract(scan_of_codes(codes))
    other = Cen2019(Cen2019Settings(regions=200)).extract(scan_of_codes(scale * codes + offset))
    assert len(plain) > 10
    np.testing.assert_array_equal(other.azimuth, plain.azimuth)
    np.testing.assert_array_equal(other.bin, plain.bin)
    np.testing.assert_allclose(other.score, scale * plain.score, rtol=1e-9)


@given(st.integers(1, 59), st.sampled_from([None, 500]))
@settings(deadline=None, max_examples=10)
def test_keypoints_rotate_with_the_scan(azimuths: int, cells: int | None) -> None:
    codes = with_echo(with_echo(NOISE, 0, 200), 40, 600)
    extractor = Cen2019(Cen2019Settings(regions=150, cells=cells))
    plain = extractor.extract(scan_of_codes(codes))
    rotated = extractor.extract(scan_of_codes(np.roll(codes, azimuths, axis=0)))
    moved = sorted(zip((plain.azimuth + azimuths) % 60, plain.bin, plain.score, strict=True))
    assert len(plain) > 10
    assert moved == list(zip(rotated.azimuth, rotated.bin, rotated.score, strict=True))


def test_nothing_nearer_than_the_nearest_range() -> None:
    codes = with_echo(NOISE, 10, 20)
    assert 20 in Cen2019(Cen2019Settings(near_m=0, regions=5)).extract(scan_of_codes(codes)).bin
    found = Cen2019(Cen2019Settings(regions=5)).extract(scan_of_codes(codes))
    assert (found.range_m >= 2.5).all()


def test_an_empty_scan_has_no_keypoints() -> None:
    for code in (0, 255):
        assert len(Cen2019().extract(scan_of_codes(np.full((8, 90), code)))) == 0


@given(st.integers(0, 2**32 - 1), st.integers(1, 200))
def test_so_many_cells_are_marked_without_ties(seed: int, count: int) -> None:
    scores = np.random.default_rng(seed).normal(size=(10, 15))
    marked = highest_cells(scores, count)
    assert marked.sum() == min(count, (scores > 0).sum())
    assert scores[marked].min(initial=np.inf) >= scores[~marked].max()


@pytest.mark.parametrize(
    ("name", "value"), [("regions", 0), ("cells", 0), ("near_m", -1.0), ("near_m", math.nan)]
)
def test_bad_settings_are_refused(name: str, value: float) -> None:
    with pytest.raises(ValueError, match=f"{name} must be"):
        Cen2019Settings(**{name: value})  # pyright: ignore[reportArgumentType]


def test_a_real_scan_has_as_many_as_the_public_implementation_finds() -> None:
    pair = SHARED / "real" / "oxford-pair"
    if not pair.is_dir():
        pytest.skip("needs real scans in shared/real/oxford-pair beside the checkout")
    scan = open_folder(pair).read(0)
    # The public implementation marks 10,000 cells, and finds 887 keypoints in this scan.
    assert len(Cen2019(Cen2019Settings(cells=10_000)).extract(scan)) == 887
    found = Cen2019().extract(scan)
    assert 900 < len(found) <= 1000
    assert (found.range_m < 25).mean() == pytest.approx(446 / 887, abs=0.05)
