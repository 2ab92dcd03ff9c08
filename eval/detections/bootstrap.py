"""Confidence intervals of counted figures by the percentile bootstrap over blocks of successive scans.

Sources: Efron & Tibshirani, An Introduction to the Bootstrap, 1993, chapter 13; blocks as in Kunsch, Annals
of Statistics 17(3), 1989, because successive scans show nearly the same. The levels are those for few blocks
(`eval.statistics.intervals`), and fewer than `FEWEST` blocks have no interval.
"""

from collections.abc import Callable

import numpy as np
from numpy.typing import NDArray

from echoscape.eval.detections.tally import Tally
from echoscape.eval.statistics.intervals import FEWEST, caution, percentile_interval

BLOCK_M = 80.0
"""Least way of a block [m]: figures of single scans, which see some 100 m, are alike up to 60 m apart."""
DRAWS = 4000
"""Resampled drives: ten of them beyond the interval of 6 blocks, on either side."""
_SEED = 20_250_101
_AT_A_TIME = 50


def block_numbers(travelled_m: NDArray[np.floating]) -> NDArray[np.int64]:
    """Number the blocks in which scans lie.

    Args:
        travelled_m: Way from the first scan to each scan (N,) [m], never falling.

    Returns:
        Numbers of the blocks (N,), from 0 without gaps. A block ends where the next scan is `BLOCK_M` or more
        from its first one; what is left at the end belongs to the last block, so that none but an only block
        is shorter.
    """
    found = np.zeros(len(travelled_m), np.int64)
    number, start_m = 0, 0.0
    for place, way_m in enumerate(travelled_m):
        if way_m - start_m >= BLOCK_M:
            number, start_m = number + 1, float(way_m)
        found[place] = number
    if number and travelled_m[-1] - start_m < BLOCK_M:
        found[found == number] = number - 1
    return found


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
