"""Writes what an ablation found: table.csv, drives.csv, table.md, summary.png, curves.png and report.html.

Everything is made before the first file is written; report.html comes last.
"""

import base64
import html
import json
from collections.abc import Sequence
from pathlib import Path

from echoscape.eval.ablation.study.figures import curves_figure, summary_figure
from echoscape.eval.ablation.study.markdown_table import table_markdown
from echoscape.eval.ablation.study.notes import cautions, chance_note, how_to_read
from echoscape.eval.ablation.study.run import all_results
from echoscape.eval.ablation.study.settings import AblationStudy, study_content
from echoscape.eval.ablation.study.tables import (
    AblationRow,
    ablation_rows,
    condition_label,
    difference_text,
    drives_csv,
    failed_text,
    shown_metrics,
    table_csv,
)
from echoscape.eval.figures.style import ACCENT, FAINT, FRAME, INK, PAGE, PANEL
from echoscape.sim.datasets.files.atomic_write import write_atomic

_STYLE = f"""
body {{ background: {PAGE}; color: {INK}; font: 15px/1.5 sans-serif; max-width: 1200px; margin: 2em auto;
        padding: 0 1em; }}
h1, h2 {{ font-weight: 600; }}
img {{ max-width: 100%; }}
table {{ border-collapse: collapse; margin: 1em 0; }}
th, td {{ border-bottom: 1px solid {FRAME}; padding: .25em .8em; text-align: right;
          font-variant-numeric: tabular-nums; }}
th:first-child, td:first-child {{ text-align: left; }}
th {{ color: {FAINT}; font-weight: 500; vertical-align: bottom; }}
td.clear {{ color: {ACCENT}; font-weight: 600; }}
small, td small {{ color: {FAINT}; }}
.caution {{ border-left: 4px solid {ACCENT}; background: {PANEL}; padding: .5em 1em; }}
pre {{ background: {PANEL}; padding: 1em; overflow-x: auto; }}
"""


def write_ablation_report(out: Path, study: AblationStudy) -> tuple[list[AblationRow], tuple[Path, ...]]:
    """Write the tables, figures and the page of an ablation that is done.

    Args:
        out: Folder of the ablation.
        study: The ablation.

    Returns:
        The rows of table.csv, and the paths of the files.

    Raises:
        DatasetError: A result is missing or damaged.
        OSError: The folder cannot be written to.
    """
    results = all_results(out, study)
    rows = ablation_rows(study, results)
    figures = {"summary.png": summary_figure(study, rows), "curves.png": curves_figure(study, rows)}
    files = {
        "table.csv": table_csv(rows).encode(),
        "drives.csv": drives_csv(study, results).encode(),
        "table.md": table_markdown(study, rows).encode(),
        **figures,
        "report.html": report_page(study, rows, figures).encode(),
    }
    for name, content in files.items():
        write_atomic(out / name, content)
    return rows, tuple(out / name for name in files)


def report_page(study: AblationStudy, rows: Sequence[AblationRow], figures: dict[str, bytes]) -> str:
    """Write the page of an ablation, one file that requests nothing from the network.

    Args:
        study: The ablation.
        rows: Its rows.
        figures: PNG files by name.

    Returns:
        The page.
    """
    chance = chance_note(rows)
    parts = [
        "<!doctype html>",
        '<html lang="en"><head><meta charset="utf-8"><title>Ablation</title>',
        f"<style>{_STYLE}</style></head><body>",
        "<h1>What artefacts cost odometry</h1>",
        f"<p>{html.escape(how_to_read(study, mark='Orange'))}</p>",
        *(f'<p class="caution">Caution: {html.escape(each)}.</p>' for each in cautions(study, rows)),
        *([f"<p><small>{html.escape(chance)}</small></p>"] if chance else []),
    ]
    for name, data in figures.items():
        parts.append(
            f'<p><img alt="{name}" src="data:image/png;base64,{base64.b64encode(data).decode()}"></p>'
        )
    for method in study.methods:
        own = [row for row in rows if row.method == method.name]
        parts += [f"<h2>{html.escape(method.name)}</h2>", _table(study, own)]
    settings = html.escape(json.dumps(study_content(study), indent=1))
    parts += [f"<details><summary>Settings</summary><pre>{settings}</pre></details>", "</body></html>", ""]
    return "\n".join(parts)


def _table(study: AblationStudy, rows: Sequence[AblationRow]) -> str:
    """Return the table of one method."""
    metrics = shown_metrics(rows)
    head = "".join(f"<th>{html.escape(each.title)} [{each.unit}]</th>" for each in metrics)
    lines = [f"<table><tr><th>condition</th>{head}<th>failed pairs</th></tr>"]
    by_place = {(row.condition.name, row.metric.name): row for row in rows}
    for condition in study.conditions:
        found = [by_place.get((condition.name, each.name)) for each in metrics]
        some = next(row for row in found if row is not None)
        cells = "".join(map(_cell, found))
        label = html.escape(condition_label(condition))
        lines.append(f"<tr><td>{label}</td>{cells}<td>{failed_text(some)}</td></tr>")
    return "\n".join([*lines, "</table>"])


def _cell(row: AblationRow | None) -> str:
    if row is None:
        return "<td></td>"
    if not row.condition.levels:
        return f"<td>{row.compared.value:.{row.metric.digits}f}</td>"
    number, _, interval = difference_text(row).partition(" ")
    kind = ' class="clear"' if row.compared.is_clear else ""
    return f"<td{kind}>{number} <small>{interval}</small></td>"
