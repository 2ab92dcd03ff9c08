"""The tables of an ablation: a line for every condition, method and metric, and the values of every drive."""

import csv
import io
import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

from echoscape.eval.ablation.study.bootstrap import PairedDifference, paired_difference
from echoscape.eval.ablation.study.conditions import Condition, strength_text
from echoscape.eval.ablation.study.results import METRICS, Metric
from echoscape.eval.ablation.study.settings import AblationStudy

Results = Mapping[tuple[str, str, str], dict[str, Any]]
"""Contents of results by the names of drive, condition and method."""

COLUMNS = (
    "condition",
    "artefact",
    "strength",
    "method",
    "metric",
    "unit",
    "drives",
    "default",
    "value",
    "difference",
    "low",
    "high",
    "pairs",
    "failed",
)
"""Columns of table.csv."""
DRIVE_COLUMNS = ("drive", "condition", "method", "pairs", "failed", *(each.name for each in METRICS))
"""Columns of drives.csv."""
_SHOWN = ("translation_error_mean", "rotation_error_mean", "translation_drift", "rotation_drift")
"""Metrics in the tables that people read."""


@dataclass(frozen=True, kw_only=True)
class AblationRow:
    """What one condition costs one method by one metric.

    Attributes:
        condition: The condition.
        method: Name of the method.
        metric: The metric.
        compared: Its difference from the default condition over the drives that have the metric.
        pairs: Pairs of all drives under the condition.
        failed: Those of them that failed.
    """

    condition: Condition
    method: str
    metric: Metric
    compared: PairedDifference
    pairs: int
    failed: int


def ablation_rows(study: AblationStudy, results: Results) -> list[AblationRow]:
    """Compare every condition with the default one, drive by drive.

    Args:
        study: The ablation.
        results: All results.

    Returns:
        A row for each condition, method and metric that some drive has.
    """
    found = []
    default = study.conditions[0]
    for condition in study.conditions:
        for method in study.methods:
            here = [results[each.name, condition.name, method.name] for each in study.drives]
            there = [results[each.name, default.name, method.name] for each in study.drives]
            for metric in METRICS:
                compared = paired_difference([*map(metric.of, here)], [*map(metric.of, there)])
                if compared is not None:
                    found.append(
                        AblationRow(
                            condition=condition,
                            method=method.name,
                            metric=metric,
                            compared=compared,
                            pairs=sum(each["metrics"]["pairs"] for each in here),
                            failed=sum(each["metrics"]["failed_pairs"] for each in here),
                        )
                    )
    return found


def table_csv(rows: Sequence[AblationRow]) -> str:
    """Write all rows as CSV.

    Args:
        rows: The rows.

    Returns:
        A line for each of them below `COLUMNS`; artefact and strength are empty in a grid.
    """
    return _csv(COLUMNS, [_csv_cells(row) for row in rows])


def drives_csv(study: AblationStudy, results: Results) -> str:
    """Write the metrics of every drive as CSV, for other statistics than those of table.csv.

    Args:
        study: The ablation.
        results: All results.

    Returns:
        A line for each drive, condition and method below `DRIVE_COLUMNS`.
    """
    lines = []
    for drive in study.drives:
        for condition in study.conditions:
            for method in study.methods:
                content = results[drive.name, condition.name, method.name]
                counts = content["metrics"]["pairs"], content["metrics"]["failed_pairs"]
                values = [_number(each.of(content)) for each in METRICS]
                lines.append([drive.name, condition.name, method.name, *map(str, counts), *values])
    return _csv(DRIVE_COLUMNS, lines)


def condition_label(condition: Condition) -> str:
    """Name a condition for people.

    Args:
        condition: The condition.

    Returns:
        Such as "ghosts off", in a grid "ghosts off, speckle 50 %".
    """
    parts = [f"{name.replace('_', ' ')} {strength_text(name, value)}" for name, value in condition.levels]
    return ", ".join(parts) or condition.name


def shown_metrics(rows: Sequence[AblationRow]) -> list[Metric]:
    """Return the metrics that people read first, of those that the rows have.

    Args:
        rows: The rows.

    Returns:
        The metrics.
    """
    present = {row.metric.name for row in rows}
    return [each for each in METRICS if each.name in _SHOWN and each.name in present]


def difference_text(row: AblationRow) -> str:
    """Write a difference with its interval, such as "+0.0123 (+0.0031 to +0.0204)".

    Args:
        row: The row.

    Returns:
        The text; without interval for a single drive, "0" where no drive differs at all.
    """
    compared, digits = row.compared, row.metric.digits
    known = [each for each in (compared.difference, compared.low, compared.high) if not math.isnan(each)]
    if not any(known):
        return "0"
    text = _signed(compared.difference, digits)
    if math.isnan(compared.low):
        return text
    return f"{text} ({_signed(compared.low, digits)} to {_signed(compared.high, digits)})"


def failed_text(row: AblationRow) -> str:
    """Write how many pairs failed, such as "3 of 12 (25 %)".

    Args:
        row: The row.

    Returns:
        The text, without share where no pair failed.
    """
    share = f" ({100 * row.failed / row.pairs:.3g} %)" if row.failed else ""
    return f"{row.failed} of {row.pairs}{share}"


def _signed(value: float, digits: int) -> str:
    """Write a difference with its sign; what rounds to 0 is +0."""
    return f"{round(value, digits) + 0.0:+.{digits}f}"


def _csv_cells(row: AblationRow) -> list[str]:
    condition, compared = row.condition, row.compared
    ((artefact, strength),) = condition.levels if len(condition.levels) == 1 else (("", None),)
    numbers = (compared.default, compared.value, compared.difference, compared.low, compared.high)
    return [
        condition.name,
        artefact,
        _number(strength),
        row.method,
        row.metric.name,
        row.metric.unit,
        str(compared.drives),
        *map(_number, numbers),
        str(row.pairs),
        str(row.failed),
    ]


def _number(value: float | None) -> str:
    """Write a number with eight digits, nothing where it is unknown."""
    return "" if value is None or math.isnan(value) else f"{value:.8g}"


def _csv(titles: Sequence[str], lines: Sequence[Sequence[str]]) -> str:
    text = io.StringIO()
    writer = csv.writer(text, lineterminator="\n")
    writer.writerows([titles, *lines])
    return text.getvalue()
