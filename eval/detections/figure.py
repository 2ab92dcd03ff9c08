"""The figure of judged detectors: curves, recall by range, causes of false alarms, and one scan a method."""

from collections.abc import Sequence

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from numpy.typing import NDArray

from echoscape.eval.detections.merit import CAUSES, false_alarms
from echoscape.eval.detections.run import DetectionResult, JudgedMethod
from echoscape.eval.detections.tally import BAND_M
from echoscape.eval.detections.targets import LABELS, MOVER, OUTSIDE, TARGET
from echoscape.eval.figures.style import (
    ACCENT,
    BOX_COLOUR,
    COMPONENT_COLOURS,
    FAINT,
    FRAME,
    INK,
    MOVING_COLOUR,
    TARGET_COLOUR,
    TRUTH_COLOUR,
    brightness,
    font_family,
    new_page,
    png_bytes,
    style_curves,
)
from echoscape.sim.datasets.cartesian import polar_to_cartesian

METHOD_COLOURS = (ACCENT, TRUTH_COLOUR, BOX_COLOUR, TARGET_COLOUR, "#b69cff", "#f7e95c")
"""Colours of methods in curves, in their order."""
LABEL_COLOURS = {**COMPONENT_COLOURS, MOVER: MOVING_COLOUR, "noise": "#8a94a1"}
"""Colours of what detections fell on; noise is lighter than on a scan, of which it is the background."""
LEAST_ECHOES = 20
"""Echoes of a range band from which its recall is drawn."""
_REACH_M = 100.0
_PIXELS = 600
_COLUMNS, _LEAST_COLUMNS = 4, 3
_FEW = 1000
"""Detections below which dots are larger."""
_WIDTH_IN = 18.0


def detections_page(result: DetectionResult) -> bytes:
    """Draw judged detectors.

    Args:
        result: Judged methods.

    Returns:
        The bytes of a PNG file.
    """
    rows = -(-len(result.methods) // _COLUMNS)
    columns = max(-(-len(result.methods) // rows), _LEAST_COLUMNS)
    side_in = 0.95 * _WIDTH_IN / columns
    top_in, scans_in = 6.4, rows * (side_in + 0.35)
    height_in = top_in + scans_in + 0.8
    page = new_page(_WIDTH_IN, height_in)
    _caption(page, result, height_in)
    curves = page.add_gridspec(
        1, 3, left=0.05, right=0.985, top=1 - 1.5 / height_in, bottom=1 - 5.8 / height_in, wspace=0.3
    )
    _curves(page.add_subplot(curves[0, 0]), result.methods)
    _recall(page.add_subplot(curves[0, 1]), result)
    _false_alarms(page.add_subplot(curves[0, 2]), result.methods)
    scans = page.add_gridspec(
        rows, columns, left=0.022, right=0.978, top=(scans_in + 0.35) / height_in, bottom=0.6 / height_in,
        wspace=0.04, hspace=0.1,
    )  # fmt: skip
    for place, method in enumerate(result.methods):
        _scan(page.add_subplot(scans[place // columns, place % columns]), result, method)
    _legend(page, result, height_in)
    return png_bytes(page)


def _caption(page: Figure, result: DetectionResult, height_in: float) -> None:
    style = {"va": "center", "family": font_family()}
    y = 1 - 0.5 / height_in
    page.text(0.022, y, "Detections", size=25, color=INK, weight="bold", **style)
    targets = "direct static echoes" if result.settings.targets == "static" else "direct echoes"
    scans = "1 scan" if result.scans == 1 else f"{result.scans} scans"
    text = (
        f"{result.folder}   ·   {scans}   ·   {targets}, {result.near_m:.0f} to "
        f"{result.far_m:.0f} m   ·   true within {result.settings.tolerance_m:g} m"
    )
    page.text(0.978, y, text, size=13, color=FAINT, ha="right", **style)


def _titled(axes: Axes, title: str, text: str = "") -> None:
    style = {"xycoords": "axes fraction", "textcoords": "offset points", "family": font_family()}
    axes.annotate(title, (0, 1), xytext=(0, 8), size=14, color=INK, weight="bold", **style)
    axes.annotate(text, (1, 1), xytext=(0, 8), size=11, color=FAINT, ha="right", **style)


def _coloured(methods: Sequence[JudgedMethod]) -> list[tuple[JudgedMethod, str]]:
    return [(each, METHOD_COLOURS[i % len(METHOD_COLOURS)]) for i, each in enumerate(methods)]


# ---------------------------------------------------------------------- curves


def _curves(axes: Axes, methods: Sequence[JudgedMethod]) -> None:
    """Draw precision over recall, with a dot for all detections of each method."""
    for method, colour in _coloured(methods):
        total = method.blocks.total
        curve = total.curve
        known = np.isfinite(curve.precision) & np.isfinite(curve.recall)
        label = f"{method.name}, AP {float(curve.average_precision):.2f}"
        axes.plot(curve.recall[known], curve.precision[known], color=colour, lw=2, label=label)
        if known[0]:
            axes.plot(curve.recall[0], curve.precision[0], "o", ms=7, color=colour)
    style_curves(axes, "recall of echoes", "precision of detections")
    axes.set(xlim=(0, 1), ylim=(0, 1.02))
    axes.legend(loc="lower right", frameon=False, labelcolor=INK, prop={"size": 11, "family": font_family()})
    _titled(axes, "Precision and recall", "by score; dot: all detections")


def _recall(axes: Axes, result: DetectionResult) -> None:
    """Draw the recall of echoes by range, where there are enough of them."""
    for method, colour in _coloured(result.methods):
        total = method.blocks.total
        echoes, found = total.echoes_by.sum(axis=1), total.found_by.sum(axis=1)
        bands = np.flatnonzero(echoes >= LEAST_ECHOES)
        axes.plot((bands + 0.5) * BAND_M, found[bands] / echoes[bands], ".-", ms=9, lw=2, color=colour)
    style_curves(axes, "range [m]", "recall of echoes")
    axes.set(xlim=(0, result.far_m), ylim=(0, 1.02))
    _titled(axes, "Recall by range", f"echoes {result.settings.min_snr_db:g} dB above the noise")


def _false_alarms(axes: Axes, methods: Sequence[JudgedMethod]) -> None:
    """Draw what the false detections fell on, as shares of all detections of each method."""
    labels = []
    for place, method in enumerate(methods):
        total = method.blocks.total
        alarms = false_alarms(total)
        detections = max(float(total.labels.sum() / max(int(total.scans), 1)), 1e-9)
        left = 0.0
        for cause in CAUSES:
            share = 100 * alarms[cause] / detections
            axes.barh(place, share, left=left, height=0.6, color=LABEL_COLOURS[cause], ec="none")
            left += share
        labels.append(f"{method.name}\n{sum(alarms.values()):.0f} of {detections:.0f}")
    style_curves(axes, "false alarms [% of the detections]; left: numbers in a scan", "")
    axes.set_yticks(range(len(methods)), labels, color=INK, size=10)
    axes.set(ylim=(len(methods) - 0.4, -0.6), xlim=(0, 100))
    axes.grid(visible=False, axis="y")
    _titled(axes, "False alarms by cause", "colours as below")


# ---------------------------------------------------------------------- the scan


def _scan(axes: Axes, result: DetectionResult, method: JudgedMethod) -> None:
    """Draw the scan from above, and the detections of a method in the colours of what they fell on."""
    scan = result.shown_scan
    image = polar_to_cartesian(
        scan.codes,
        scan.bin_m,
        first_rad=scan.first_azimuth_rad,
        pixel_m=2 * _REACH_M / _PIXELS,
        size=_PIXELS,
    )
    extent = (-_REACH_M, _REACH_M, -_REACH_M, _REACH_M)
    axes.imshow(0.7 * brightness(image), cmap="gray", vmin=0, vmax=1, extent=extent)
    right, forward = _places(result, method)
    size = 4.0 if len(method.shown) < _FEW else 2.6
    for number in np.unique(method.shown_labels[method.shown_labels != OUTSIDE]):
        of_label = method.shown_labels == number
        colour = LABEL_COLOURS[LABELS[number]]
        axes.plot(right[of_label], forward[of_label], "o", ms=size, mec="none", color=colour)
    axes.set(xlim=(-_REACH_M, _REACH_M), ylim=(-_REACH_M, _REACH_M), xticks=[], yticks=[])
    axes.spines[:].set(color=FRAME, linewidth=0.8)
    judged = int((method.shown_labels != OUTSIDE).sum())
    true = int((method.shown_labels == TARGET).sum())
    _titled(axes, method.name, f"scan {result.shown_number} (from 0): {true} of {judged} true")


def _places(result: DetectionResult, method: JudgedMethod) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Return the places of detections to the right and forward (N,) [m]."""
    scan, found = result.shown_scan, method.shown
    azimuth_rad = scan.first_azimuth_rad + found.azimuth * (2 * np.pi / len(scan.encoder))
    return found.range_m * np.sin(azimuth_rad), found.range_m * np.cos(azimuth_rad)


def _legend(page: Figure, result: DetectionResult, height_in: float) -> None:
    """Write what the colours of detections mean, those that occur only."""
    counts = np.sum([method.blocks.total.labels.sum(axis=-1) for method in result.methods], axis=0)
    present = [label for number, label in enumerate(LABELS) if counts[number]]
    shown = [label for label in LABEL_COLOURS if label in present]
    true = "direct, static" if result.settings.targets == "static" else "direct"
    names = {LABELS[TARGET]: f"true: {true}", "ghost": "displaced ghost"}
    page.legend(
        handles=[
            Line2D([], [], marker="o", ls="", ms=8, mec="none", mfc=LABEL_COLOURS[label],
                   label=names.get(label, label))
            for label in shown
        ],
        loc="lower left", bbox_to_anchor=(0.015, 0.05 / height_in), ncols=len(shown) or 1, frameon=False,
        labelcolor=INK, handletextpad=0.2, prop={"size": 12, "family": font_family()},
    )  # fmt: skip
