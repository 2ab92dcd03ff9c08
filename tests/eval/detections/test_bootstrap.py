import math
from dataclasses import replace

import numpy as np
import pytest

from echoscape.eval.detections.bootstrap import confidence_intervals
from echoscape.eval.detections.tally import Tally
from echoscape.eval.detections.targets import TARGET


def blocks_of(true: np.ndarray, false: np.ndarray) -> Tally:
    """Blocks with so many true and false detections."""
    found = Tally.empty(len(true), bands=1, classes=1)
    labels = found.labels.copy()
    labels[:, TARGET, 0], labels[:, 0, 0] = true, false
    return replace(found, labels=labels, scans=np.ones(len(true), int))


def precision(sums: Tally) -> np.ndarray:
    return np.stack([sums.curve.precision[..., 0]])


def test_interval_of_a_share_is_that_of_the_normal_law() -> None:
    true = np.random.default_rng(1).binomial(100, 0.3, 64)
    (interval,) = confidence_intervals(blocks_of(true, 100 - true), precision)
    assert interval is not None
    half = 1.96 * true.std() / 100 / math.sqrt(64)  # of 64 blocks, with the spread that they have
    assert interval[0] == pytest.approx(true.mean() / 100 - half, abs=0.15 * half)
    assert interval[1] == pytest.approx(true.mean() / 100 + half, abs=0.15 * half)


def test_blocks_that_are_alike_leave_no_doubt() -> None:
    (interval,) = confidence_intervals(blocks_of(np.full(9, 3), np.full(9, 1)), precision)
    assert interval == (0.75, 0.75)


def test_one_block_or_nothing_detected_has_no_interval() -> None:
    assert confidence_intervals(blocks_of(np.array([3]), np.array([1])), precision) == [None]
    assert confidence_intervals(blocks_of(np.zeros(5), np.zeros(5)), precision) == [None]


def test_the_same_counts_have_the_same_interval() -> None:
    blocks = blocks_of(np.arange(20), np.full(20, 5))
    assert confidence_intervals(blocks, precision) == confidence_intervals(blocks, precision)
