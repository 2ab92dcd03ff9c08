"""How like real scans a folder of scans is: every statistic beside its target and another folder's, judged.

Targets and tolerances stand in eval/fidelity_targets.py. Run on the real scans behind them, the targets have
to come out: that tests this yardstick before it is laid on a simulator.
"""

import json
import math
from collections.abc import Callable
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any

from echoscape.eval.fidelity_targets import TARGETS, Target, tolerance_of, widened
from echoscape.eval.scan_survey import Survey, survey
from echoscape.sim.folders import ScanFolder
from echoscape.sim.whole_files import DatasetError, write_whole

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


# ---------------------------------------------------------------------- words


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


def markdown(result: Fidelity) -> str:
    """Return the table as Markdown, under a line that says what was measured."""
    right, judged = result.judged()
    lines = [f"# Fidelity of {result.data.name}", "", _measured(result.data)]
    if result.reference is not None:
        lines += ["", f"Reference: {_measured(result.reference)}"]
    if judged:
        sources = sorted({row.target.source for row in result.rows if row.target})
        lines += ["", f"{right} of {judged} figures are right; targets: {', '.join(sources)}."]
    names = ["figure", "value", "target", "tolerance", "verdict"]
    names += ["reference", "against it"] if result.reference else []
    lines += ["", f"| {' | '.join(names)} |", f"|---|{'---:|' * 3}{'---|' * (len(names) - 4)}"]
    lines += [f"| {' | '.join(cells(row)[: len(names)])} |" for row in result.rows]
    return "\n".join(lines) + "\n"


def cells(row: Row) -> list[str]:
    """Return a row of the table: figure, value, target, tolerance, verdict, reference, verdict against it."""
    return [
        row.name.replace("_", " "),
        number_text(row.value),
        span_text(row.target),
        tolerance_text(row.target),
        row.verdict or "",
        number_text(row.reference),
        row.reference_verdict or "",
    ]


def _measured(found: Survey) -> str:
    return f"{found.name}: {found.scans} scans of {found.sensor}, {found.isolated} isolated peaks."


# ---------------------------------------------------------------------- files


def write_report(out: Path, result: Fidelity) -> tuple[Path, ...]:
    """Write fidelity.json, fidelity.md and fidelity.png to the folder `out`; return their paths.

    Everything is made before the first file is written, and each is whole or absent.

    Raises:
        DatasetError: `out` is a file.
        OSError: the folder cannot be written to.
    """
    from echoscape.eval.fidelity_page import page  # matplotlib is slow to load

    check_out(out)
    files = {
        "fidelity.json": json_text(result).encode(),
        "fidelity.md": markdown(result).encode(),
        "fidelity.png": page(result),
    }
    out.mkdir(parents=True, exist_ok=True)
    for name, content in files.items():
        write_whole(out / name, content)
    return tuple(out / name for name in files)


def check_out(out: Path) -> None:
    """Refuse a place for the report that cannot be a folder.

    Raises:
        DatasetError: it, or what it would lie in, is a file; the message names it.
    """
    for place in (out, *out.parents):
        if place.exists():
            if not place.is_dir():
                raise DatasetError(f"out must be a folder, {place} is a file")
            return


def json_text(result: Fidelity) -> str:
    """Return figures, verdicts and curves as JSON; what a folder cannot tell is null."""
    right, judged = result.judged()
    content = {
        "right": right,
        "judged": judged,
        "rows": [asdict(row) for row in result.rows],
        "data": _survey_content(result.data),
        "reference": None if result.reference is None else _survey_content(result.reference),
    }
    return json.dumps(_told(content), indent=1, allow_nan=False) + "\n"


def _survey_content(found: Survey) -> dict[str, Any]:
    return {
        "name": found.name,
        "sensor": found.sensor,
        "scans": found.scans,
        "bin_m": found.bin_m,
        "figures": found.figures,
        "histogram": found.histogram.tolist(),
        "noise_histogram": found.noise.tolist(),
        "noise_correlation": found.noise_correlation.tolist(),
        "range_profile_db": found.range_profile.tolist(),
        "azimuth_profile_db": found.azimuth_profile.tolist(),
    }


def _told(content: Any) -> Any:
    """Return `content` with None for every number that is none."""
    if isinstance(content, dict):
        return {name: _told(value) for name, value in content.items()}
    if isinstance(content, (list, tuple)):
        return [_told(value) for value in content]
    return None if isinstance(content, float) and not math.isfinite(content) else content
