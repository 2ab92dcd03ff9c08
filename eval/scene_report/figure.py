"""A scene on one page: the plan with its drive and targets, and beside it what it is made of.

The plan has the world's axes in metres, so that places for targets and way-points can be read off it.
"""

import io
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from matplotlib import font_manager, patheffects
from matplotlib.axes import Axes
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure
from matplotlib.patches import Rectangle
from numpy.typing import NDArray
from PIL import Image

from echoscape.eval.figures.preview import ACCENT, FAINT, INK
from echoscape.eval.figures.style import PAGE
from echoscape.eval.figures.target_markers import TARGET_COLOUR
from echoscape.eval.figures.town_plan import COLOURS, Window, plan_picture
from echoscape.eval.scene_report.statistics import Inventory
from echoscape.scenes.core.targets import PlacedTarget

_SIZE_IN = (16.0, 10.6)
_DPI = 100
_PLAN = (0.035, 0.045, 0.70, 0.875)
"""Left, bottom, width and height of the plan, as shares of the page."""
_COLUMN = 0.765
_LINE = 0.0205
_PIXELS = 1120
_ARROW = np.array([(3.8, 0.0), (-2.6, 2.4), (-1.2, 0.0), (-2.6, -2.4), (3.8, 0.0)])
_ASPECT = _PLAN[2] * _SIZE_IN[0] / (_PLAN[3] * _SIZE_IN[1])
_INSET = 0.28
"""Side of the picture of the detail, as a share of the plan's."""
_SMALL = 0.15
"""Share of the plan's width below which drive and targets are drawn once more."""
_STEPS_M = (1000, 500, 200, 100, 50, 20, 10, 5, 2, 1)


@dataclass(frozen=True, kw_only=True)
class Picture:
    """What a page shows: a scene file, its numbers, way (P, 2) of the drive [m] or None, test targets."""

    scene_file: Path
    title: str
    numbers: Inventory
    way: NDArray[np.float64] | None
    targets: tuple[PlacedTarget, ...]
    all_faces: bool


def scene_page(picture: Picture) -> bytes:
    """Return the page of a scene as a PNG.

    Raises:
        DatasetError: the scene file is absent or no scene; the message names it.
    """
    figure = Figure(figsize=_SIZE_IN, dpi=_DPI, facecolor=PAGE)
    canvas = FigureCanvasAgg(figure)
    _text(figure, 0.035, 0.955, "echoscape", size=22, weight="bold")
    _text(figure, _PLAN[0] + _PLAN[2], 0.955, picture.title, size=12, color=FAINT, ha="right")
    _plan(figure.add_axes(_PLAN), picture)
    _column(figure, picture)
    canvas.draw()
    data = io.BytesIO()
    Image.fromarray(np.asarray(canvas.buffer_rgba())[..., :3]).save(data, "png", optimize=True)
    return data.getvalue()


def scene_window(picture: Picture) -> Window:
    """Return the part of the world that the plan shows: all of it, with some room, as wide as the page is."""
    edges = np.array([picture.numbers.low_m[:2], picture.numbers.high_m[:2]])
    return _framed(np.concatenate([edges, _marked(picture)]), room=0.03)


def detail_window(picture: Picture) -> Window | None:
    """Return the part round drive and targets if it is too small to be seen in the whole, else None."""
    marked = _marked(picture)
    if len(marked) == 0:
        return None
    whole, near = scene_window(picture), _framed(marked, room=0.25)
    return near if near[2] - near[0] < _SMALL * (whole[2] - whole[0]) else None


def _marked(picture: Picture) -> NDArray[np.float64]:
    """Return the points (P, 2) of the drive and the targets [m]."""
    places = [target.target.position_m[:2] for target in picture.targets]
    way = np.zeros((0, 2)) if picture.way is None else picture.way
    return np.concatenate([way, np.array(places).reshape(-1, 2)])


def _framed(points: NDArray[np.float64], *, room: float) -> Window:
    """Return the window round points (P, 2), `room` of their extent wider, of the plan's shape."""
    low, high = points.min(axis=0), points.max(axis=0)
    (x, y), half = ((low + high) / 2).tolist(), (0.5 + room) * (high - low) + 1.0
    tall = max(float(half[1]), float(half[0]) / _ASPECT)
    return x - tall * _ASPECT, y - tall, x + tall * _ASPECT, y + tall


# ---------------------------------------------------------------------- the plan


def _plan(axes: Axes, picture: Picture) -> None:
    """Draw the whole scene, and what happens in it once more where it would be too small."""
    window, detail = scene_window(picture), detail_window(picture)
    _draw_part(axes, picture, window, pixels=_PIXELS, numbered=detail is None)
    axes.tick_params(colors=FAINT, labelsize=9, length=3, pad=4)
    if detail is None:
        return
    right = (detail[0] + detail[2]) / 2 < (window[0] + window[2]) / 2
    inset = axes.inset_axes((1 - _INSET if right else 0.0, 1 - _INSET, _INSET, _INSET))
    inset.set(xticks=[], yticks=[])
    _draw_part(inset, picture, detail, pixels=int(_INSET * _PIXELS), numbered=True)
    inset.spines[:].set(color=INK, linewidth=1.0)
    corner, size = detail[:2], (detail[2] - detail[0], detail[3] - detail[1])
    axes.add_patch(Rectangle(corner, *size, fill=False, ec=INK, lw=1.0))


def _draw_part(axes: Axes, picture: Picture, window: Window, *, pixels: int, numbered: bool) -> None:
    image = plan_picture(picture.scene_file, window, pixels=pixels, all_faces=picture.all_faces)
    extent = (window[0], window[2], window[1], window[3])
    axes.imshow(image, extent=extent, interpolation="antialiased", aspect="auto")
    axes.set(xlim=extent[:2], ylim=extent[2:])
    axes.spines[:].set(color="#2a313b", linewidth=0.8)
    if picture.way is not None:
        _draw_way(axes, picture.way, large=numbered)
    if numbered:
        for number, target in enumerate(picture.targets, 1):
            _draw_target(axes, number, target, reach=0.04 * (window[3] - window[1]))
    _draw_scale(axes, window)


def _draw_way(axes: Axes, way: NDArray[np.float64], *, large: bool) -> None:
    """Draw the drive, and where large where it begins and which way it ends."""
    glow = [patheffects.Stroke(linewidth=6, foreground=PAGE, alpha=0.6), patheffects.Normal()]
    axes.plot(*way.T, color=ACCENT, lw=2.8, solid_capstyle="round", path_effects=glow)
    if not large:
        return
    axes.plot(*way[0], "o", ms=9, mfc=PAGE, mec=ACCENT, mew=2.2)
    moved = np.flatnonzero(np.hypot(*(way - way[-1]).T) > 0.05)
    if len(moved):
        cos, sin = (way[-1] - way[moved[-1]]) / np.hypot(*(way[-1] - way[moved[-1]]))
        axes.plot(*way[-1], marker=_ARROW @ [[cos, sin], [-sin, cos]], ms=17, mfc=ACCENT, mec=PAGE)


def _draw_target(axes: Axes, number: int, placed: PlacedTarget, *, reach: float) -> None:
    """Draw a numbered dot and the direction that the target looks in."""
    target = placed.target
    x, y, _ = target.position_m
    ahead = reach * np.array([np.cos(target.heading_rad), np.sin(target.heading_rad)])
    axes.plot([x, x + ahead[0]], [y, y + ahead[1]], color=TARGET_COLOUR, lw=2)
    axes.plot(x, y, "o", ms=7, mfc=TARGET_COLOUR, mec=PAGE, mew=1)
    axes.annotate(str(number), (x, y), xytext=(6, 6), textcoords="offset points", color=INK, size=10,
                  weight="bold", family=_family(),
                  path_effects=[patheffects.withStroke(linewidth=3, foreground=PAGE)])  # fmt: skip


def _draw_scale(axes: Axes, window: Window) -> None:
    width = window[2] - window[0]
    length = next((step for step in _STEPS_M if step < 0.2 * width), _STEPS_M[-1])
    x, y = window[2] - 0.03 * width, window[1] + 0.03 * width
    glow = [patheffects.withStroke(linewidth=5, foreground=PAGE)]
    axes.plot([x - length, x], [y, y], color=INK, lw=2.4, solid_capstyle="butt", path_effects=glow)
    axes.annotate(f"{length} m", (x - length / 2, y), xytext=(0, 6), textcoords="offset points", color=INK,
                  size=10, ha="center", family=_family(), path_effects=glow)  # fmt: skip


# ---------------------------------------------------------------------- the column beside it


def _column(figure: Figure, picture: Picture) -> None:
    """Write the scene's numbers from the top down."""
    numbers = picture.numbers
    size = np.subtract(numbers.high_m, numbers.low_m)
    y = _heading(figure, 0.92, "Scene")
    y = _row(figure, y, "size", f"{size[0]:,.0f} × {size[1]:,.0f} m, {size[2]:.1f} m high")
    y = _row(figure, y, "triangles stored", f"{numbers.triangles_stored:,}")
    y = _row(figure, y, "triangles placed", f"{numbers.triangles_placed:,}")
    if picture.way is not None:
        length = float(np.hypot(*np.diff(picture.way, axis=0).T).sum())
        y = _row(figure, y, "drive", f"{length:,.0f} m", colour=ACCENT)
    y = _heading(figure, y, "Objects")
    for name, count in numbers.classes.items():
        y = _row(figure, y, name.replace("_", " "), f"{count.objects:,}")
    y = _heading(figure, y, "Materials")
    for name, material in numbers.materials.items():
        y = _row(figure, y, name, f"{material.area_m2:,.0f} m²", colour=COLOURS.get(name, "#888888"))
    if picture.targets:
        y = _heading(figure, y, "Targets")
    told = max(0, int((y - 0.03) / _LINE))
    for number, placed in enumerate(picture.targets[:told], 1):
        place = ", ".join(f"{value:.1f}" for value in placed.target.position_m)
        y = _row(figure, y, f"{number}  {placed.target.kind}", place, colour=TARGET_COLOUR)
    if len(picture.targets) > told:
        _row(figure, y, f"and {len(picture.targets) - told} more", "")


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
    figure.text(x, y, text, size=size, color=color, ha=ha, weight=weight, va="center", family=_family())


def _family() -> list[str]:
    """Return the best-looking typeface that is there."""
    known = {font.name for font in font_manager.fontManager.ttflist}
    return [name for name in ("Inter", "Source Sans 3", "Open Sans", "DejaVu Sans") if name in known]
