"""Writes a fidelity report: table (fidelity.md), values and curves (fidelity.json), plots (fidelity.png)."""

import json
import math
from dataclasses import asdict
from pathlib import Path
from typing import Any

from echoscape.eval.fidelity.dataset_statistics import DatasetStatistics
from echoscape.eval.fidelity.figure import fidelity_page
from echoscape.eval.fidelity.score import FidelityReport, Score, number_text, span_text, tolerance_text
from echoscape.sim.datasets.files.atomic_write import write_atomic
from echoscape.sim.datasets.files.output_folder import check_output_folder

TABLE_COLUMNS = ("statistic", "value", "target", "tolerance", "verdict", "reference", "against reference")
"""Columns of the table; the last two only with a reference folder."""

# ---------------------------------------------------------------------- the table


def markdown(report: FidelityReport) -> str:
    """Write a report as Markdown: what was measured, how many statistics pass, and the table.

    Args:
        report: The report.

    Returns:
        The text.
    """
    lines = [f"# Fidelity of {report.data.name}", "", _measured(report.data)]
    if report.reference is not None:
        lines += ["", f"Reference: {_measured(report.reference)}"]
    if report.judged:
        sources = sorted({score.target.source for score in report.scores if score.target})
        lines += ["", f"{summary_text(report)}; targets: {', '.join(sources)}."]
    columns = TABLE_COLUMNS if report.reference is not None else TABLE_COLUMNS[:-2]
    lines += ["", f"| {' | '.join(columns)} |", f"|---|{'---:|' * 3}{'---|' * (len(columns) - 4)}"]
    lines += [f"| {' | '.join(table_row(score)[: len(columns)])} |" for score in report.scores]
    return "\n".join(lines) + "\n"


def summary_text(report: FidelityReport) -> str:
    """Write how many statistics pass.

    Args:
        report: The report.

    Returns:
        The text, such as "62 of 93 statistics pass".
    """
    return f"{report.passed} of {report.judged} statistics pass"


def table_row(score: Score) -> list[str]:
    """Write one score as a row of the table.

    Args:
        score: The score.

    Returns:
        A text for each of `TABLE_COLUMNS`.
    """
    return [
        score.name.replace("_", " "),
        number_text(score.value),
        span_text(score.target),
        tolerance_text(score.target),
        score.verdict or "",
        number_text(score.reference),
        score.reference_verdict or "",
    ]


def _measured(found: DatasetStatistics) -> str:
    return f"{found.name}: {found.scans} scans of {found.sensor}, {found.isolated} isolated peaks."


# ---------------------------------------------------------------------- files


def write_fidelity_report(out: Path, report: FidelityReport) -> tuple[Path, ...]:
    """Write fidelity.json, fidelity.md and fidelity.png.

    Everything is made before the first file is written, and each file is whole or absent.

    Args:
        out: Folder to write to.
        report: The report.

    Returns:
        Paths of the files.

    Raises:
        DatasetError: `out` is a file.
        OSError: The folder cannot be written to.
    """
    check_output_folder(out)
    files = {
        "fidelity.json": json_text(report).encode(),
        "fidelity.md": markdown(report).encode(),
        "fidelity.png": fidelity_page(report),
    }
    out.mkdir(parents=True, exist_ok=True)
    for name, content in files.items():
        write_atomic(out / name, content)
    return tuple(out / name for name in files)


def json_text(report: FidelityReport) -> str:
    """Write scores, values and curves as JSON.

    Args:
        report: The report.

    Returns:
        The text; what a folder does not determine is null.
    """
    content = {
        "passed": report.passed,
        "judged": report.judged,
        "scores": [asdict(score) for score in report.scores],
        "data": _statistics_content(report.data),
        "reference": None if report.reference is None else _statistics_content(report.reference),
    }
    return json.dumps(_finite(content), indent=1, allow_nan=False) + "\n"


def _statistics_content(found: DatasetStatistics) -> dict[str, Any]:
    return {
        "name": found.name,
        "sensor": found.sensor,
        "scans": found.scans,
        "bin_m": found.bin_m,
        "values": found.values,
        "histogram": found.histogram.tolist(),
        "noise_histogram": found.noise.tolist(),
        "noise_correlation": found.noise_correlation.tolist(),
        "range_profile_db": found.range_profile.tolist(),
        "azimuth_profile_db": found.azimuth_profile.tolist(),
    }


def _finite(content: Any) -> Any:
    """Return `content` with None for every number that is not finite."""
    if isinstance(content, dict):
        return {name: _finite(value) for name, value in content.items()}
    if isinstance(content, (list, tuple)):
        return [_finite(value) for value in content]
    return None if isinstance(content, float) and not math.isfinite(content) else content
