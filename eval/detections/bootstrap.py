"""Confidence intervals of counted figures by the percentile bootstrap over blocks of successive scans.

Source: Efron & Tibshirani, An Introduction to the Bootstrap, 1993, chapter 13; blocks as in Kunsch, Annals of
Statistics 17(3), 1989, because successive scans show nearly the same.
"""

from collections.abc import Callable

import numpy as np
from numpy.typing import NDArray

from echoscape.eval.detections.tally import Tally

DRAWS = 1000
"""Resampled drives."""
LEVEL = 0.95
"""Probability of the interval."""
_SEED = 20_250_101
_AT_A_TIME = 50


def confidence_intervals(
    blocks: Tally, figures: Callable[[Tally], NDArray[np.float64]]
) -> list[tuple[float, float] | None]:
    """Estimate the intervals in which figures lie over other scans like these.

    Args:
        blocks: Counts of the blocks.
        figures: Computes F figures of each of several sums of blocks (F, draws).

    Returns:
        Low and high end of each figure; None of fewer than two blocks, or where the figure is not always
        defined.
    """
    count = len(blocks.scans)
    rng = np.random.default_rng(_SEED)
    weights = rng.multinomial(count, np.full(count, 1 / count), size=DRAWS)
    parts = np.array_split(weights, DRAWS // _AT_A_TIME)
    values = np.concatenate([figures(blocks.weighted(part)) for part in parts], axis=1)
    return [None if count < 2 or not np.isfinite(each).all() else _interval(each) for each in values]


def _interval(values: NDArray[np.float64]) -> tuple[float, float]:
    low, high = np.quantile(values, [(1 - LEVEL) / 2, (1 + LEVEL) / 2])
    return float(low), float(high)
