"""Scores a folder of scans: each statistic beside its target value and the value of a reference folder.

Targets and tolerances are in eval/fidelity/reference_values.py. The real scans behind the targets pass them,
which tests the score before it is applied to simulated scans.
"""

import math
from dataclasses import dataclass

from echoscape.eval.fidelity.dataset_statistics import DatasetStatistics, measure
from echoscape.eval.fidelity.reference_values import TARGETS, Target, tolerance_of, widened
from echoscape.scenes.core.progress import Progress
from echoscape.sim.datasets.scan_folder import ScanFolder

PASS, LOW, HIGH, UNKNOWN = "pass", "low", "high", "unknown"
"""Verdicts: within tolerance, below it, above it, and not determined by the folder."""


@dataclass(frozen=True, kw_only=True)
class Score:
    """One statistic with its verdicts.

    Attributes:
        name: Name of the statistic.
        value: Its value, NaN where the folder does not determine it.
        target: Its target, None without one.
        verdict: Verdict against the target, None without one.
        reference: Value of the reference folder, None without one.
        reference_verdict: Verdict against that value, None without one.
    """

    name: str
    value: float
    target: Target | None
    verdict: str | None
    reference: float | None
    reference_verdict: str | None


@dataclass(frozen=True, kw_only=True)
class FidelityReport:
    """The statistics of a folder and their scores.

    Attributes:
        data: Statistics of the folder.
        reference: Statistics of the reference folder, None without one.
        scores: A score for each statistic.
    """

    data: DatasetStatistics
    reference: DatasetStatistics | None
    scores: tuple[Score, ...]

    @property
    def passed(self) -> int:
        """Number of statistics within tolerance."""
        return sum(score.verdict == PASS for score in self.scores)

    @property
    def judged(self) -> int:
        """Number of statistics with a target."""
        return sum(score.verdict is not None for score in self.scores)


def fidelity_report(
    data: ScanFolder, *, reference: ScanFolder | None = None, progress: Progress | None = None
) -> FidelityReport:
    """Measure a folder of scans and score it.

    Args:
        data: The folder.
        reference: Another folder to compare with, None for none.
        progress: Called as the work proceeds; stages: scans, reference.

    Returns:
        Statistics and scores.

    Raises:
        DatasetError: A scan cannot be read; the message names it.
    """
    found = measure(data, progress=progress)
    other = measure(reference, progress=_renamed(progress, "reference")) if reference else None
    return FidelityReport(data=found, reference=other, scores=scores_of(found, other))


def _renamed(progress: Progress | None, stage: str) -> Progress | None:
    """Return a `progress` that reports every stage under the name `stage`."""
    return None if progress is None else lambda _, done, total: progress(stage, done, total)


def scores_of(data: DatasetStatistics, reference: DatasetStatistics | None) -> tuple[Score, ...]:
    """Score each statistic of a folder.

    Args:
        data: Statistics of the folder; its sensor decides the targets.
        reference: Statistics of another folder, None for none.

    Returns:
        A score for each statistic.
    """
    targets = TARGETS.get(data.sensor, {})
    return tuple(
        _score(name, value, targets.get(name), None if reference is None else reference.values[name])
        for name, value in data.values.items()
    )


def _score(name: str, value: float, target: Target | None, reference: float | None) -> Score:
    compared = None
    if reference is not None and math.isfinite(reference):
        compared = verdict(value, widened(reference, *tolerance_of(name)))
    return Score(
        name=name,
        value=value,
        target=target,
        verdict=None if target is None else verdict(value, target.limits),
        reference=reference,
        reference_verdict=compared,
    )


def verdict(value: float, limits: tuple[float, float]) -> str:
    """Compare a value with its limits.

    Args:
        value: The value.
        limits: The smallest and the largest value that pass.

    Returns:
        "pass" within the limits or on them, "low", "high", or "unknown" for NaN.
    """
    if math.isnan(value):
        return UNKNOWN
    slack = 1e-9 * max(abs(limits[0]), abs(limits[1]))
    if value < limits[0] - slack:
        return LOW
    return HIGH if value > limits[1] + slack else PASS


def span_text(target: Target | None) -> str:
    """Write the value or the span of a target.

    Args:
        target: The target.

    Returns:
        The text, empty without a target.
    """
    if target is None:
        return ""
    low, high = number_text(target.low), number_text(target.high)
    return low if low == high else f"{low} to {high}"


def tolerance_text(target: Target | None) -> str:
    """Write the tolerance of a target.

    Args:
        target: The target.

    Returns:
        The text, empty without a target or a tolerance.
    """
    if target is None or (target.rule == "difference" and target.tolerance == 0):
        return ""
    if target.rule == "share":
        return f"± {100 * target.tolerance:g} %"
    return f"{'× ' if target.rule == 'factor' else '± '}{target.tolerance:g}"


def number_text(value: float | None) -> str:
    """Write a number with three or four digits.

    Args:
        value: The number.

    Returns:
        The text, a dash for None and NaN.
    """
    if value is None or not math.isfinite(value):
        return "-"
    if abs(value) >= 100 or value == int(value):
        return f"{value:.0f}"
    return f"{value:.2f}" if abs(value) < 10 else f"{value:.1f}"
