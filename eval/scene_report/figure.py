"""A scene on one page: its plan with the drive and the test targets, and beside it what it holds.

The plan has the axes of the world in metres, so that positions of targets and way-points can be read off it.
"""

from dataclasses import dataclass
from pathlib import Path

import numpy as np
from matplotlib import patheffects
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.patches import Rectangle
from numpy.typing import NDArray

from echoscape.eval.figures.style import (
    ACCENT,
    FAINT,
    FRAME,
    INK,
    MATERIAL_COLOURS,
    OTHER_COLOUR,
    PAGE,
    TARGET_COLOUR,
    font_family,
    new_page,
    png_bytes,
)
from echoscape.eval.figures.town_plan import Window, plan_image
from echoscape.eval.scene_report.statistics import Inventory
from echoscape.scenes.core.targets import PlacedTarget

_SIZE_IN = (16.0, 10.6)
_PLAN = (0.035, 0.045, 0.70, 0.875)
"""Left, bottom, width and height of the plan, as shares of the page."""
_COLUMN = 0.765
_LINE = 0.0205
_PIXELS = 1120
_ARROW = np.array([(3.8, 0.0), (-2.6, 2.4), (-1.2, 0.0), (-2.6, -2.4), (3.8, 0.0)])
_ASPECT = _PLAN[2] * _SIZE_IN[0] / (_PLAN[3] * _SIZE_IN[1])
_INSET = 0.28
"""Side of the inset with the detail, as a share of the plan's."""
_DETAIL_BELOW = 0.15
"""Share of the plan's width below which drive and targets are drawn in an inset as well."""
_STEPS_M = (1000, 500, 200, 100, 50, 20, 10, 5, 2, 1)


@dataclass(frozen=True, kw_only=True)
class ScenePlan:
    """What the page of a scene shows.

    Attributes:
        scene_file: The scene as glTF.
        title: Title of the page.
        inventory: Counts of the scene.
        path: Positions (P, 2) along the drive [m], None without a drive.
        targets: The test targets.
        all_faces: Whether faces that look down are drawn as well, as in `plan_image`.
    """

    scene_file: Path
    title: str
    inventory: Inventory
    path: NDArray[np.float64] | None
    targets: tuple[PlacedTarget, ...]
    all_faces: bool


def scene_page(plan: ScenePlan) -> bytes:
    """Draw the page of a scene.

    Args:
        plan: What the page shows.

    Returns:
        A PNG file.

    Raises:
        DatasetError: The scene file is absent or no scene; the message names it.
    """
    figure = new_page(*_SIZE_IN)
    _text(figure, 0.035, 0.955, "echoscape", size=22, weight="bold")
    _text(figure, _PLAN[0] + _PLAN[2], 0.955, plan.title, size=12, color=FAINT, ha="right")
    _plan(figure.add_axes(_PLAN), plan)
    _column(figure, plan)
    return png_bytes(figure)


def scene_window(plan: ScenePlan) -> Window:
    """Return the part of the world that the plan shows: all of it with a margin.

    Args:
        plan: What the page shows.

    Returns:
        A window with the aspect ratio of the plan.
    """
    edges = np.array([plan.inventory.low_m[:2], plan.inventory.high_m[:2]])
    return _window_around(np.concatenate([edges, _marked(plan)]), margin=0.03)


def detail_window(plan: ScenePlan) -> Window | None:
    """Return the part around drive and targets, if it is too small to be read in the whole plan.

    Args:
        plan: What the page shows.

    Returns:
        A window with the aspect ratio of the plan, None where no inset is needed.
    """
    marked = _marked(plan)
    if len(marked) == 0:
        return None
    whole, near = scene_window(plan), _window_around(marked, margin=0.25)
    return near if near[2] - near[0] < _DETAIL_BELOW * (whole[2] - whole[0]) else None


def _marked(plan: ScenePlan) -> NDArray[np.float64]:
    """Return the points (P, 2) of the drive and the targets [m]."""
    positions = [target.target.position_m[:2] for target in plan.targets]
    path = np.zeros((0, 2)) if plan.path is None else plan.path
    return np.concatenate([path, np.array(positions).reshape(-1, 2)])


def _window_around(points: NDArray[np.float64], *, margin: float) -> Window:
    """Return a window around points (P, 2), wider by `margin` of their extent, of the plan's shape."""
    low, high = points.min(axis=0), points.max(axis=0)
    (x, y), half = ((low + high) / 2).tolist(), (0.5 + margin) * (high - low) + 1.0
    tall = max(float(half[1]), float(half[0]) / _ASPECT)
    return x - tall * _ASPECT, y - tall, x + tall * _ASPECT, y + tall


# ---------------------------------------------------------------------- the plan


def _plan(axes: Axes, plan: ScenePlan) -> None:
    """Draw the whole scene, and an inset of drive and targets where they would be too small to read."""
    window, detail = scene_window(plan), detail_window(plan)
    _draw_part(axes, plan, window, pixels=_PIXELS, numbered=detail is None)
    axes.tick_params(colors=FAINT, labelsize=9, length=3, pad=4)
    if detail is None:
        return
    right = (detail[0] + detail[2]) / 2 < (window[0] + window[2]) / 2
    inset = axes.inset_axes((1 - _INSET if right else 0.0, 1 - _INSET, _INSET, _INSET))
    inset.set(xticks=[], yticks=[])
    _draw_part(inset, plan, detail, pixels=int(_INSET * _PIXELS), numbered=True)
    inset.spines[:].set(color=INK, linewidth=1.0)
    corner, size = detail[:2], (detail[2] - detail[0], detail[3] - detail[1])
    axes.add_patch(Rectangle(corner, *size, fill=False, ec=INK, lw=1.0))


def _draw_part(axes: Axes, plan: ScenePlan, window: Window, *, pixels: int, numbered: bool) -> None:
    image = plan_image(plan.scene_file, window, pixels=pixels, all_faces=plan.all_faces)
    extent = (window[0], window[2], window[1], window[3])
    axes.imshow(image, extent=extent, interpolation="antialiased", aspect="auto")
    axes.set(xlim=extent[:2], ylim=extent[2:])
    axes.spines[:].set(color=FRAME, linewidth=0.8)
    if plan.path is not None:
        _draw_drive(axes, plan.path, large=numbered)
    if numbered:
        for number, target in enumerate(plan.targets, 1):
            _draw_target(axes, number, target, reach=0.04 * (window[3] - window[1]))
    _draw_scale(axes, window)


def _draw_drive(axes: Axes, path: NDArray[np.float64], *, large: bool) -> None:
    """Draw the drive (P, 2); if `large` with a ring at its start and an arrow at its end."""
    edge = [patheffects.Stroke(linewidth=6, foreground=PAGE, alpha=0.6), patheffects.Normal()]
    axes.plot(*path.T, color=ACCENT, lw=2.8, solid_capstyle="round", path_effects=edge)
    if not large:
        return
    axes.plot(*path[0], "o", ms=9, mfc=PAGE, mec=ACCENT, mew=2.2)
    moved = np.flatnonzero(np.hypot(*(path - path[-1]).T) > 0.05)
    if len(moved):
        cos, sin = (path[-1] - path[moved[-1]]) / np.hypot(*(path[-1] - path[moved[-1]]))
        axes.plot(*path[-1], marker=_ARROW @ [[cos, sin], [-sin, cos]], ms=17, mfc=ACCENT, mec=PAGE)


def _draw_target(axes: Axes, number: int, placed: PlacedTarget, *, reach: float) -> None:
    """Draw a numbered dot and a line of length `reach` [m] along the heading of the target."""
    target = placed.target
    x, y, _ = target.position_m
    ahead = reach * np.array([np.cos(target.heading_rad), np.sin(target.heading_rad)])
    axes.plot([x, x + ahead[0]], [y, y + ahead[1]], color=TARGET_COLOUR, lw=2)
    axes.plot(x, y, "o", ms=7, mfc=TARGET_COLOUR, mec=PAGE, mew=1)
    axes.annotate(str(number), (x, y), xytext=(6, 6), textcoords="offset points", color=INK, size=10,
                  weight="bold", family=font_family(),
                  path_effects=[patheffects.withStroke(linewidth=3, foreground=PAGE)])  # fmt: skip


def _draw_scale(axes: Axes, window: Window) -> None:
    width = window[2] - window[0]
    length = next((step for step in _STEPS_M if step < 0.2 * width), _STEPS_M[-1])
    x, y = window[2] - 0.03 * width, window[1] + 0.03 * width
    edge = [patheffects.withStroke(linewidth=5, foreground=PAGE)]
    axes.plot([x - length, x], [y, y], color=INK, lw=2.4, solid_capstyle="butt", path_effects=edge)
    axes.annotate(f"{length} m", (x - length / 2, y), xytext=(0, 6), textcoords="offset points", color=INK,
                  size=10, ha="center", family=font_family(), path_effects=edge)  # fmt: skip


# ---------------------------------------------------------------------- the column beside it


def _column(figure: Figure, plan: ScenePlan) -> None:
    """Write the counts of the scene from the top down."""
    counts = plan.inventory
    size = np.subtract(counts.high_m, counts.low_m)
    y = _heading(figure, 0.92, "Scene")
    y = _row(figure, y, "size", f"{size[0]:,.0f} × {size[1]:,.0f} m, {size[2]:.1f} m high")
    y = _row(figure, y, "triangles stored", f"{counts.triangles_stored:,}")
    y = _row(figure, y, "triangles placed", f"{counts.triangles_placed:,}")
    if plan.path is not None:
        length = float(np.hypot(*np.diff(plan.path, axis=0).T).sum())
        y = _row(figure, y, "drive", f"{length:,.0f} m", colour=ACCENT)
    y = _heading(figure, y, "Objects")
    for name, count in counts.classes.items():
        y = _row(figure, y, name.replace("_", " "), f"{count.objects:,}")
    y = _heading(figure, y, "Materials")
    for name, material in counts.materials.items():
        y = _row(
            figure, y, name, f"{material.area_m2:,.0f} m²", colour=MATERIAL_COLOURS.get(name, OTHER_COLOUR)
        )
    if plan.targets:
        y = _heading(figure, y, "Targets")
    listed = max(0, int((y - 0.03) / _LINE))
    for number, placed in enumerate(plan.targets[:listed], 1):
        position = ", ".join(f"{value:.1f}" for value in placed.target.position_m)
        y = _row(figure, y, f"{number}  {placed.target.kind}", position, colour=TARGET_COLOUR)
    if len(plan.targets) > listed:
        _row(figure, y, f"and {len(plan.targets) - listed} more", "")


def _heading(figure: Figure, y: float, title: str) -> float:
    _text(figure, _COLUMN, y - 0.01, title, size=13, weight="bold")
    return y - 0.01 - 1.25 * _LINE


def _row(figure: Figure, y: float, name: str, value: str, *, colour: str | None = None) -> float:
    if colour is not None:
        patch = Rectangle((_COLUMN, y - 0.006), 0.008, 0.012, fc=colour, ec="none")
        patch.set_transform(figure.transFigure)
        figure.add_artist(patch)
    _text(figure, _COLUMN + 0.014, y, name, size=10.5, color=FAINT)
    _text(figure, 0.975, y, value, size=10.5, ha="right")
    return y - _LINE


def _text(
    figure: Figure, x: float, y: float, text: str, *, size: float,
    color: str = INK, ha: str = "left", weight: str = "normal",
) -> None:  # fmt: skip
    figure.text(x, y, text, size=size, color=color, ha=ha, weight=weight, va="center", family=font_family())
