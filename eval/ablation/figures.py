"""A picture an artefact: part of one scan without it, with it, and the difference, on the same scale in dB.

The part shown is that which the effect changes most (eval/ablation/crop.py); effects: eval/ablation/cases.py.
"""

import io
from collections.abc import Sequence
from pathlib import Path

import numpy as np
from matplotlib.axes import Axes
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.colors import Colormap, LinearSegmentedColormap, Normalize, to_rgb
from matplotlib.figure import Figure
from matplotlib.image import AxesImage
from matplotlib.patches import Polygon
from numpy.typing import NDArray
from PIL import Image

from echoscape.eval.ablation.crop import Part, above_part, most_changed, polar_part
from echoscape.eval.ablation.run import (
    Change,
    Progress,
    Shown,
    changes,
    shown_effects,
    strength_text,
    table,
)
from echoscape.eval.figures.preview import ACCENT, FAINT, INK
from echoscape.eval.figures.style import HEAT, PAGE
from echoscape.sim.datasets.files.atomic_write import check_out, write_whole
from echoscape.sim.datasets.polar_scan import PolarScan
from echoscape.sim.generation.config import SimulationConfig

BRIGHTEST_DB, MOST_CHANGE_DB = 50.0, 20.0
"""Ends of the two scales [dB]."""
CHANGE = LinearSegmentedColormap.from_list("change", ["#4fb3ff", "#1c4a7a", "#0b0e13", "#8a4a16", "#ffb454"])
WITHOUT, WITH = np.array([1.0, 0.25, 0.2]), np.array([0.15, 0.85, 0.95])
"""Colours of a scan without and with an effect where the two are laid over each other: together white."""
MOVER = "#5dff8f"
_PANELS = 3


def write_artefacts(
    out: Path,
    config: SimulationConfig,
    index: int,
    *,
    names: Sequence[str] = (),
    progress: Progress | None = None,
) -> tuple[list[Change], tuple[Path, ...]]:
    """Write a picture for each effect and artefacts.md to `out`; return what each changes, and the paths.

    Everything is made before the first file is written, and each is whole or absent.

    Raises:
        ValueError, SceneError: see `eval.ablation.cases.shown_effects`.
        DatasetError: `out` is a file.
        OSError: the folder cannot be written to.
    """
    check_out(out)
    report = progress or (lambda stage, done, total: None)
    every = shown_effects(config, index, names=names, progress=progress)
    rows = [row for shown in every for row in changes(shown)]
    files = {}
    for done, shown in enumerate(every):
        report("pictures", done, len(every))
        files[f"{shown.effect.name}.png"] = picture(shown)
    report("pictures", len(every), len(every))
    files["artefacts.md"] = table(rows).encode()
    out.mkdir(parents=True, exist_ok=True)
    for name, content in files.items():
        write_whole(out / name, content)
    return rows, tuple(out / name for name in files)


def picture(shown: Shown) -> bytes:
    """Return the picture of an effect as a PNG."""
    part = most_changed(shown)
    polar = shown.effect.view == "polar"
    figure = Figure(figsize=(4.05 * _PANELS, 4.6 if not polar else 3.3), dpi=100, facecolor=PAGE)
    FigureCanvasAgg(figure)
    top, bottom = (0.87, 0.115) if not polar else (0.83, 0.2)
    grid = figure.add_gridspec(1, _PANELS, left=0.045, right=0.985, top=top, bottom=bottom, wspace=0.1)
    axes = [figure.add_subplot(grid[0, place]) for place in range(_PANELS)]
    pictures = [polar_part(scan, part) if polar else above_part(scan, part) for scan in shown.scans]
    images = []
    for place, (each, values) in enumerate(zip(axes, pictures, strict=False)):
        _titled(each, _strength_title(shown, place))
        images.append(_show(each, values, part, polar=polar, colours=HEAT, scale=Normalize(0, BRIGHTEST_DB)))
    if len(pictures) < _PANELS:
        images.append(_compared(axes[-1], pictures, part, shown))
    if shown.effect.movers:
        for each in axes:
            _mark_movers(each, shown.scans[-1])
    _captioned(figure, shown, images)
    return _small_png(figure)


# ---------------------------------------------------------------------- drawing


def _show(
    axes: Axes, values: NDArray, part: Part, *, polar: bool, colours: Colormap, scale: Normalize
) -> AxesImage:
    """Draw values (dB, or colours with a last axis of 3) with metres, or degrees and metres, at the edges."""
    image = axes.imshow(
        values,
        extent=_extent(values, part, polar=polar),
        cmap=colours,
        norm=scale,
        aspect="auto" if polar else "equal",
        interpolation="antialiased",
    )
    axes.set(xlim=image.get_extent()[:2], ylim=image.get_extent()[2:], autoscale_on=False)
    if polar:
        axes.yaxis.set_major_formatter(lambda degrees, _: f"{degrees % 360:g}")
    else:
        axes.plot(0, 0, "^", ms=7, mfc=ACCENT, mec=PAGE, clip_on=True)
    return image


def _extent(values: NDArray, part: Part, *, polar: bool) -> tuple[float, float, float, float]:
    half = part.span_m / 2
    if polar:
        return 0.0, part.span_m, 0.9 * (part.row + len(values)), 0.9 * part.row
    return part.right_m - half, part.right_m + half, part.ahead_m - half, part.ahead_m + half


def _compared(axes: Axes, pictures: Sequence[NDArray], part: Part, shown: Shown) -> AxesImage:
    """Draw what the effect changes: the difference, or both in two colours."""
    polar = shown.effect.view == "polar"
    scale = Normalize(-MOST_CHANGE_DB, MOST_CHANGE_DB)
    if shown.effect.view == "overlay":
        _titled(axes, "red: off · cyan: on · white: both")
        light = [np.clip((values - 6) / 34, 0, 1)[..., None] for values in pictures]
        both = np.clip(light[0] * WITHOUT + light[1] * WITH, 0, 1)
        return _show(axes, both, part, polar=polar, colours=HEAT, scale=scale)
    _titled(axes, "difference")
    return _show(axes, pictures[1] - pictures[0], part, polar=polar, colours=CHANGE, scale=scale)


def _mark_movers(axes: Axes, scan: PolarScan) -> None:
    """Outline the movers' boxes at mid-scan, with an arrow as far as each gets in a second."""
    truth = scan.truth
    if truth is None:
        return
    boxes, here = truth.boxes, truth.middle_pose
    unit = np.array([(0.5, 0.5), (-0.5, 0.5), (-0.5, -0.5), (0.5, -0.5)])
    for centre, extent, yaw, speed in zip(boxes.centre, boxes.extent, boxes.yaw, boxes.velocity, strict=True):
        turn = np.array([[np.cos(yaw), -np.sin(yaw)], [np.sin(yaw), np.cos(yaw)]])
        corners = _seen(unit * extent[:2] @ turn.T + centre[:2], here)
        axes.add_patch(Polygon(corners, fill=False, ec=MOVER, lw=1.0))
        if np.hypot(*speed[:2]) > 0.5:
            start, end = _seen(np.array([centre[:2], centre[:2] + speed[:2]]), here)
            axes.annotate(
                "", end, start, arrowprops={"arrowstyle": "->", "color": MOVER}, annotation_clip=True
            )


def _seen(points: NDArray, here: NDArray) -> NDArray[np.float64]:
    """Return points (N, 2) of the world as (right, ahead) of the car at `here` (x, y, z, yaw) [m]."""
    cosine, sine = np.cos(here[3]), np.sin(here[3])
    return (points - here[:2]) @ np.array([[sine, cosine], [-cosine, sine]])


def _strength_title(shown: Shown, place: int) -> str:
    text = strength_text(shown.strengths[place], shown.effect.unit)
    return f"on: {text}" if place else text


def _titled(axes: Axes, title: str) -> None:
    axes.set_facecolor(PAGE)
    axes.tick_params(colors=FAINT, labelsize=8, length=0, pad=3)
    axes.spines[:].set_color("#2a313b")
    axes.set_title(title, size=11, color=INK, loc="left", pad=5)


def _captioned(figure: Figure, shown: Shown, images: Sequence[AxesImage]) -> None:
    """Write name and meaning above the panels, scales below them."""
    name = shown.effect.name.replace("_", " ")
    figure.text(0.045, 0.965, name, size=13, color=INK, weight="bold", va="center")
    figure.text(0.985, 0.965, shown.effect.text, size=10.5, color=FAINT, va="center", ha="right")
    axes = (
        "azimuth [deg] down, range [m] across"
        if shown.effect.view == "polar"
        else "ahead [m] up, right [m] across"
    )
    figure.text(0.045, 0.032, axes, size=9, color=FAINT, va="center")
    _scale(figure, images[0], (0.40, 0.022, 0.17, 0.022), "dB")
    if len(shown.scans) == 2 and shown.effect.view != "overlay":
        _scale(figure, images[-1], (0.77, 0.022, 0.17, 0.022), "dB")


def _scale(figure: Figure, image: AxesImage, place: tuple[float, float, float, float], unit: str) -> None:
    bar = figure.add_axes(place)
    low, high = image.get_clim()
    bar.imshow(np.linspace(0, 1, 256)[None], aspect="auto", cmap=image.get_cmap(), vmin=0, vmax=1)
    bar.set_axis_off()
    for x, value, side in ((0, low, "right"), (1, high, "left")):
        text = f"{value:g} {unit}" if x else f"{value:g}"
        bar.annotate(text, (x, 0.5), xytext=(6 * (2 * x - 1), 0), xycoords="axes fraction",
                     textcoords="offset points", size=9, color=FAINT, va="center", ha=side)  # fmt: skip


def _small_png(figure: Figure) -> bytes:
    """Return a figure as a PNG of few colours: the two scales, ink, and coarse steps of all others."""
    canvas = FigureCanvasAgg(figure)
    canvas.draw()
    whole = Image.fromarray(np.asarray(canvas.buffer_rgba())[..., :3])
    palette = Image.new("P", (1, 1))
    palette.putpalette(_palette().tobytes())
    data = io.BytesIO()
    whole.quantize(palette=palette, dither=Image.Dither.NONE).save(data, "png", optimize=True)
    return data.getvalue()


def _palette() -> NDArray[np.uint8]:
    """Return the colours (N, 3) that pictures are made of."""
    page, inks = np.array(to_rgb(PAGE)), [np.array(to_rgb(ink)) for ink in (INK, ACCENT, MOVER)]
    fades = [page + (ink - page) * share for ink in inks for share in np.linspace(0, 1, 8)]
    steps = np.linspace(0, 1, 7)
    overlay = [np.clip(red * WITHOUT + cyan * WITH, 0, 1) for red in steps for cyan in steps]
    scales = [HEAT(np.linspace(0, 1, 64))[:, :3], CHANGE(np.linspace(0, 1, 47))[:, :3]]
    return np.rint(255 * np.concatenate([*scales, fades, overlay])).astype(np.uint8)
