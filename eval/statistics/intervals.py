"""Confidence intervals from a bootstrap over few independent units, such as drives or blocks of scans.

Percentile intervals of few values are too narrow: their levels are expanded so that the interval of a normal
sample has the coverage of Student's t (the expanded percentile interval of Hesterberg, "What Teachers Should
Know About the Bootstrap", The American Statistician 69(4), 2015). No interval can reach beyond the smallest
and the largest value, which hold the true centre of a symmetric distribution with a probability of
1 - 2^(1 - n).
"""

import math

import numpy as np
from numpy.typing import ArrayLike
from scipy.stats import norm, t

CONFIDENCE = 0.95
"""Confidence of the intervals."""
FEWEST = 6
"""Units from which the range of their values holds the centre with more than `CONFIDENCE`: 1 - 2^-5."""


def percentile_interval(resampled: ArrayLike, count: int) -> tuple[float, float]:
    """Estimate the interval that holds the true value of a figure with the probability `CONFIDENCE`.

    Args:
        resampled: The figure of each resample (R,).
        count: Number of independent units that were resampled.

    Returns:
        Its ends, nan for a single unit.
    """
    if count < 2:
        return math.nan, math.nan
    tail = expanded_tail(count)
    low, high = np.quantile(np.asarray(resampled, np.float64), [tail, 1 - tail]).tolist()
    return low, high


def expanded_tail(count: int) -> float:
    """Return the share of resamples below the interval.

    Args:
        count: Number of units, 2 or more.

    Returns:
        The share: Phi(-sqrt(n / (n - 1)) t), with t the quantile of Student's distribution of n - 1 degrees
        of freedom; (1 - `CONFIDENCE`) / 2 for many units.
    """
    quantile = t.ppf((1 + CONFIDENCE) / 2, count - 1)
    return float(norm.cdf(-math.sqrt(count / (count - 1)) * quantile))


def reach(count: int) -> float:
    """Return the largest probability with which any interval of some units can hold the centre.

    Args:
        count: Number of units, 1 or more.

    Returns:
        1 - 2^(1 - n): that not all units lie on one side of the centre.
    """
    return 1 - 2.0 ** (1 - count)


def caution(count: int, *, one: str = "drive", many: str = "drives", estimate: str = "mean") -> str | None:
    """Say what an interval from few units is worth.

    Args:
        count: Number of units.
        one: What a unit is called.
        many: What units are called.
        estimate: What the interval is of.

    Returns:
        A sentence without its full stop, None for `FEWEST` or more.
    """
    if count >= FEWEST:
        return None
    if count == 1:
        return f"1 {one} gives no interval: how far {many} differ is unknown"
    share = 100 * reach(count)
    return (
        f"{count} {many} are too few for {100 * CONFIDENCE:g} %: no interval that they give holds the true "
        f"{estimate} with more than {share:.3g} %; take {FEWEST} or more"
    )
