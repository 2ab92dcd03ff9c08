"""Paired differences with confidence: a bootstrap over drives, as pairs of one drive are not independent."""

import math
from collections.abc import Sequence
from dataclasses import dataclass
from functools import lru_cache

import numpy as np
from numpy.typing import ArrayLike, NDArray

from echoscape.eval.statistics.intervals import FEWEST, percentile_interval

RESAMPLES = 10_000
_SEED = 20_150
"""Seed of the bootstrap, the same for all comparisons: they share their resamples."""


@dataclass(frozen=True, kw_only=True)
class PairedDifference:
    """The difference between two conditions on the same drives.

    Attributes:
        drives: Number of drives.
        value: Mean over drives under the condition.
        default: Mean over the same drives under the default condition.
        difference: Mean of the differences of the drives.
        low: Lower end of the confidence interval of the difference; nan for one drive.
        high: Its upper end.
    """

    drives: int
    value: float
    default: float
    difference: float
    low: float
    high: float

    @property
    def is_clear(self) -> bool:
        """Whether the interval leaves out 0; never with too few drives for its confidence."""
        return self.drives >= FEWEST and (self.low > 0 or self.high < 0)


def paired_difference(
    values: Sequence[float | None], defaults: Sequence[float | None]
) -> PairedDifference | None:
    """Compare two conditions.

    Args:
        values: A metric of each drive under a condition; None where a drive has no value.
        defaults: The metric of the same drives under the default condition.

    Returns:
        The difference over the drives that have both values, None where no drive has.

    Raises:
        ValueError: The numbers of drives differ.
    """
    if len(values) != len(defaults):
        raise ValueError(f"values must be as many as defaults, {len(defaults)}, got {len(values)}")
    both = [
        (one, other)
        for one, other in zip(values, defaults, strict=True)
        if one is not None and other is not None
    ]
    if not both:
        return None
    pairs = np.array(both, np.float64)
    differences = pairs[:, 0] - pairs[:, 1]
    low, high = interval_of_mean(differences)
    value, default = pairs.mean(axis=0).tolist()
    return PairedDifference(
        drives=len(pairs),
        value=value,
        default=default,
        difference=float(differences.mean()),
        low=low,
        high=high,
    )


def interval_of_mean(values: ArrayLike) -> tuple[float, float]:
    """Estimate the interval that holds the mean of a distribution with a probability of 95 %.

    Args:
        values: Independent draws from the distribution (N,).

    Returns:
        Its ends, nan for a single value.
    """
    found = np.asarray(values, np.float64)
    count = len(found)
    if count < 2:
        return math.nan, math.nan
    means = found[_resamples(count)].mean(axis=1)
    # The mean of equal values may miss them by rounding: no difference is 0 to the last bit.
    low, high = np.clip(percentile_interval(means, count), found.min(), found.max()).tolist()
    return low, high


@lru_cache(maxsize=8)
def _resamples(count: int) -> NDArray[np.int64]:
    """Return the numbers of the values in each resample (RESAMPLES, count)."""
    rng = np.random.default_rng(np.random.SeedSequence([_SEED, count]))
    return rng.integers(0, count, (RESAMPLES, count))
