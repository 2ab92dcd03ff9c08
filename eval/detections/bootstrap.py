"""Confidence intervals of counted figures by the percentile bootstrap over blocks of successive scans.

Sources: Efron & Tibshirani, An Introduction to the Bootstrap, 1993, chapter 13; blocks as in Kunsch, Annals
of Statistics 17(3), 1989, because successive scans show nearly the same. The levels are those for few blocks
(`eval.statistics.intervals`), and fewer than `FEWEST` blocks have no interval.
"""

from collections.abc import Callable

import numpy as np
from numpy.typing import NDArray

from echoscape.eval.detections.blocks import BLOCK_M
from echoscape.eval.detections.tally import Tally
from echoscape.eval.statistics.intervals import FEWEST, caution, percentile_interval

DRAWS = 4000
"""Resampled drives: ten of them beyond the interval of 6 blocks, on either side."""
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
        Low and high end of each figure; None of fewer than `FEWEST` blocks, or where the figure is not always
        defined.
    """
    count = len(blocks.scans)
    rng = np.random.default_rng(_SEED)
    weights = rng.multinomial(count, np.full(count, 1 / count), size=DRAWS)
    parts = np.array_split(weights, DRAWS // _AT_A_TIME)
    values = np.concatenate([figures(blocks.weighted(part)) for part in parts], axis=1)
    return [
        percentile_interval(each, count) if count >= FEWEST and np.isfinite(each).all() else None
        for each in values
    ]


def why_no_intervals(blocks: int, travelled_m: float) -> str | None:
    """Say why figures have no intervals.

    Args:
        blocks: Number of blocks.
        travelled_m: Way of the scans [m].

    Returns:
        A sentence without its full stop, None where they have intervals.
    """
    reason = caution(blocks, one="block", many="blocks", estimate="figure")
    if reason is None:
        return None
    return f"no intervals: the way of {travelled_m:.0f} m makes blocks of {BLOCK_M:g} m or more, and {reason}"
