"""Writes the files of judged detectors: tables (CSV, Markdown), everything as JSON, and a figure."""

import json
import platform
from dataclasses import asdict
from pathlib import Path
from typing import Any

import numpy as np

from echoscape.eval.detections.bootstrap import BLOCK_M, why_no_intervals
from echoscape.eval.detections.figure import detections_page
from echoscape.eval.detections.merit import (
    CAUSES,
    FIGURE_NAMES,
    Figure,
    best_threshold,
    false_alarms,
    figures,
    finite,
    mean_scores,
)
from echoscape.eval.detections.run import DetectionResult, JudgedMethod
from echoscape.eval.detections.tally import BAND_M
from echoscape.eval.statistics.intervals import CONFIDENCE
from echoscape.sim.datasets.files.atomic_write import write_atomic
from echoscape.sim.datasets.files.output_folder import check_output_folder
from echoscape.sim.generation.cache import package_version

Figures = dict[str, dict[str, Figure]]
"""Figures by method and name."""
_PACKAGES = ("echoscape", "numpy", "scipy", "torch")
"""Packages whose versions decide detections and figures."""
TABLE_COLUMNS = {
    "method": "method",
    "detections_per_scan": "a scan",
    "precision": "precision",
    "recall": "recall",
    "object_recall": "objects",
    "average_precision": "AP",
    "score_average_precision": "score AP",
    "map_average_precision": "map AP",
    "map_base_rate": "base rate",
}
"""Columns of the table in Markdown and on the terminal: figure and heading."""
_AP = list(TABLE_COLUMNS)[2:].index("average_precision")
"""Place of the figure whose interval is shown, among the shares."""


def write_detection_report(out: Path, result: DetectionResult) -> tuple[Path, ...]:
    """Write detections.csv, recall.csv, detections.md, detections.json and detections.png.

    Everything is made before the first file is written, and each file is whole or absent.

    Args:
        out: Folder to write to.
        result: Judged methods.

    Returns:
        Paths of the files.

    Raises:
        DatasetError: `out` is a file.
        OSError: The folder cannot be written to.
    """
    check_output_folder(out)
    found = all_figures(result)
    files = {
        "detections.csv": csv_text(result, found).encode(),
        "recall.csv": recall_text(result).encode(),
        "detections.md": markdown(result, found).encode(),
        "detections.json": json_text(result, found).encode(),
        "detections.png": detections_page(result),
    }
    out.mkdir(parents=True, exist_ok=True)
    for name, content in files.items():
        write_atomic(out / name, content)
    return tuple(out / name for name in files)


def all_figures(result: DetectionResult) -> Figures:
    """Compute the figures of all methods.

    Args:
        result: Judged methods.

    Returns:
        Figures by method and name.
    """
    return {method.name: figures(method) for method in result.methods}


# ---------------------------------------------------------------------- tables


def csv_text(result: DetectionResult, found: Figures) -> str:
    """Write a line of figures for each method.

    Args:
        result: Judged methods.
        found: Their figures.

    Returns:
        CSV: each figure with the ends of its interval, then false alarms a scan by cause; what is unknown is
        empty.
    """
    head = ["method", "scans"]
    for name in FIGURE_NAMES:
        head += [name, f"{name}_low", f"{name}_high"]
    head += [f"false_{cause.replace(' ', '_')}_per_scan" for cause in CAUSES]
    lines = [",".join(head)]
    for method in result.methods:
        values: list[float | None] = []
        for figure in found[method.name].values():
            values += [figure.value, *(figure.interval or (None, None))]
        values += false_alarms(method.blocks.total).values()
        texts = ["" if value is None else f"{value:.6g}" for value in values]
        lines.append(",".join([method.name, str(result.scans), *texts]))
    return "\n".join(lines) + "\n"


def recall_text(result: DetectionResult) -> str:
    """Write the recall of every method by class and range.

    Args:
        result: Judged methods.

    Returns:
        CSV with a line for each method, class and range band that has echoes, with their number; bands "all"
        hold the sum of a class, with its objects.
    """
    head = "method,class,near_m,far_m,echoes,found,recall,objects,objects_found,object_recall"
    lines = [head]
    for method in result.methods:
        total = method.blocks.total
        for number in np.flatnonzero(total.echoes_by.sum(axis=0)):
            start = f"{method.name},{result.classes[number]}"
            echoes, found = total.echoes_by[:, number], total.found_by[:, number]
            objects, seen = int(total.objects_by[number]), int(total.objects_found_by[number])
            lines.append(f"{start},all,all,{_recall(echoes.sum(), found.sum())},{_recall(objects, seen)}")
            lines += [
                f"{start},{band * BAND_M:g},{(band + 1) * BAND_M:g},{_recall(echoes[band], found[band])},,,"
                for band in np.flatnonzero(echoes)
            ]
    return "\n".join(lines) + "\n"


def _recall(targets: int, found: int) -> str:
    return f"{int(targets)},{int(found)},{found / targets:.6g}"


def table_rows(result: DetectionResult, found: Figures) -> list[list[str]]:
    """Write the main figures of each method.

    Args:
        result: Judged methods.
        found: Their figures.

    Returns:
        For each method a text for each of `TABLE_COLUMNS`, that of AP with its interval where there is one.
    """
    rows = []
    for method in result.methods:
        of_method = found[method.name]
        count = of_method["detections_per_scan"].value or 0.0
        shares = [_share(of_method[name].value) for name in list(TABLE_COLUMNS)[2:]]
        interval = of_method["average_precision"].interval
        if interval is not None:
            shares[_AP] += f" ({interval[0]:.3f} to {interval[1]:.3f})"
        rows.append([method.name, f"{count:.0f}", *shares])
    return rows


def _share(value: float | None) -> str:
    return "" if value is None else f"{value:.3f}"


def intervals_text(result: DetectionResult) -> str:
    """Write what the intervals are, or why there are none.

    Args:
        result: Judged methods.

    Returns:
        A sentence.
    """
    text = why_no_intervals(result.blocks, result.travelled_m) or (
        f"in brackets the interval at {100 * CONFIDENCE:g} %, from {result.blocks} blocks of {BLOCK_M:g} m "
        f"or more, on the way of {result.travelled_m:.0f} m; those of all figures are in detections.csv"
    )
    return f"{text[0].upper()}{text[1:]}."


def markdown(result: DetectionResult, found: Figures) -> str:
    """Write the tables as Markdown: figures, false alarms by cause, recall by class.

    Args:
        result: Judged methods.
        found: Their figures.

    Returns:
        The text.
    """
    names = [method.name for method in result.methods]
    totals = [method.blocks.total for method in result.methods]
    lines = [f"# Detections in {result.folder}", "", conditions(result), ""]
    lines += _table(list(TABLE_COLUMNS.values()), table_rows(result, found))
    lines += ["", intervals_text(result)]
    lines += ["", "False alarms a scan, by what they fell on:", ""]
    alarms = [false_alarms(total) for total in totals]
    rows = [[cause, *(f"{each[cause]:.1f}" for each in alarms)] for cause in CAUSES]
    lines += _table(["cause", *names], [row for row in rows if any(float(text) for text in row[1:])])
    lines += ["", "Recall by class, of echoes and (in brackets) of objects:", ""]
    echoes = totals[0].echoes_by.sum(axis=0)
    rows = [
        [
            result.classes[number],
            f"{echoes[number] / result.scans:.1f}",
            *(_both(each, number) for each in totals),
        ]
        for number in np.flatnonzero(echoes).tolist()
    ]
    lines += _table(["class", "echoes a scan", *names], rows)
    return "\n".join(lines) + "\n"


def conditions(result: DetectionResult) -> str:
    """Write how the methods were judged.

    Args:
        result: Judged methods.

    Returns:
        A sentence.
    """
    settings = result.settings
    targets = "direct static echoes" if settings.targets == "static" else "direct echoes"
    scans = "1 scan" if result.scans == 1 else f"{result.scans} scans"
    return (
        f"{scans}, {targets} from {result.near_m:.0f} to {result.far_m:.0f} m; a detection is "
        f"true within {settings.tolerance_m:g} m of one; recall of echoes of {settings.min_snr_db:g} dB or "
        "more above the noise."
    )


def _both(total, number: int) -> str:
    """Return the recall of a class, of echoes and of objects."""
    echoes = total.found_by[:, number].sum() / total.echoes_by[:, number].sum()
    return f"{echoes:.2f} ({total.objects_found_by[number] / total.objects_by[number]:.2f})"


def _table(head: list[str], rows: list[list[str]]) -> list[str]:
    ruler = "|".join(["---", *["---:"] * (len(head) - 1)])
    return [f"| {' | '.join(head)} |", f"|{ruler}|", *(f"| {' | '.join(row)} |" for row in rows)]


# ---------------------------------------------------------------------- JSON


def json_text(result: DetectionResult, found: Figures) -> str:
    """Write everything that was counted as JSON.

    Args:
        result: Judged methods.
        found: Their figures.

    Returns:
        The text; what is unknown is null.
    """
    content = {
        "folder": result.folder,
        "scans": result.scans,
        "near_m": result.near_m,
        "far_m": result.far_m,
        "settings": asdict(result.settings),
        "intervals": {
            "confidence": CONFIDENCE,
            "travelled_m": result.travelled_m,
            "block_m": BLOCK_M,
            "blocks": result.blocks,
            "none_because": why_no_intervals(result.blocks, result.travelled_m),
        },
        "data": {key: result.manifest[key] for key in ("config", "versions")},
        "versions": {
            "python": platform.python_version(),
            **{package: package_version(package) for package in _PACKAGES},
        },
        "methods": {method.name: _content(method, found[method.name]) for method in result.methods},
    }
    return json.dumps(content, indent=1, allow_nan=False) + "\n"


def _content(method: JudgedMethod, found: dict[str, Figure]) -> dict[str, Any]:
    total = method.blocks.total
    low, high = method.score_limits
    curve, levels = total.curve, total.labels.shape[-1]
    return {
        "settings": method.record,
        "figures": {name: asdict(figure) for name, figure in found.items()},
        "best_threshold": best_threshold(method),
        "false_alarms_per_scan": false_alarms(total),
        "mean_score": mean_scores(method),
        "score": {"name": method.score_name, "low": low, "high": high},
        "curve": {
            "threshold": [low + level * (high - low) / levels for level in range(levels)],
            "precision": [finite(value) for value in curve.precision],
            "recall": [finite(value) for value in curve.recall],
        },
    }
