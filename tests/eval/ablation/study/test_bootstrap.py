"""Intervals of paired differences: by hand, by enumeration of all resamples, and by their coverage."""

import itertools
import math

import numpy as np
import pytest
from numpy.testing import assert_allclose

from echoscape.eval.ablation.study.bootstrap import interval_of_mean, paired_difference
from echoscape.eval.statistics.intervals import expanded_tail, reach


def test_differences_are_taken_drive_by_drive() -> None:
    found = paired_difference([1.0, 4.0, 9.0, None], [0.5, 2.0, 10.0, 3.0])
    assert found is not None
    assert found.drives == 3
    assert_allclose([found.value, found.default], [14 / 3, 12.5 / 3])
    assert_allclose(found.difference, (0.5 + 2.0 - 1.0) / 3)
    assert found.low <= found.difference <= found.high


def test_equal_conditions_differ_by_exactly_nothing() -> None:
    values = [0.1, 0.2, 0.7, 0.123456789, 1 / 3, 2 / 7]
    found = paired_difference(values, list(values))
    assert found is not None
    assert (found.difference, found.low, found.high) == (0.0, 0.0, 0.0)
    assert not found.is_clear


def test_a_constant_difference_has_an_interval_of_no_width() -> None:
    found = paired_difference([3.1, 4.1, 5.1, 6.1, 7.1, 8.1], [3.0, 4.0, 5.0, 6.0, 7.0, 8.0])
    assert found is not None
    assert_allclose([found.low, found.high], 0.1, atol=1e-12)
    assert found.is_clear


def test_without_common_drives_there_is_no_difference() -> None:
    assert paired_difference([None, 1.0], [1.0, None]) is None
    with pytest.raises(ValueError, match="values must be as many as defaults, 2, got 1"):
        paired_difference([1.0], [1.0, 2.0])


def test_interval_is_that_of_all_resamples() -> None:
    values = np.array([0.3, -0.1, 1.2, 0.8, 0.05, 2.0])
    means = [np.mean(each) for each in itertools.product(values, repeat=len(values))]
    tail = expanded_tail(len(values))
    assert_allclose(interval_of_mean(values), np.quantile(means, [tail, 1 - tail]), atol=0.05)


def test_two_drives_give_their_range_and_one_drive_nothing() -> None:
    assert interval_of_mean([1.0, 3.0]) == (1.0, 3.0)
    assert all(map(math.isnan, interval_of_mean([1.0])))


@pytest.mark.parametrize("drives", [2, 3, 8, 12])
def test_intervals_hold_the_true_mean_as_often_as_they_say(drives: int) -> None:
    """Significance 1e-4: four standard deviations of the share among 1500 samples."""
    samples = np.random.default_rng(drives).normal(0.4, 1.0, (1500, drives))
    intervals = np.array([interval_of_mean(each) for each in samples])
    share = np.mean((intervals[:, 0] <= 0.4) & (intervals[:, 1] >= 0.4))
    most = min(0.95, reach(drives))
    assert share < most + 4 * math.sqrt(most * (1 - most) / 1500)
    assert share > most - 0.03 - 4 * math.sqrt(most * (1 - most) / 1500)
