"""The statistics of a folder of scans as a page of plots: the folder, a reference, and the real figures.

The panels stand in eval/fidelity/panels.py; the last one lists what is off.
"""

import io
import math

import numpy as np
from matplotlib.axes import Axes
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from PIL import Image

from echoscape.eval.fidelity.panels import PANELS
from echoscape.eval.fidelity.reference_values import TARGETS, Target
from echoscape.eval.fidelity.score import RIGHT, Fidelity, number_text, span_text
from echoscape.eval.figures.preview import ACCENT, FAINT, INK
from echoscape.eval.figures.style import PAGE

OTHER = "#59d0ff"
"""Colour of the reference."""
_PANEL, _GRID = "#131820", "#2a313b"
_OFF = "#ff6b6b"
_DPI = 100
_LISTED = 14


def page(result: Fidelity) -> bytes:
    """Return the page as a PNG."""
    figure = Figure(figsize=(18, 15.2), dpi=_DPI, facecolor=PAGE)
    canvas = FigureCanvasAgg(figure)
    targets = TARGETS.get(result.data.sensor, {})
    grid = figure.add_gridspec(
        4, 3, left=0.045, right=0.98, top=0.915, bottom=0.045, wspace=0.16, hspace=0.36
    )
    for place, (title, text, draw, mark) in enumerate(PANELS):
        axes = figure.add_subplot(grid[place // 3, place % 3])
        _prepare(axes, title, text)
        if result.reference is not None:
            draw(axes, result.reference, OTHER)
        draw(axes, result.data, ACCENT)
        mark(axes, targets)
    _verdicts(figure.add_subplot(grid[3, 2]), result)
    _caption(figure, result)
    canvas.draw()
    data = io.BytesIO()
    Image.fromarray(np.asarray(canvas.buffer_rgba())[..., :3]).save(data, "png", optimize=True)
    return data.getvalue()


def _caption(figure: Figure, result: Fidelity) -> None:
    data, other = result.data, result.reference
    right, judged = result.judged()
    told = f"{right} of {judged} figures right" if judged else "no targets for this sensor"
    text = f"{data.name}   ·   {data.scans} scans of {data.sensor}   ·   {told}"
    figure.text(0.045, 0.968, "Fidelity", size=25, color=INK, weight="bold", va="center")
    figure.text(0.98, 0.968, text, size=14, color=FAINT, va="center", ha="right")
    handles = [Line2D([], [], color=ACCENT, lw=3, label=data.name)]
    if other is not None:
        handles.append(
            Line2D([], [], color=OTHER, lw=3, label=f"reference: {other.name}, {other.scans} scans")
        )
    if judged:
        handles.append(Line2D([], [], color=INK, marker="o", lw=1.5, label="real scans, with tolerance"))
    figure.legend(handles=handles, loc="upper left", bbox_to_anchor=(0.13, 0.982), ncols=3, frameon=False,
                  labelcolor=INK, prop={"size": 12})  # fmt: skip


def _prepare(axes: Axes, title: str, text: str) -> None:
    axes.set_facecolor(_PANEL)
    axes.grid(color=_GRID, lw=0.7)
    axes.set_axisbelow(True)
    axes.tick_params(colors=FAINT, labelsize=9.5, length=0)
    axes.spines[:].set_visible(False)
    axes.annotate(title, (0, 1), xytext=(0, 9), xycoords="axes fraction", textcoords="offset points",
                  size=13.5, color=INK, weight="bold")  # fmt: skip
    axes.annotate(text, (1, 1), xytext=(0, 9), xycoords="axes fraction", textcoords="offset points",
                  size=10, color=FAINT, ha="right")  # fmt: skip


# ---------------------------------------------------------------------- verdicts


def _verdicts(axes: Axes, result: Fidelity) -> None:
    """List the figures that are not right, those farthest off first."""
    off = [row for row in result.rows if row.target is not None and row.verdict != RIGHT]
    off.sort(key=lambda row: -_distance(row.value, row.target))
    _prepare(axes, "What is off", "farthest first: value, target" if off else "")
    axes.set(xticks=[], yticks=[], xlim=(0, 1), ylim=(_LISTED, 0))
    axes.grid(visible=False)
    if not off:
        axes.text(0.03, 1, "nothing", color=INK, size=12)
    for place, row in enumerate(off[:_LISTED]):
        at = place + 0.65
        axes.text(0.03, at, row.name.replace("_", " "), color=INK, size=10.5)
        axes.text(0.72, at, number_text(row.value), color=_OFF, size=10.5, ha="right")
        axes.text(0.97, at, span_text(row.target), color=FAINT, size=10.5, ha="right")
    if len(off) > _LISTED:
        axes.annotate(f"and {len(off) - _LISTED} more", (1, 0), xytext=(0, -12), color=FAINT, size=10,
                      xycoords="axes fraction", textcoords="offset points", ha="right")  # fmt: skip


def _distance(value: float, target: Target | None) -> float:
    """Return how far a value lies outside its limits, in half widths of what is right."""
    if target is None or math.isnan(value):
        return math.inf
    low, high = target.limits
    return max(low - value, value - high) / max((high - low) / 2, 1e-9)
