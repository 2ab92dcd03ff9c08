"""Precision and recall by threshold, and average precision, from counts by level of the score.

Average precision is the sum of (R_n - R_(n-1)) P_n over falling thresholds, without interpolation (Manning
et al., Introduction to Information Retrieval, 2008, section 8.4). Scores are sorted into `LEVELS` levels;
what has one level is taken at once, as equal scores are.
"""

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray

LEVELS = 256
"""Levels of scores: 0.5 dB of the score of CFAR, one code, 1/256 of the score of a keypoint."""


def levels_of(score: NDArray[np.floating], limits: tuple[float, float]) -> NDArray[np.int64]:
    """Sort scores into levels.

    Args:
        score: Scores of any shape.
        limits: The score at which the lowest level begins, and that at which the highest one ends.

    Returns:
        Levels from 0 to `LEVELS` - 1 of the same shape.
    """
    low, high = limits
    scaled = np.floor((np.asarray(score, np.float64) - low) * (LEVELS / (high - low)))
    return np.clip(scaled, 0, LEVELS - 1).astype(np.int64)


@dataclass(frozen=True, kw_only=True)
class PrecisionRecall:
    """Precision and recall with all detections of a level or above; the last axis counts levels from 0.

    Attributes:
        precision: Share of the detections that are true (..., levels); NaN where there is none.
        recall: Share of the targets that are found (..., levels); NaN where there is none.
    """

    precision: NDArray[np.float64]
    recall: NDArray[np.float64]

    @property
    def average_precision(self) -> NDArray[np.float64]:
        """The area under the curve (...)."""
        gained = -np.diff(self.recall, append=0.0, axis=-1)
        return np.sum(np.where(gained > 0, gained * np.nan_to_num(self.precision), gained), axis=-1)

    @property
    def f1(self) -> NDArray[np.float64]:
        """Harmonic mean of precision and recall (..., levels), 0 where either is 0 or unknown."""
        precision, recall = np.nan_to_num(self.precision), np.nan_to_num(self.recall)
        return 2 * precision * recall / np.maximum(precision + recall, np.finfo(float).tiny)


def precision_recall(
    true: ArrayLike, false: ArrayLike, found: ArrayLike, targets: ArrayLike
) -> PrecisionRecall:
    """Compute the curve.

    Args:
        true: Number of true detections of each level (..., levels).
        false: Number of false ones (..., levels).
        found: Number of targets whose best detection has each level (..., levels).
        targets: Number of targets, found or not (...).

    Returns:
        The curve. Several true detections may belong to one target: all of them count in precision, the
        target counts once in recall.
    """
    true, false, found = (_at_or_above(each) for each in (true, false, found))
    with np.errstate(invalid="ignore", divide="ignore"):
        return PrecisionRecall(
            precision=true / (true + false), recall=found / np.asarray(targets, np.float64)[..., None]
        )


def _at_or_above(counts: ArrayLike) -> NDArray[np.float64]:
    values = np.asarray(counts, np.float64)
    return np.cumsum(values[..., ::-1], axis=-1)[..., ::-1]
