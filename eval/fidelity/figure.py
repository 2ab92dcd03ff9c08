"""The statistics of a folder of scans as a page of plots: the folder, a reference folder, and the targets.

The panels are in eval/fidelity/panels.py; the last one lists the statistics out of tolerance.
"""

import math

from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.lines import Line2D

from echoscape.eval.fidelity.panels import PANELS
from echoscape.eval.fidelity.reference_values import TARGETS, Target
from echoscape.eval.fidelity.score import PASS, FidelityReport, number_text, span_text
from echoscape.eval.figures.style import (
    ACCENT,
    ERROR_COLOUR,
    FAINT,
    FRAME,
    INK,
    PANEL,
    TRUTH_COLOUR,
    font_family,
    new_page,
    png_bytes,
)

_LISTED = 14


def fidelity_page(report: FidelityReport) -> bytes:
    """Draw the page of a report.

    Args:
        report: The report.

    Returns:
        A PNG file.
    """
    figure = new_page(18, 15.2)
    targets = TARGETS.get(report.data.sensor, {})
    grid = figure.add_gridspec(
        4, 3, left=0.045, right=0.98, top=0.915, bottom=0.045, wspace=0.16, hspace=0.36
    )
    for place, (title, text, draw, mark) in enumerate(PANELS):
        axes = figure.add_subplot(grid[place // 3, place % 3])
        _prepare(axes, title, text)
        if report.reference is not None:
            draw(axes, report.reference, TRUTH_COLOUR)
        draw(axes, report.data, ACCENT)
        mark(axes, targets)
    _failures(figure.add_subplot(grid[3, 2]), report)
    _caption(figure, report)
    return png_bytes(figure)


def _caption(figure: Figure, report: FidelityReport) -> None:
    data, other = report.data, report.reference
    result = (
        f"{report.passed} of {report.judged} statistics pass"
        if report.judged
        else "no targets for this sensor"
    )
    text = f"{data.name}   ·   {data.scans} scans of {data.sensor}, codes in 0.5 dB   ·   {result}"
    title = {"color": INK, "weight": "bold", "va": "center", "family": font_family()}
    figure.text(0.045, 0.968, "Fidelity", size=25, **title)
    figure.text(0.98, 0.968, text, size=14, color=FAINT, va="center", ha="right", family=font_family())
    handles = [Line2D([], [], color=ACCENT, lw=3, label=data.name)]
    if other is not None:
        label = f"reference: {other.name}, {other.scans} scans"
        handles.append(Line2D([], [], color=TRUTH_COLOUR, lw=3, label=label))
    if report.judged:
        label = "target from real scans, with tolerance"
        handles.append(Line2D([], [], color=INK, marker="o", lw=1.5, label=label))
    figure.legend(handles=handles, loc="upper left", bbox_to_anchor=(0.13, 0.982), ncols=3, frameon=False,
                  labelcolor=INK, prop={"size": 12})  # fmt: skip


def _prepare(axes: Axes, title: str, text: str) -> None:
    axes.set_facecolor(PANEL)
    axes.grid(color=FRAME, lw=0.7)
    axes.set_axisbelow(True)
    axes.tick_params(colors=FAINT, labelsize=9.5, length=0)
    axes.spines[:].set_visible(False)
    axes.annotate(title, (0, 1), xytext=(0, 9), xycoords="axes fraction", textcoords="offset points",
                  size=13.5, color=INK, weight="bold")  # fmt: skip
    axes.annotate(text, (1, 1), xytext=(0, 9), xycoords="axes fraction", textcoords="offset points",
                  size=10, color=FAINT, ha="right")  # fmt: skip


# ---------------------------------------------------------------------- statistics out of tolerance


def _failures(axes: Axes, report: FidelityReport) -> None:
    """List the statistics that do not pass, the worst first."""
    failed = [score for score in report.scores if score.target is not None and score.verdict != PASS]
    failed.sort(key=lambda score: -_excess(score.value, score.target))
    _prepare(axes, "Out of tolerance", "worst first: value, target" if failed else "")
    axes.set(xticks=[], yticks=[], xlim=(0, 1), ylim=(_LISTED, 0))
    axes.grid(visible=False)
    if not failed:
        axes.text(0.03, 1, "none" if report.judged else "nothing to compare", color=INK, size=12)
    for place, score in enumerate(failed[:_LISTED]):
        y = place + 0.65
        axes.text(0.03, y, score.name.replace("_", " "), color=INK, size=10.5)
        axes.text(0.72, y, number_text(score.value), color=ERROR_COLOUR, size=10.5, ha="right")
        axes.text(0.97, y, span_text(score.target), color=FAINT, size=10.5, ha="right")
    if len(failed) > _LISTED:
        axes.annotate(f"and {len(failed) - _LISTED} more", (1, 0), xytext=(0, -12), color=FAINT, size=10,
                      xycoords="axes fraction", textcoords="offset points", ha="right")  # fmt: skip


def _excess(value: float, target: Target | None) -> float:
    """Return how far a value lies outside its limits, in half widths of what passes."""
    if target is None or math.isnan(value):
        return math.inf
    low, high = target.limits
    return max(low - value, value - high) / max((high - low) / 2, 1e-9)
