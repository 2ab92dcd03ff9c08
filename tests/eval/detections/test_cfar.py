import math
from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from numpy.testing import assert_allclose, assert_array_equal
from numpy.typing import NDArray

from echoscape.eval.detections.cfar import (
    Cfar,
    CfarSettings,
    OrderedCfarSettings,
    averaging_factor,
    noise_correlation,
    ordered_factor,
    ordered_false_alarm_rate,
)
from echoscape.sim.receiver.quantiser import codes
from echoscape.sim.sensor.cts350x import CTS350X
from echoscape.sim.sensor.cts_small import CTS_SMALL
from echoscape.sim.sensor.link_budget import window
from echoscape.sim.sensor.sensor import Sensor
from tests.eval.detections.made_scans import made_scan, map_of

KINDS = [CfarSettings, OrderedCfarSettings]


def received_noise(rows: int, seed: int, sensor: Sensor = CTS350X) -> NDArray[np.float64]:
    """Powers (rows, bins) of white noise through the sensor's window and zero-padded transform."""
    sweep = np.random.default_rng(seed).normal(size=(rows, sensor.samples)) * window(sensor)
    power = np.abs(np.fft.rfft(sweep, sensor.fft_size, axis=1)[:, -1 - sensor.bins : -1]) ** 2
    return power * (sensor.noise_units / power.mean())


def rate(detector: Cfar, power: NDArray[np.float64]) -> float:
    noise, factor = detector.noise(power)
    return float((power > factor * noise).mean())


@pytest.mark.parametrize("kind", KINDS)
def test_false_alarm_rate_on_exponential_noise_is_the_designed_one(kind: type[CfarSettings]) -> None:
    detector = Cfar(kind(false_alarm_rate=1e-3, guard_m=0.3, training_m=1.2), bin_m=0.1)
    power = np.random.default_rng(11).exponential(3.0, (2000, 1000))
    # 2,000 false alarms are expected: one standard deviation is 2.2 %, if shared windows add nothing.
    assert rate(detector, power) == pytest.approx(1e-3, rel=0.08)


@pytest.mark.parametrize("kind", KINDS)
def test_false_alarm_rate_holds_where_bins_are_correlated(kind: type[CfarSettings]) -> None:
    settings = kind(false_alarm_rate=1e-3)
    detector = Cfar(settings, bin_m=CTS350X.bin_m, correlation=noise_correlation(CTS350X))
    power = received_noise(500, seed=2)
    # An exceedance lasts some 5 bins: of 1,884 a fifth are independent, a standard deviation of 5 %.
    assert rate(detector, power) == pytest.approx(1e-3, rel=0.15)


def test_taking_correlated_bins_for_independent_ones_raises_the_rate() -> None:
    settings = CfarSettings(false_alarm_rate=1e-3, training_m=2.0)
    power = received_noise(500, seed=3)
    naive = rate(Cfar(settings, bin_m=CTS350X.bin_m), power)
    known = rate(Cfar(settings, bin_m=CTS350X.bin_m, correlation=noise_correlation(CTS350X)), power)
    assert naive > 1.5 * known


@pytest.mark.parametrize("kind", KINDS)
def test_false_alarm_rate_at_the_ends_of_a_scan_is_the_designed_one(kind: type[CfarSettings]) -> None:
    detector = Cfar(kind(false_alarm_rate=1e-2, guard_m=0.3, training_m=1.2), bin_m=0.1)
    power = np.random.default_rng(7).exponential(1.0, (10_000, 60))
    noise, factor = detector.noise(power)
    exceeds = power > factor * noise
    for end in (exceeds[:, :10], exceeds[:, -10:]):  # 1,000 are expected; cells of a row share their windows
        assert end.mean() == pytest.approx(1e-2, rel=0.15)


@pytest.mark.parametrize("kind", KINDS)
@pytest.mark.parametrize(
    ("sensor", "rows", "least", "most"), [(CTS350X, 200, 0.5, 1.1), (CTS_SMALL, 2000, 0.08, 0.35)]
)
def test_codes_of_noise_exceed_at_most_as_often_as_designed(
    sensor: Sensor, rows: int, least: float, most: float, kind: type[CfarSettings]
) -> None:
    settings = kind(false_alarm_rate=1e-3, peaks=False)
    detector = Cfar(settings, bin_m=sensor.bin_m, correlation=noise_correlation(sensor))
    scan = replace(made_scan(codes(received_noise(rows, 4, sensor))), bin_m=sensor.bin_m)
    found = len(detector.detect(scan).detections) / scan.codes.size
    # The quantiser leaves few levels at the noise: thresholds fall between them.
    assert least * 1e-3 < found < most * 1e-3


def test_correlation_of_noise_is_that_of_simulated_noise() -> None:
    power = received_noise(400, seed=5)
    expected = noise_correlation(CTS350X)
    centred = power - power.mean()
    measured = [
        (centred[:, : -lag or None] * centred[:, lag:]).mean() / centred.var() for lag in range(len(expected))
    ]
    assert_allclose(measured, expected, atol=0.02)


def test_averaging_factor_has_its_limits() -> None:
    # One cell: P = 1 / (1 + T). Many: the noise is known, and P = exp(-T).
    assert averaging_factor(1, 1e-3) == pytest.approx(999.0)
    assert averaging_factor(1e9, 1e-3) == pytest.approx(-math.log(1e-3), rel=1e-6)


def test_ordered_factor_is_that_of_the_textbook() -> None:
    # Richards, Fundamentals of Radar Signal Processing, section 6.5: N = 20, k = 15, 6.857 for 1e-3.
    assert ordered_factor(1e-3, cells=20, rank=15) == pytest.approx(6.857, abs=0.005)


@given(cells=st.integers(1, 60), share=st.floats(0.01, 1.0), exponent=st.floats(-8, -0.1))
def test_ordered_factor_inverts_its_rate(cells: int, share: float, exponent: float) -> None:
    rank = max(1, round(share * cells))
    factor = ordered_factor(10**exponent, cells=cells, rank=rank)
    assert ordered_false_alarm_rate(factor, cells=cells, rank=rank) == pytest.approx(10**exponent, rel=1e-6)


@given(gain=st.floats(1e-3, 1e6), kind=st.sampled_from(KINDS))
@settings(max_examples=20, deadline=None)
def test_gain_changes_no_decision(gain: float, kind: type[CfarSettings]) -> None:
    detector = Cfar(kind(training_m=2.0, false_alarm_rate=0.01), bin_m=0.1)
    power = np.random.default_rng(1).exponential(1.0, (4, 120))
    noise, factor = detector.noise(power)
    louder, _ = detector.noise(gain * power)
    assert_allclose(louder, gain * noise, rtol=1e-9)
    assert (factor > 0).all()


@pytest.mark.parametrize(("kind", "noise"), [(CfarSettings, 3.76), (OrderedCfarSettings, 4.01)])
def test_a_target_is_detected_once_at_its_peak_with_its_level_above_the_noise(
    kind: type[CfarSettings], noise: float
) -> None:
    # Four counts everywhere: powers from 3.26 to 4.26, 3.76 on average, three quarters of them below 4.01.
    image = np.full((6, 300), 12)
    image[3, 148:153] = [60, 72, 80, 72, 60]
    found = Cfar(kind(), bin_m=0.1).detect(made_scan(image)).detections
    assert found.azimuth.tolist() == [3]
    assert_allclose(found.range_m, [15.05])
    # Code 80 = 6 (13 + 1/3) is that of 2^13 (1 + 1/3) counts.
    assert found.score[0] == pytest.approx(10 * math.log10(2**13 * 4 / 3 / noise), abs=0.01)
    every = Cfar(kind(peaks=False), bin_m=0.1).detect(made_scan(image))
    assert every.detections.range_m.tolist() == pytest.approx([14.85, 14.95, 15.05, 15.15, 15.25])
    assert len(map_of(every)) == image.size


def test_a_strong_neighbour_masks_a_target_from_averages_but_not_from_order_statistics() -> None:
    image = np.full((6, 300), 12)
    image[3, 150], image[3, 180:184] = 45, 110
    places = [
        Cfar(kind(training_m=5.0), bin_m=0.1).detect(made_scan(image)).detections.range_m for kind in KINDS
    ]
    assert [15.05 in np.round(each, 6) for each in places] == [False, True]


def test_of_equal_neighbours_the_nearest_is_the_peak() -> None:
    image = np.full((4, 300), 12)
    image[1, 150:153] = 90
    found = Cfar(CfarSettings(), bin_m=0.1).detect(made_scan(image)).detections
    assert_allclose(found.range_m, [15.05])


@pytest.mark.parametrize(
    ("given", "message"),
    [
        ({"false_alarm_rate": 0.0}, "false_alarm_rate must be above 0 and below 1, got 0.0"),
        ({"false_alarm_rate": math.nan}, "false_alarm_rate must be above 0"),
        ({"guard_m": -1.0}, "guard_m must be finite and 0 or more, got -1.0"),
        ({"training_m": 0.0}, "training_m must be finite and above 0, got 0.0"),
        ({"rank": 1.5}, "rank must be above 0 and at most 1, got 1.5"),
    ],
)
def test_refuses_settings(given: dict, message: str) -> None:
    with pytest.raises(ValueError, match=message):
        OrderedCfarSettings(**given)


def test_refuses_windows_that_do_not_fit() -> None:
    with pytest.raises(ValueError, match=r"training_m must be a bin \(10 m\) or more, got 3.0"):
        Cfar(CfarSettings(training_m=3.0), bin_m=10.0)
    with pytest.raises(ValueError, match="CFAR needs 81 bins or more, the scan has 80"):
        Cfar(CfarSettings(), bin_m=0.1).detect(made_scan(np.zeros((4, 80))))


def test_the_same_scan_gives_the_same_detections() -> None:
    scan = made_scan(np.random.default_rng(2).integers(0, 90, (6, 300)))
    first, second = (Cfar(OrderedCfarSettings(), bin_m=0.1).detect(scan).detections for _ in range(2))
    for one, other in zip(vars(first).values(), vars(second).values(), strict=True):
        assert_array_equal(one, other)
