"""Intervals from few units: tails of Student's t, coverage by theory, words on what few units are worth."""

import math

import numpy as np
import pytest
from numpy.testing import assert_allclose

from echoscape.eval.statistics.intervals import FEWEST, caution, expanded_tail, percentile_interval, reach


@pytest.mark.parametrize(("units", "quantile"), [(5, 2.776), (15, 2.145)])  # tables of Student's t, 97.5 %
def test_tails_are_those_of_students_t(units: int, quantile: float) -> None:
    tail = 0.5 * math.erfc(math.sqrt(units / (units - 1)) * quantile / math.sqrt(2))
    assert_allclose(expanded_tail(units), tail, rtol=2e-3)


def test_many_units_need_no_expansion() -> None:
    assert_allclose(expanded_tail(100_000), 0.025, rtol=1e-3)


@pytest.mark.parametrize("units", [2, 6, 30])
def test_an_interval_leaves_the_tail_out_on_either_side(units: int) -> None:
    """The quantiles of evenly spread values are their levels; two units have nearly no tail."""
    low, high = percentile_interval(np.linspace(0, 1, 10_001), units)
    assert_allclose([low, high], [expanded_tail(units), 1 - expanded_tail(units)], atol=1e-9)


def test_a_single_unit_has_no_interval() -> None:
    assert all(map(math.isnan, percentile_interval([1.0, 1.0], 1)))


def test_the_fewest_units_are_those_whose_range_suffices() -> None:
    """The centre is outside the range of n units where all lie on one side of it: 2 of 2^n cases."""
    assert_allclose([reach(units) for units in (1, 2, 5, 6)], [0, 1 / 2, 15 / 16, 31 / 32])
    assert reach(FEWEST) > 0.95 > reach(FEWEST - 1)


def test_few_units_are_called_few_by_their_name() -> None:
    assert caution(FEWEST) is None
    assert caution(1) == "1 drive gives no interval: how far drives differ is unknown"
    assert caution(2, one="block", many="blocks of scans", estimate="value") == (
        "2 blocks of scans are too few for 95 %: no interval that they give holds the true value with more "
        "than 50 %; take 6 or more"
    )
    assert "93.8 %" in (caution(FEWEST - 1) or "")
