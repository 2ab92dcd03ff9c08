"""Faults of a radar in service: what each does to a scan, by numbers computed apart from the code."""

import math
from dataclasses import fields, replace

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from numpy.testing import assert_allclose, assert_array_equal

from echoscape.sim.datasets.polar_scan import PolarScan
from echoscape.sim.effects.sensor_faults import (
    SensorFaults,
    arriving,
    faulty_scans,
    gain_step_scan,
    sector,
    with_faults,
)
from echoscape.sim.receiver.quantiser import codes, middle_power
from echoscape.sim.sensor.cts350x import CTS350X
from tests.sim.scans import START_US, drawn_scan

NOISE = CTS350X.noise_units
SCAN = drawn_scan()


def faulty(scan: PolarScan, name: str, strength: float, *, index: int = 0, seed: int = 5) -> PolarScan:
    """One fault of the given strength, in a drive of nine scans."""
    return with_faults(scan, SensorFaults(**{name: strength}), index=index, count=9, seed=seed)


def noise_scan() -> PolarScan:
    power = np.random.default_rng(2).exponential(NOISE, SCAN.codes.shape)
    return replace(SCAN, codes=codes(power), valid=np.ones(400, bool))


def test_no_fault_leaves_the_scan_alone() -> None:
    assert with_faults(SCAN, SensorFaults(), index=0, count=1, seed=0) is SCAN
    assert not SensorFaults().any


@pytest.mark.parametrize("name", [field.name for field in fields(SensorFaults)])
def test_truth_stays_and_draws_repeat(name: str) -> None:
    strength = {"clock_jitter": 0.02, "range_scale": 0.01, "jammed_sector": 1000.0}.get(name, 0.5)
    one, again = (faulty(SCAN, name, strength, index=8) for _ in range(2))
    assert one == again
    assert one.truth is SCAN.truth
    assert_array_equal(one.encoder, SCAN.encoder)


def test_share_of_scans_lost_is_the_strength_and_both_ends_arrive() -> None:
    faults = SensorFaults(dropped_scans=0.3)
    kept = arriving(faults, 4000, seed=1)
    assert kept[0]
    assert kept[-1]
    assert abs(np.mean(~kept) - 0.3) < 4 * math.sqrt(0.3 * 0.7 / 4000)
    assert_array_equal(arriving(faults, 1000, seed=1)[:-1], kept[:999])
    assert arriving(SensorFaults(dropped_scans=0.9), 2, seed=1).tolist() == [True, True]


def test_a_drive_loses_the_scans_that_do_not_arrive() -> None:
    drive = [replace(SCAN, timestamp_us=SCAN.timestamp_us + 250_000 * index) for index in range(12)]
    faults = SensorFaults(dropped_scans=0.5)
    found = [int(scan.timestamp_us[0] - START_US) // 250_000 for scan in faulty_scans(drive, faults, seed=3)]
    assert found == np.flatnonzero(arriving(faults, 12, seed=3)).tolist()
    assert 2 <= len(found) < 12


def test_blank_azimuths_hold_nothing_and_are_marked() -> None:
    scan = replace(SCAN, valid=np.ones(400, bool))
    lost = np.array([~faulty(scan, "blank_azimuths", 0.1, index=i).valid for i in range(20)])
    assert abs(lost.mean() - 0.1) < 4 * math.sqrt(0.1 * 0.9 / 8000)
    one = faulty(scan, "blank_azimuths", 0.1, index=3)
    assert not one.codes[~one.valid].any()
    assert_array_equal(one.codes[one.valid], scan.codes[one.valid])


def test_an_invalid_azimuth_stays_invalid() -> None:
    one = faulty(SCAN, "blank_azimuths", 0.1)
    assert not one.valid[~SCAN.valid].any()


def test_sectors_are_60_degrees_wide_and_stay_for_the_drive() -> None:
    for name in ("jammed_sector", "blocked_sector"):
        inside = sector(SCAN, name, seed=5)
        assert abs(int(inside.sum()) - 400 / 6) <= 1
        assert np.count_nonzero(np.diff(np.append(inside, inside[0]).astype(int)) == 1) == 1
        changed = [(faulty(SCAN, name, 30.0, index=i).codes != SCAN.codes).any(axis=1) for i in (0, 4)]
        assert_array_equal(changed[0], inside)
        assert_array_equal(changed[1], inside)
    places = [int(np.argmax(sector(SCAN, "jammed_sector", seed=seed))) for seed in range(6)]
    assert len(set(places)) == 6


def test_a_jammer_adds_its_power_to_that_of_the_noise() -> None:
    scan = noise_scan()
    jammed = faulty(scan, "jammed_sector", 1000.0)
    inside = sector(scan, "jammed_sector", seed=5)
    power = middle_power(jammed.codes[inside])
    # Exponential power: its mean is 1001 N, its level in dB deviates by 10 / ln 10 x pi / sqrt(6) = 5.57 dB.
    assert_allclose(power.mean(), 1001 * NOISE, rtol=0.02)
    assert_allclose(np.std(10 * np.log10(power)), 5.57, atol=0.1)
    again = faulty(scan, "jammed_sector", 1000.0, index=1)
    assert (again.codes[inside] != jammed.codes[inside]).mean() > 0.9


def test_dirt_weakens_echoes_by_its_loss_and_leaves_the_noise() -> None:
    scan = noise_scan()
    strong = replace(scan, codes=np.full_like(scan.codes, 120))
    inside = sector(scan, "blocked_sector", seed=5)
    assert_allclose(faulty(strong, "blocked_sector", 20.0).codes[inside], 80, atol=1)
    share = np.mean(faulty(scan, "blocked_sector", 20.0).codes[inside] == 0)
    assert_allclose(share, np.mean(scan.codes[inside] == 0), atol=0.01)


def test_gain_changes_the_level_from_a_scan_in_the_middle_third_on() -> None:
    strong = replace(SCAN, codes=np.full_like(SCAN.codes, 90))
    for seed in range(30):
        first = gain_step_scan(30, seed=seed)
        assert 10 <= first <= 20
        faults = SensorFaults(gain_step=-7.5)
        before, after = (
            with_faults(strong, faults, index=index, count=30, seed=seed) for index in (first - 1, first)
        )
        assert_array_equal(before.codes, 90)
        assert_allclose(after.codes, 75, atol=1)
    assert gain_step_scan(1, seed=0) == 1
    quiet = noise_scan()
    raised = faulty(quiet, "gain_step", 10.0, index=8)
    power = np.random.default_rng(3).exponential(10 * NOISE, quiet.codes.shape)
    for threshold in (20, 30, 40):
        assert_allclose(np.mean(raised.codes > threshold), np.mean(codes(power) > threshold), atol=0.02)


def test_range_error_moves_echoes_in_proportion_to_their_range() -> None:
    scan = replace(SCAN, codes=np.zeros_like(SCAN.codes))
    for at in (100, 1000, 3000):
        scan.codes[:, at] = 100
    moved = np.flatnonzero(faulty(scan, "range_scale", 0.01).codes[0])
    assert_allclose(moved + 0.5, 1.01 * (np.array([100, 1000, 3000]) + 0.5), atol=0.51)
    full = noise_scan()
    nearer = faulty(full, "range_scale", -0.1).codes
    assert_allclose(np.mean(nearer[:, -300:] == 0), np.mean(full.codes == 0), atol=0.02)


def test_clock_errors_have_their_deviation_keep_order_and_move_whole_scans() -> None:
    late_us = [
        int(faulty(SCAN, "clock_jitter", 0.04, index=i).timestamp_us[0]) - START_US for i in range(800)
    ]
    # The standard deviation of a normal draw that is cut off at 2.5 is 0.99 of that without the cut.
    assert_allclose(np.std(late_us), 40_000, rtol=0.1)
    assert max(np.abs(late_us)) <= 2.5 * 40_000
    one = faulty(SCAN, "clock_jitter", 0.04, index=4)
    assert_array_equal(np.diff(one.timestamp_us), np.diff(SCAN.timestamp_us))
    assert_array_equal(one.codes, SCAN.codes)


@given(st.sampled_from(["dropped_scans", "blank_azimuths", "clock_jitter"]), st.integers(0, 2**31))
def test_draws_of_a_fault_do_not_depend_on_other_faults(name: str, seed: int) -> None:
    small = replace(SCAN, codes=SCAN.codes[:, :16])
    strength = {"clock_jitter": 0.02}.get(name, 0.5)
    faults = SensorFaults(**{name: strength})
    both = replace(faults, range_scale=0.02)
    alone, beside = (with_faults(small, each, index=0, count=9, seed=seed) for each in (faults, both))
    assert_array_equal(alone.valid, beside.valid)
    assert_array_equal(alone.timestamp_us, beside.timestamp_us)


@pytest.mark.parametrize(
    ("name", "value", "message"),
    [
        ("dropped_scans", 1.0, "dropped_scans must be between 0 and 0.9, got 1"),
        ("clock_jitter", 0.1, "clock_jitter must be between 0 and 0.04, got 0.1"),
        ("range_scale", math.nan, "range_scale must be between -0.2 and 0.2, got nan"),
        ("gain_step", "loud", "gain_step must be a number, got 'loud'"),
        ("jammed_sector", True, "jammed_sector must be a number, got True"),
    ],
)
def test_what_is_no_strength_is_refused(name: str, value: float, message: str) -> None:
    with pytest.raises(ValueError, match=message):
        SensorFaults(**{name: value})


def test_negative_seeds_are_refused() -> None:
    with pytest.raises(ValueError, match="seed and index must be 0 or more, got -1 and 0"):
        faulty(SCAN, "clock_jitter", 0.01, seed=-1)
