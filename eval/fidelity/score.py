"""Scores a folder of scans: every statistic beside its target value and another folder's.

Targets and tolerances: `eval.fidelity.reference_values`. Run on the real scans behind them, the targets have to come
out: that tests the score before it is applied to a simulator.
"""

import math
from collections.abc import Callable
from dataclasses import dataclass

from echoscape.eval.fidelity.dataset_statistics import Survey, survey
from echoscape.eval.fidelity.reference_values import TARGETS, Target, tolerance_of, widened
from echoscape.sim.datasets.scan_folder import ScanFolder

Progress = Callable[[str, int, int], None]


RIGHT, LOW, HIGH, UNKNOWN = "right", "low", "high", "unknown"


@dataclass(frozen=True, kw_only=True)
class Row:
    """A figure beside what it should be.

    verdict: `right`, `low`, `high`, `unknown` where the folder cannot tell, None without a target;
    reference and reference_verdict: the same against another folder, None without one.
    """

    name: str
    value: float
    target: Target | None
    verdict: str | None
    reference: float | None
    reference_verdict: str | None


@dataclass(frozen=True, kw_only=True)
class Fidelity:
    """A folder's statistics, those of a reference, and the rows that judge them."""

    data: Survey
    reference: Survey | None
    rows: tuple[Row, ...]

    def judged(self) -> tuple[int, int]:
        """Return how many figures are right, and how many have a target."""
        verdicts = [row.verdict for row in self.rows if row.verdict]
        return verdicts.count(RIGHT), len(verdicts)


def fidelity(
    data: ScanFolder, *, reference: ScanFolder | None = None, progress: Progress | None = None
) -> Fidelity:
    """Measure the scans in `data`, and those in `reference`, and judge the former.

    Raises:
        DatasetError: a scan cannot be read; the message names it.
    """
    found = survey(data, progress=progress)
    other = survey(reference, progress=_staged(progress, "reference")) if reference else None
    return Fidelity(data=found, reference=other, rows=rows_of(found, other))


def _staged(progress: Progress | None, stage: str) -> Progress | None:
    """Return `progress` under the name of a stage of its own."""
    return None if progress is None else lambda _, done, total: progress(stage, done, total)


def rows_of(data: Survey, reference: Survey | None) -> tuple[Row, ...]:
    """Return a row for each figure of `data`, judged by the targets of its sensor and by `reference`."""
    targets = TARGETS.get(data.sensor, {})
    return tuple(
        _row(name, value, targets.get(name), None if reference is None else reference.figures[name])
        for name, value in data.figures.items()
    )


def _row(name: str, value: float, target: Target | None, reference: float | None) -> Row:
    compared = None
    if reference is not None and math.isfinite(reference):
        compared = verdict(value, widened(reference, *tolerance_of(name)))
    return Row(
        name=name,
        value=value,
        target=target,
        verdict=None if target is None else verdict(value, target.limits),
        reference=reference,
        reference_verdict=compared,
    )


def verdict(value: float, limits: tuple[float, float]) -> str:
    """Return whether `value` is `right`, within limits or on them, `low`, `high`, or `unknown` if NaN."""
    if math.isnan(value):
        return UNKNOWN
    slack = 1e-9 * max(abs(limits[0]), abs(limits[1]))
    if value < limits[0] - slack:
        return LOW
    return HIGH if value > limits[1] + slack else RIGHT


def span_text(target: Target | None) -> str:
    """Return a target's value or span in words, nothing without one."""
    if target is None:
        return ""
    low, high = number_text(target.low), number_text(target.high)
    return low if low == high else f"{low} to {high}"


def tolerance_text(target: Target | None) -> str:
    """Return a target's tolerance in words, nothing without one."""
    if target is None or (target.rule == "difference" and target.tolerance == 0):
        return ""
    if target.rule == "share":
        return f"± {100 * target.tolerance:g} %"
    return f"{'× ' if target.rule == 'factor' else '± '}{target.tolerance:g}"


def number_text(value: float | None) -> str:
    """Return a number with three to four digits, a dash where there is none."""
    if value is None or not math.isfinite(value):
        return "-"
    if abs(value) >= 100 or value == int(value):
        return f"{value:.0f}"
    return f"{value:.2f}" if abs(value) < 10 else f"{value:.1f}"
