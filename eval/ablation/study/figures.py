"""Figures of an ablation: the cost of every condition at a glance, and curves over strengths.

Both show paired differences from the default condition with their intervals over drives.
"""

import math
from collections.abc import Sequence

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from echoscape.eval.ablation.study.conditions import ARTEFACTS, Condition, strength_text
from echoscape.eval.ablation.study.results import metric
from echoscape.eval.ablation.study.settings import AblationStudy
from echoscape.eval.ablation.study.tables import AblationRow, condition_label
from echoscape.eval.figures.style import (
    ACCENT,
    COMPONENT_COLOURS,
    ERROR_COLOUR,
    FAINT,
    FRAME,
    INK,
    PAGE,
    TRUTH_COLOUR,
    new_page,
    png_bytes,
    style_curves,
)
from echoscape.eval.statistics.intervals import caution

_METRICS = ("translation_error_mean", "rotation_error_mean")
_COLOURS = (
    ACCENT,
    TRUTH_COLOUR,
    COMPONENT_COLOURS["multipath in place"],
    COMPONENT_COLOURS["spoke"],
    COMPONENT_COLOURS["sidelobe"],
    ERROR_COLOUR,
    INK,
)
_COLUMNS = 4
_LINEAR_PERCENT = 10.0
"""Change up to which the scale of the summary is linear, beyond it logarithmic [%]."""
_TICKS_PERCENT = (-100, -30, -10, 0, 10, 30, 100, 300, 1000, 3000, 10_000)


def summary_figure(study: AblationStudy, rows: Sequence[AblationRow]) -> bytes:
    """Draw what every condition costs every method, relative to its error under the default condition.

    Args:
        study: The ablation.
        rows: Its rows.

    Returns:
        A PNG file.
    """
    changed = study.conditions[1:]
    height = 1.7 + (0.12 + 0.17 * len(study.methods)) * len(changed)
    figure = new_page(13.0, height)
    grid = figure.add_gridspec(
        1, 2, left=0.2, right=0.98, top=1 - 0.95 / height, bottom=0.65 / height, wspace=0.06
    )
    for column, name in enumerate(_METRICS):
        axes = figure.add_subplot(grid[column])
        style_curves(axes, f"{metric(name).title}: change [% of default]", "")
        _forest(axes, study, [row for row in rows if row.metric.name == name])
        labels = [condition_label(each) for each in changed] if column == 0 else []
        axes.set_yticks(range(len(changed)), labels=labels or [""] * len(changed), color=INK)
        axes.set_ylim(len(changed) - 0.5, -0.5)
    remark = "" if caution(len(study.drives)) else "filled: the interval leaves out 0"
    _headed(figure, study, "What each artefact costs", remark, left=0.02)
    return png_bytes(figure)


def curves_figure(study: AblationStudy, rows: Sequence[AblationRow]) -> bytes:
    """Draw the difference in error over the strength of each artefact and fault.

    Args:
        study: The ablation.
        rows: Its rows.

    Returns:
        A PNG file; the summary where no two conditions differ in one strength alone.
    """
    names = [name for name in _names(study) if len(_curve(study, name)) > 1]
    if not names:
        return summary_figure(study, rows)
    columns = min(_COLUMNS, len(names))
    blocks = math.ceil(len(names) / columns)
    width, height = max(3.5 * columns + 0.75, 7.5), 0.7 + 4.3 * blocks
    figure = new_page(width, height)
    grid = figure.add_gridspec(
        blocks,
        columns,
        left=1.0 / width,
        right=1 - 0.45 / width,
        top=1 - 1.15 / height,
        bottom=0.45 / height,
        wspace=0.32,
        hspace=0.3,
    )
    for place, name in enumerate(names):
        pair = grid[place // columns, place % columns].subgridspec(2, 1, hspace=0.1)
        for line, metric_name in enumerate(_METRICS):
            axes = figure.add_subplot(pair[line])
            what, unit = metric_name.split("_")[0], metric(metric_name).unit
            style_curves(axes, "", f"{what} [{unit}]" if place % columns == 0 else "")
            axes.yaxis.set_label_coords(-0.27, 0.5)
            if line == 0:
                axes.set_title(name.replace("_", " "), size=12, color=INK, loc="left")
            _draw_curve(axes, study, name, [row for row in rows if row.metric.name == metric_name])
            axes.tick_params(labelbottom=line > 0)
    _headed(figure, study, "Difference in the mean error of a pair", "dotted: default", left=1.0 / width)
    return png_bytes(figure)


def _forest(axes: Axes, study: AblationStudy, rows: Sequence[AblationRow]) -> None:
    """Draw a dot with its interval for each condition and method; `rows` are of one metric."""
    step = 0.62 / max(len(study.methods), 1)
    axes.axvline(0, color=FAINT, lw=1)
    ends = [0.0]
    for number, method in enumerate(study.methods):
        offset = (number - (len(study.methods) - 1) / 2) * step
        by_name = {row.condition.name: row.compared for row in rows if row.method == method.name}
        for place, condition in enumerate(study.conditions[1:]):
            found = by_name.get(condition.name)
            if found is None or not found.default > 0:
                continue
            low, middle, high = (
                100 * each / found.default for each in (found.low, found.difference, found.high)
            )
            colour = _COLOURS[number % len(_COLOURS)]
            axes.plot([low, high], [place + offset] * 2, color=colour, lw=2, alpha=0.75)
            filled = colour if found.is_clear else PAGE
            axes.plot(middle, place + offset, "o", ms=6, mec=colour, mfc=filled)
            ends += [each for each in (low, middle, high) if math.isfinite(each)]
    for place in range(1, len(study.conditions) - 1):
        axes.axhline(place - 0.5, color=FRAME, lw=0.6)
    axes.set_xscale("symlog", linthresh=_LINEAR_PERCENT, linscale=0.8)
    reach = [tick for tick in _TICKS_PERCENT if 1.3 * min(ends) - 3 <= tick <= 1.3 * max(ends) + 3]
    axes.set_xticks(reach, labels=[f"{tick:+d}" if tick else "0" for tick in reach])
    axes.set_xlim(1.15 * min(ends) - 3, 1.15 * max(ends) + 3)
    axes.minorticks_off()


def _names(study: AblationStudy) -> list[str]:
    """Return the artefacts and faults that the ablation varies."""
    return [*dict.fromkeys(name for condition in study.conditions for name, _ in condition.levels)]


def _default_strength(study: AblationStudy, name: str) -> float:
    artefacts, faults = study.conditions[0].strengths(study.drives[0].config.sensor)
    return getattr(artefacts if name in ARTEFACTS else faults, name)


def _curve(study: AblationStudy, name: str) -> list[tuple[float, Condition]]:
    """Return the strengths of an artefact with their conditions, all else at the default, in order."""
    default = _default_strength(study, name)
    found = {default: study.conditions[0]}
    for condition in study.conditions:
        levels = dict(condition.levels)
        others = [each for each in levels if each != name]
        if name in levels and all(levels[each] == _default_strength(study, each) for each in others):
            found.setdefault(levels[name], condition)
    return sorted(found.items())


def _draw_curve(axes: Axes, study: AblationStudy, name: str, rows: Sequence[AblationRow]) -> None:
    """Draw the differences of all methods over the strength; `rows` are of one metric."""
    curve = _curve(study, name)
    axes.axhline(0, color=FAINT, lw=1)
    default = [strength for strength, _ in curve].index(_default_strength(study, name))
    axes.axvline(default, color=FAINT, lw=1, ls=":")
    for number, method in enumerate(study.methods):
        by_name = {row.condition.name: row.compared for row in rows if row.method == method.name}
        shift = 0.08 * (number - (len(study.methods) - 1) / 2)
        x = [place + shift for place, (_, each) in enumerate(curve) if each.name in by_name]
        found = [by_name[each.name] for _, each in curve if each.name in by_name]
        y = np.array([each.difference for each in found])
        spread = np.nan_to_num([[each.difference - each.low, each.high - each.difference] for each in found])
        colour = _COLOURS[number % len(_COLOURS)]
        axes.errorbar(x, y, np.maximum(spread.T, 0), fmt="-o", ms=4.5, lw=1.4, elinewidth=1.6, color=colour)
    axes.set_xticks(range(len(curve)), labels=[strength_text(name, strength) for strength, _ in curve])
    axes.tick_params(axis="x", labelsize=8.5)
    axes.margins(x=0.12)


def _headed(figure: Figure, study: AblationStudy, title: str, remark: str, *, left: float) -> None:
    """Write title, legend and what intervals are above the axes."""
    width, height = figure.get_size_inches()
    figure.text(left, 1 - 0.33 / height, title, size=17, color=INK, weight="bold", va="center")
    x = left
    for number, method in enumerate(study.methods):
        colour = _COLOURS[number % len(_COLOURS)]
        figure.text(x, 1 - 0.66 / height, f"● {method.name}", size=11, color=colour, va="center")
        x += (0.35 + 0.1 * len(method.name)) / width
    drives = len(study.drives)
    few = ", too few for 95 %" if caution(drives) else ""
    bars = f"{drives} drives of {study.scans} scans; bars: 95 % over drives{few}"
    what = bars if drives > 1 else f"1 drive of {study.scans} scans, no intervals"
    text = "; ".join([what, *([remark] if remark else [])])
    figure.text(1 - 0.3 / width, 1 - 0.66 / height, text, size=10, color=FAINT, va="center", ha="right")
