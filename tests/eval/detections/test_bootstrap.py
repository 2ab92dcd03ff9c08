import math
from dataclasses import replace

import numpy as np
import pytest
from scipy.stats import t

from echoscape.eval.detections.bootstrap import BLOCK_M, confidence_intervals, why_no_intervals
from echoscape.eval.detections.tally import Tally
from echoscape.eval.detections.targets import TARGET
from echoscape.eval.statistics.intervals import FEWEST


def blocks_of(true: np.ndarray, false: np.ndarray) -> Tally:
    """Blocks with so many true and false detections."""
    found = Tally.empty(len(true), bands=1, classes=1)
    labels = found.labels.copy()
    labels[:, TARGET, 0], labels[:, 0, 0] = true, false
    return replace(found, labels=labels, scans=np.ones(len(true), int))


def precision(sums: Tally) -> np.ndarray:
    return np.stack([sums.curve.precision[..., 0]])


@pytest.mark.parametrize("blocks", [8, 16, 64])
def test_interval_of_a_share_is_that_of_students_law(blocks: int) -> None:
    true = np.round(1000 + 200 * np.linspace(-1, 1, blocks)).astype(int)
    (interval,) = confidence_intervals(blocks_of(true, 4000 - true), precision)
    assert interval is not None
    half = t.ppf(0.975, blocks - 1) * true.std(ddof=1) / 4000 / math.sqrt(blocks)
    assert interval[0] == pytest.approx(0.25 - half, abs=0.15 * half)
    assert interval[1] == pytest.approx(0.25 + half, abs=0.15 * half)


def test_blocks_that_are_alike_leave_no_doubt() -> None:
    (interval,) = confidence_intervals(blocks_of(np.full(9, 3), np.full(9, 1)), precision)
    assert interval == (0.75, 0.75)


def test_few_blocks_have_no_interval_and_the_reason_is_said() -> None:
    for count in range(1, FEWEST):
        true = np.arange(1, count + 1)
        assert confidence_intervals(blocks_of(true, np.full(count, 4)), precision) == [None]
        reason = why_no_intervals(count, 123.4)
        assert reason is not None
        assert reason.startswith("no intervals: the way of 123 m makes blocks of 80 m or more, and ")
        assert f"{count} block" in reason
    assert BLOCK_M == 80
    assert confidence_intervals(blocks_of(np.arange(1, 7), np.full(6, 4)), precision) != [None]
    assert why_no_intervals(FEWEST, 500.0) is None


def test_nothing_detected_has_no_interval() -> None:
    assert confidence_intervals(blocks_of(np.zeros(9), np.zeros(9)), precision) == [None]


def test_the_same_counts_have_the_same_interval() -> None:
    blocks = blocks_of(np.arange(20), np.full(20, 5))
    assert confidence_intervals(blocks, precision) == confidence_intervals(blocks, precision)
