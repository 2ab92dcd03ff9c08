"""One figure for each artefact: part of a scan without it, with it, and what changes, on the same scale.

The part shown is the one that the artefact changes most (eval/ablation/crop.py).
"""

import io
import math
from collections.abc import Sequence
from pathlib import Path

import numpy as np
from matplotlib.axes import Axes
from matplotlib.colors import Colormap, Normalize, to_rgb
from matplotlib.figure import Figure
from matplotlib.image import AxesImage
from matplotlib.patches import Polygon
from numpy.typing import NDArray
from PIL import Image

from echoscape.eval.ablation.crop import Part, above_part, most_changed, polar_part
from echoscape.eval.ablation.run import (
    ArtefactChange,
    CaseScans,
    changes,
    markdown_table,
    simulate_cases,
    strength_text,
)
from echoscape.eval.figures.mover_boxes import ObservedBox, observed_boxes
from echoscape.eval.figures.style import (
    ACCENT,
    BOX_COLOUR,
    CHANGE_COLOURMAP,
    ECHO_COLOURMAP,
    FAINT,
    FRAME,
    INK,
    OVERLAY_COLOURS,
    PAGE,
    new_page,
    rgb_pixels,
)
from echoscape.scenes.core.progress import Progress
from echoscape.sim.datasets.files.atomic_write import write_atomic
from echoscape.sim.datasets.files.output_folder import check_output_folder
from echoscape.sim.generation.config import SimulationConfig

FULL_SCALE_DB, FULL_CHANGE_DB = 50.0, 20.0
"""Ends of the scale of levels, and of the scale of differences [dB]."""
_PANELS = 3
_MIN_ARROW_M_S = 0.5
"""Speed from which a box has an arrow [m/s]."""


def write_artefacts(
    out: Path,
    config: SimulationConfig,
    index: int,
    *,
    names: Sequence[str] = (),
    progress: Progress | None = None,
) -> tuple[list[ArtefactChange], tuple[Path, ...]]:
    """Write a figure for each artefact, and artefacts.md with the table of changes.

    Everything is made before the first file is written, and each file is whole or absent.

    Args:
        out: Folder to write to.
        config: The data set that the scan is from.
        index: Number of the scan, from 0.
        names: Names of the artefacts, none for all.
        progress: Called as the work proceeds; stages: town, scans, figures.

    Returns:
        The changes, and the paths of the files.

    Raises:
        ValueError: There is no such scan or artefact.
        SceneError: A file of the scene is not valid.
        DatasetError: `out` is a file.
        OSError: The folder cannot be written to.
    """
    check_output_folder(out)
    report = progress or (lambda stage, done, total: None)
    every = simulate_cases(config, index, names=names, progress=progress)
    rows = [row for found in every for row in changes(found)]
    files = {}
    for done, found in enumerate(every):
        report("figures", done, len(every))
        files[f"{found.case.name}.png"] = case_figure(found)
    report("figures", len(every), len(every))
    files["artefacts.md"] = markdown_table(rows).encode()
    out.mkdir(parents=True, exist_ok=True)
    for name, content in files.items():
        write_atomic(out / name, content)
    return rows, tuple(out / name for name in files)


def case_figure(found: CaseScans) -> bytes:
    """Draw the figure of an artefact.

    Args:
        found: The scan at each strength.

    Returns:
        A PNG file.
    """
    part = most_changed(found)
    polar = found.case.view == "polar"
    figure = new_page(4.05 * _PANELS, 4.6 if not polar else 3.3)
    top, bottom = (0.87, 0.115) if not polar else (0.83, 0.2)
    grid = figure.add_gridspec(1, _PANELS, left=0.045, right=0.985, top=top, bottom=bottom, wspace=0.1)
    axes = [figure.add_subplot(grid[0, place]) for place in range(_PANELS)]
    parts = [polar_part(scan, part) if polar else above_part(scan, part) for scan in found.scans]
    scale = Normalize(0, FULL_SCALE_DB)
    images = []
    for place, (each, values) in enumerate(zip(axes, parts, strict=False)):
        _titled(each, _panel_title(found, place))
        images.append(_show(each, values, part, polar=polar, colours=ECHO_COLOURMAP, scale=scale))
    if len(parts) < _PANELS:
        images.append(_compared(axes[-1], parts, part, found))
    if found.case.boxes:
        _draw_boxes(axes, found)
    _captioned(figure, found, images)
    return _small_png(figure)


# ---------------------------------------------------------------------- drawing


def _show(
    axes: Axes, values: NDArray, part: Part, *, polar: bool, colours: Colormap, scale: Normalize
) -> AxesImage:
    """Draw values (dB, or colours with a last axis of 3) with metres, or degrees and metres, at the edges."""
    image = axes.imshow(
        values,
        extent=_extent(part, polar=polar),
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


def _extent(part: Part, *, polar: bool) -> tuple[float, float, float, float]:
    half = part.span_m / 2
    if polar:
        begin_deg, end_deg = map(math.degrees, part.edges_rad)
        return 0.0, part.span_m, end_deg, begin_deg
    return part.right_m - half, part.right_m + half, part.forward_m - half, part.forward_m + half


def _compared(axes: Axes, parts: Sequence[NDArray], part: Part, found: CaseScans) -> AxesImage:
    """Draw what an artefact changes: the difference, or both scans in two colours."""
    polar = found.case.view == "polar"
    scale = Normalize(-FULL_CHANGE_DB, FULL_CHANGE_DB)
    if found.case.view == "overlay":
        _titled(axes, "red: off · cyan: on · white: both")
        light = [np.clip((values - 6) / 34, 0, 1)[..., None] for values in parts]
        both = np.clip(light[0] * OVERLAY_COLOURS[0] + light[1] * OVERLAY_COLOURS[1], 0, 1)
        return _show(axes, both, part, polar=polar, colours=ECHO_COLOURMAP, scale=scale)
    _titled(axes, "difference (on minus off)")
    return _show(axes, parts[1] - parts[0], part, polar=polar, colours=CHANGE_COLOURMAP, scale=scale)


def _draw_boxes(axes: Sequence[Axes], found: CaseScans) -> None:
    """Outline the moving objects where each scan has them; an overlay has the boxes of its last scan.

    A difference has none: they would cover what it shows.
    """
    scans = [*zip(found.scans, found.motion_distortion, strict=True)]
    if found.case.view == "overlay":
        scans += scans[-1:]
    for each, (scan, distortion) in zip(axes, scans, strict=False):
        if scan.truth is not None:
            for box in observed_boxes(scan.truth, motion_distortion=distortion):
                _draw_box(each, box)


def _draw_box(axes: Axes, box: ObservedBox) -> None:
    """Draw the outline of a box, with an arrow of its travel in 1 s."""
    axes.add_patch(Polygon(box.corners_m(), fill=False, ec=BOX_COLOUR, lw=1.0))
    if box.speed_m_s > _MIN_ARROW_M_S:
        ahead = np.array([np.sin(box.heading_rad), np.cos(box.heading_rad)])
        front = np.array([box.right_m, box.forward_m]) + ahead * box.length_m / 2
        style = {"arrowstyle": "->", "color": BOX_COLOUR, "shrinkA": 0, "shrinkB": 0}
        tip = (front + ahead * box.speed_m_s).tolist()
        axes.annotate("", (tip[0], tip[1]), (front[0], front[1]), arrowprops=style, annotation_clip=True)


def _panel_title(found: CaseScans, place: int) -> str:
    text = strength_text(found.case, found.strengths[place])
    return f"on: {text}" if place else text


def _titled(axes: Axes, title: str) -> None:
    axes.set_facecolor(PAGE)
    axes.tick_params(colors=FAINT, labelsize=8, length=0, pad=3)
    axes.spines[:].set_color(FRAME)
    axes.set_title(title, size=11, color=INK, loc="left", pad=5)


def _captioned(figure: Figure, found: CaseScans, images: Sequence[AxesImage]) -> None:
    """Write name and caption above the panels, scales below them."""
    name = found.case.name.replace("_", " ")
    figure.text(0.045, 0.965, name, size=13, color=INK, weight="bold", va="center")
    figure.text(0.985, 0.965, found.case.text, size=10.5, color=FAINT, va="center", ha="right")
    axes = (
        "azimuth [deg] down, range [m] across"
        if found.case.view == "polar"
        else "forward [m] up, right [m] across"
    )
    boxes = " · boxes: truth at the time of their azimuth, arrow: travel in 1 s" if found.case.boxes else ""
    figure.text(0.045, 0.032, axes + boxes, size=9, color=FAINT, va="center")
    left = 0.60 if boxes else 0.40
    _scale(figure, images[0], (left, 0.022, 0.12 if boxes else 0.17, 0.022), "dB")
    if len(found.scans) == 2 and found.case.view != "overlay":
        _scale(figure, images[-1], (0.82 if boxes else 0.77, 0.022, 0.12 if boxes else 0.17, 0.022), "dB")


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
    """Return a figure as a PNG of few colours: the two scales, text, and coarse steps of the overlay."""
    whole = Image.fromarray(rgb_pixels(figure))
    palette = Image.new("P", (1, 1))
    palette.putpalette(_palette().tobytes())
    data = io.BytesIO()
    whole.quantize(palette=palette, dither=Image.Dither.NONE).save(data, "png", optimize=True)
    return data.getvalue()


def _palette() -> NDArray[np.uint8]:
    """Return the colours (N, 3) of the figures."""
    page, inks = np.array(to_rgb(PAGE)), [np.array(to_rgb(ink)) for ink in (INK, ACCENT, BOX_COLOUR)]
    fades = [page + (ink - page) * share for ink in inks for share in np.linspace(0, 1, 8)]
    steps = np.linspace(0, 1, 7)
    red, cyan = OVERLAY_COLOURS
    overlay = [np.clip(one * red + other * cyan, 0, 1) for one in steps for other in steps]
    scales = [ECHO_COLOURMAP(np.linspace(0, 1, 64))[:, :3], CHANGE_COLOURMAP(np.linspace(0, 1, 47))[:, :3]]
    return np.rint(255 * np.concatenate([*scales, fades, overlay])).astype(np.uint8)
