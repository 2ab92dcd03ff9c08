"""The figures of a judged method: one number each, with confidence intervals over blocks of scans."""

from collections.abc import Callable, Mapping
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from echoscape.eval.detections.bootstrap import confidence_intervals
from echoscape.eval.detections.precision_recall import LEVELS
from echoscape.eval.detections.run import JudgedMethod
from echoscape.eval.detections.tally import Tally
from echoscape.eval.detections.targets import LABELS, TARGET

CAUSES = tuple(label for number, label in enumerate(LABELS) if number != TARGET)
"""What false detections may have fallen on."""


def _share(part: NDArray, whole: NDArray) -> NDArray[np.float64]:
    with np.errstate(invalid="ignore", divide="ignore"):
        return np.asarray(part / whole, np.float64)


_FIGURES: Mapping[str, Callable[[Tally], NDArray[np.float64]]] = {
    "detections_per_scan": lambda sums: _share(sums.labels.sum(axis=(-2, -1)), sums.scans),
    "false_alarms_per_scan": lambda sums: _share(sums.false.sum(axis=-1), sums.scans),
    "precision": lambda sums: sums.curve.precision[..., 0],
    "recall": lambda sums: sums.curve.recall[..., 0],
    "object_recall": lambda sums: _share(sums.objects_found_by.sum(axis=-1), sums.objects_by.sum(axis=-1)),
    "average_precision": lambda sums: sums.curve.average_precision,
    "score_average_precision": lambda sums: sums.ranking.average_precision,
    "map_average_precision": lambda sums: sums.map_curve.average_precision,
    "map_base_rate": lambda sums: sums.base_rate,
}
FIGURE_NAMES = tuple(_FIGURES)
"""Names of the figures, in the order of the tables."""


@dataclass(frozen=True, kw_only=True)
class Figure:
    """A figure with its confidence interval.

    Attributes:
        value: The figure over all scans, None where it is not defined.
        interval: Low and high end at 95 %, None where it cannot be estimated.
    """

    value: float | None
    interval: tuple[float, float] | None


def figures(method: JudgedMethod) -> dict[str, Figure]:
    """Compute the figures of a method.

    Args:
        method: What it detected.

    Returns:
        The figures by name, in the order of `FIGURE_NAMES`.
    """
    total = method.blocks.total
    intervals = confidence_intervals(
        method.blocks, lambda sums: np.stack([figure(sums) for figure in _FIGURES.values()])
    )
    return {
        name: Figure(value=finite(figure(total)), interval=interval)
        for (name, figure), interval in zip(_FIGURES.items(), intervals, strict=True)
    }


def finite(value: NDArray | float) -> float | None:
    """Return a number, None in place of one that is not finite.

    Args:
        value: A number.

    Returns:
        The number as a float.
    """
    return float(value) if np.isfinite(value) else None


def false_alarms(total: Tally) -> dict[str, float]:
    """Compute the false alarms a scan by cause.

    Args:
        total: Sums over all scans.

    Returns:
        False alarms a scan, for each of `CAUSES`.
    """
    counts = total.labels.sum(axis=-1) / max(int(total.scans), 1)
    return {cause: float(counts[LABELS.index(cause)]) for cause in CAUSES}


def mean_scores(method: JudgedMethod) -> dict[str, float | None]:
    """Compute the mean score of the detections by what they fell on.

    Args:
        method: What a method detected.

    Returns:
        Mean scores for each of `LABELS`, to half a level; None where nothing fell.
    """
    low, high = method.score_limits
    score = low + (np.arange(LEVELS) + 0.5) * ((high - low) / LEVELS)
    counts = method.blocks.total.labels
    return {
        label: float(row @ score / row.sum()) if row.any() else None
        for label, row in zip(LABELS, counts, strict=True)
    }


def best_threshold(method: JudgedMethod) -> dict[str, float | None]:
    """Find the threshold of the greatest F1.

    Args:
        method: What a method detected.

    Returns:
        The threshold, precision, recall and F1 there; None where nothing was found.
    """
    curve = method.blocks.total.curve
    best = int(np.argmax(curve.f1))
    low, high = method.score_limits
    if curve.f1[best] == 0:
        return dict.fromkeys(("threshold", "precision", "recall", "f1"))
    return {
        "threshold": low + best * (high - low) / LEVELS,
        "precision": finite(curve.precision[best]),
        "recall": finite(curve.recall[best]),
        "f1": finite(curve.f1[best]),
    }
