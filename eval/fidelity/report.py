"""How like real scans a folder of scans is: every statistic beside its target and another folder's, judged.

Targets and tolerances stand in eval/fidelity/reference_values.py. Run on the real scans behind them, the targets have
to come out: that tests this yardstick before it is laid on a simulator.
"""

import json
import math
from dataclasses import asdict
from pathlib import Path
from typing import Any

from echoscape.eval.fidelity.dataset_statistics import Survey
from echoscape.eval.fidelity.score import (
    Fidelity,
    Row,
    number_text,
    span_text,
    tolerance_text,
)
from echoscape.sim.datasets.files.atomic_write import write_whole
from echoscape.sim.datasets.files.output_folder import check_output_folder

# ---------------------------------------------------------------------- words


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
    from echoscape.eval.fidelity.figure import page  # matplotlib is slow to load

    check_output_folder(out)
    files = {
        "fidelity.json": json_text(result).encode(),
        "fidelity.md": markdown(result).encode(),
        "fidelity.png": page(result),
    }
    out.mkdir(parents=True, exist_ok=True)
    for name, content in files.items():
        write_whole(out / name, content)
    return tuple(out / name for name in files)


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
