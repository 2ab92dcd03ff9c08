"""A data set at a glance: preview.png shows one scan as received, its ground truth, and where it was taken.

Everything is read from the folder's files, so that any data set can be drawn again at any time.
"""

import io
import math
from pathlib import Path
from typing import Any

import numpy as np
from matplotlib import patheffects
from matplotlib.axes import Axes
from matplotlib.colors import to_rgb
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from matplotlib.patches import Circle, Polygon
from numpy.typing import NDArray
from PIL import Image

from echoscape.eval.figures.frame import Frame, read_frame
from echoscape.eval.figures.style import (
    ACCENT,
    CLASS_GROUPS,
    COMPONENT_COLOURS,
    ECHO_COLOURMAP,
    FAINT,
    FRAME,
    FULL_SCALE_CODE,
    INK,
    MOVER_COLOUR,
    PAGE,
    SCREEN,
    TARGET_COLOUR,
    brightness,
    class_legend,
    component_legend,
    font_family,
    new_page,
    png_bytes,
)
from echoscape.eval.figures.target_markers import draw_target_marks
from echoscape.eval.figures.town_plan import Window, drive_window, plan_image
from echoscape.sim.datasets.cartesian import nearest_cells, polar_to_cartesian
from echoscape.sim.datasets.files.atomic_write import write_atomic
from echoscape.sim.datasets.polar_scan import ScanTruth

REACH_M = 100.0
"""Half the width of the images seen from above [m]."""
_PIXELS = 720
_OVERSAMPLING = 2
_COLUMNS = 1256
_UNLABELLED = "#2b3441"
"""Colour of cells without a direct echo."""
_MIN_BOX_M = 1.5
"""Shortest side of a box on the plan [m], so that a pedestrian can be seen."""


def preview(folder: Path, *, scan: int | None = None) -> Path:
    """Draw one scan of a simulated data set to preview.png in its folder.

    Args:
        folder: The data set.
        scan: Number of the scan, from 0; None for the middle one.

    Returns:
        Path of the figure.

    Raises:
        DatasetError: The folder lacks a file or one is damaged; the message names it.
        ValueError: There is no such scan.
    """
    frame = read_frame(Path(folder), scan)
    write_atomic(frame.folder / "preview.png", png_bytes(_page(frame)))
    return frame.folder / "preview.png"


def small_copy(page: Path, to: Path) -> None:
    """Write a copy of a preview for a README: 1500 pixels wide, 256 colours, a fifth of the bytes.

    Args:
        page: The preview.
        to: File to write.
    """
    with Image.open(page) as image:
        height = round(image.height * 1500 / image.width)
        small = image.convert("RGB").resize((1500, height), Image.Resampling.LANCZOS)
    data = io.BytesIO()
    colours = small.quantize(256, method=Image.Quantize.MAXCOVERAGE, kmeans=2, dither=Image.Dither.NONE)
    colours.save(data, "png", optimize=True)
    write_atomic(to, data.getvalue())


# ---------------------------------------------------------------------- the page


def _page(frame: Frame) -> Figure:
    """Return the page: three images seen from above, two of the polar scan below them, a caption."""
    figure = new_page(18, 11.4)
    above = figure.add_gridspec(1, 3, left=0.022, right=0.978, top=0.905, bottom=0.385, wspace=0.05)
    polar = figure.add_gridspec(1, 2, left=0.03, right=0.978, top=0.285, bottom=0.075, wspace=0.06)
    _received_above(figure.add_subplot(above[0, 0]), frame)
    _classes_above(figure.add_subplot(above[0, 1]), frame)
    _plan(figure.add_subplot(above[0, 2]), frame)
    _received_polar(figure.add_subplot(polar[0, 0]), frame)
    _components_polar(figure.add_subplot(polar[0, 1]), frame)
    _caption(figure, frame)
    return figure


def _caption(figure: Figure, frame: Frame) -> None:
    config = frame.manifest["config"]
    azimuths, bins = frame.scan.codes.shape
    title = {"color": INK, "weight": "bold", "va": "center", "family": font_family()}
    figure.text(0.022, 0.962, "echoscape", size=25, **title)
    figure.text(
        0.978,
        0.962,
        f"{frame.world}, seed {config['seed']}   ·   "
        f"scan {frame.number + 1} of {config['scans']}   ·   "
        f"{config['sensor']['name'].upper()}, {config['sensor']['carrier_hz'] / 1e9:g} GHz FMCW, "
        f"{azimuths} azimuths × {bins} range bins of {frame.scan.bin_m * 100:.2f} cm",
        size=13,
        color=FAINT,
        ha="right",
        va="center",
        family=font_family(),
    )


def _titled(axes: Axes, title: str, text: str) -> None:
    axes.set(xticks=[], yticks=[])
    axes.spines[:].set(color=FRAME, linewidth=0.8)
    at = {"xycoords": "axes fraction", "textcoords": "offset points", "family": font_family()}
    axes.annotate(title, (0, 1), xytext=(0, 8), size=14, color=INK, weight="bold", **at)
    axes.annotate(text, (1, 1), xytext=(0, 8), size=11, color=FAINT, ha="right", **at)


def _legend(axes: Axes, colours: dict[str, str], *, columns: int, drop: float = -0.012) -> None:
    """Write a legend below axes, `drop` of their height lower."""
    axes.legend(
        handles=[
            Line2D([], [], marker="o", ls="", ms=8, mec="none", mfc=colour, label=name)
            for name, colour in colours.items()
        ],
        loc="upper left",
        bbox_to_anchor=(-0.012, drop),
        ncols=columns,
        frameon=False,
        labelcolor=INK,
        handletextpad=0.2,
        columnspacing=1.0,
        prop={"size": 10.5, "family": font_family()},
    )


# ---------------------------------------------------------------------- seen from above


def _above(frame: Frame, values: NDArray) -> NDArray[np.float32]:
    """Return values (azimuths, bins) seen from above (_PIXELS, _PIXELS)."""
    return _shrunk(polar_to_cartesian(values, frame.scan.bin_m, **_grid(frame)))


def _grid(frame: Frame) -> dict[str, Any]:
    """Return how the image from above lies over the scan."""
    size = _PIXELS * _OVERSAMPLING
    return {"first_rad": frame.scan.first_azimuth_rad, "pixel_m": 2 * REACH_M / size, "size": size}


def _shrunk(fine: NDArray) -> NDArray:
    """Return the means of an oversampled image over blocks of pixels."""
    return fine.reshape(_PIXELS, _OVERSAMPLING, _PIXELS, _OVERSAMPLING, *fine.shape[2:]).mean(axis=(1, 3))


def _show_above(axes: Axes, image: NDArray) -> None:
    axes.imshow(image, extent=(-REACH_M, REACH_M, -REACH_M, REACH_M), interpolation="antialiased")
    for radius in (25, 50, 75):
        axes.add_patch(Circle((0, 0), radius, fill=False, ec="white", lw=0.6, alpha=0.16))
        axes.annotate(f"{radius} m", (0, -radius), color="white", alpha=0.5, size=8, ha="center", va="center")
    axes.add_patch(Polygon([(-2.2, -2.6), (0, 3.8), (2.2, -2.6), (0, -1.2)], fc=ACCENT, ec=PAGE, lw=0.6))
    axes.set(xlim=(-REACH_M, REACH_M), ylim=(-REACH_M, REACH_M))


def _received_above(axes: Axes, frame: Frame) -> None:
    _titled(axes, "Received", "scan from above, heading up")
    _show_above(axes, ECHO_COLOURMAP(brightness(_above(frame, frame.scan.codes)))[..., :3])
    bar = axes.inset_axes((0.0, -0.062, 0.62, 0.018))
    bar.imshow(
        np.linspace(0, 1, 256)[None],
        aspect="auto",
        cmap=ECHO_COLOURMAP,
        extent=(0, FULL_SCALE_CODE / 2, 0, 1),
    )
    bar.set(yticks=[], xticks=[0, 10, 20, 30, 40], xticklabels=["0", "10", "20", "30", "40 dB"])
    bar.tick_params(colors=FAINT, labelsize=9, length=0, pad=4)
    bar.spines[:].set_visible(False)


def _classes_above(axes: Axes, frame: Frame) -> None:
    _titled(axes, "Object classes", "truth of direct echoes, as bright as received")
    names = frame.manifest["classes"]
    table = np.tile(np.array(to_rgb(_UNLABELLED), np.float32), (256, 1))
    for colour, members in CLASS_GROUPS.values():
        table[[names.index(name) for name in members if name in names]] = to_rgb(colour)
    grid = _grid(frame)
    classes = frame.direct_classes()
    labels = nearest_cells(classes, frame.scan.bin_m, **grid)
    light = polar_to_cartesian(brightness(frame.scan.codes), frame.scan.bin_m, **grid)
    lit = np.where(labels > 0, 0.25 + 0.95 * light**0.8, 0.9 * light)
    _show_above(axes, np.clip(_shrunk(_faded(table[labels], lit)), 0, 1))
    present = [names[index] for index in np.unique(labels[labels > 0]).tolist()]
    _legend(axes, class_legend(present), columns=4)


def _faded(colours: NDArray, light: NDArray) -> NDArray[np.float32]:
    """Return colours (..., 3) faded to the background of a scan as `light` (...) falls to 0."""
    screen = np.array(to_rgb(SCREEN), np.float32)
    share = np.clip(light, 0, 1)[..., None].astype(np.float32)
    return (screen + (colours - screen) * share).astype(np.float32)


# ---------------------------------------------------------------------- the plan


def _plan(axes: Axes, frame: Frame) -> None:
    """Draw the town around the drive, the drive, and the moving objects."""
    _titled(axes, "Plan", f"moving objects at mid-scan, north up · dashed: {REACH_M:g} m")
    window = drive_window(frame.path)
    plan = plan_image(frame.folder / "scene.glb", window, pixels=_PIXELS, all_faces=frame.custom_scene)
    axes.imshow(plan, extent=(window[0], window[2], window[1], window[3]))
    here = frame.truth.middle_pose
    ring = Circle((here[0], here[1]), REACH_M, fill=False, ec=INK, lw=0.8, ls=(0, (4, 4)), alpha=0.5)
    axes.add_patch(ring)
    _draw_drive(axes, frame.path[:, :2])
    for corners in _box_corners(frame.truth):
        axes.add_patch(Polygon(corners, fc=MOVER_COLOUR, ec=PAGE, lw=0.5, zorder=4))
    scale = (window[2] - window[0]) / (2 * REACH_M)
    arrow = np.array([(3.8, 0), (-2.6, 2.2), (-1.2, 0), (-2.6, -2.2)]) * 1.6 * scale
    axes.add_patch(Polygon(_rotated(arrow, here[3]) + here[:2], fc=ACCENT, ec=PAGE, lw=0.8, zorder=5))
    draw_target_marks(axes, frame.targets)
    axes.set(xlim=(window[0], window[2]), ylim=(window[1], window[3]))
    _scale_bar(axes, window)
    marks = {"drive": ACCENT}
    marks |= {"moving object": MOVER_COLOUR} if len(frame.truth.boxes.instance) else {}
    marks |= {"test target": TARGET_COLOUR} if frame.targets else {}
    _legend(axes, marks, columns=3)


def _draw_drive(axes: Axes, path: NDArray[np.float64]) -> None:
    """Draw a drive (P, 2) and a ring at its start."""
    edge = [patheffects.Stroke(linewidth=5.5, foreground=PAGE, alpha=0.6), patheffects.Normal()]
    axes.plot(*path.T, color=ACCENT, lw=2.6, solid_capstyle="round", path_effects=edge)
    axes.plot(*path[0], "o", ms=8, mfc=PAGE, mec=ACCENT, mew=2)


def _rotated(points: NDArray, yaw: float) -> NDArray[np.float64]:
    """Return points (N, 2) rotated counter-clockwise by `yaw` [rad]."""
    cosine, sine = np.cos(yaw), np.sin(yaw)
    return points @ np.array([[cosine, sine], [-sine, cosine]])


def _box_corners(truth: ScanTruth) -> list[NDArray[np.float64]]:
    """Return the corners (4, 2) of the boxes at mid-scan in the world [m]."""
    unit = np.array([(0.5, 0.5), (-0.5, 0.5), (-0.5, -0.5), (0.5, -0.5)])
    boxes = truth.boxes
    return [
        _rotated(unit * np.maximum(extent[:2], _MIN_BOX_M), yaw) + centre[:2]
        for centre, extent, yaw in zip(boxes.centre, boxes.extent, boxes.yaw, strict=True)
    ]


def _scale_bar(axes: Axes, window: Window) -> None:
    width = window[2] - window[0]
    length = next(step for step in (500, 200, 100, 50, 20) if step < 0.3 * width)
    x, y = window[2] - 0.04 * width, window[1] + 0.04 * width
    axes.plot([x - length, x], [y, y], color=INK, lw=2, solid_capstyle="butt")
    axes.annotate(f"{length} m", (x - length / 2, y), xytext=(0, 5), textcoords="offset points", color=INK,
                  size=9, ha="center", family=font_family())  # fmt: skip


# ---------------------------------------------------------------------- the polar scan


def _show_polar(axes: Axes, frame: Frame, image: NDArray) -> None:
    reach_m = frame.scan.codes.shape[1] * frame.scan.bin_m
    first_deg = math.degrees(frame.scan.seam_rad)
    extent = (0, reach_m, first_deg + 360, first_deg)
    axes.imshow(image, aspect="auto", extent=extent, interpolation="antialiased")
    shown = [angle for angle in (0, 90, 180, 270, 360) if extent[3] <= angle <= extent[2]]
    axes.set_yticks(shown, [f"{angle}°" for angle in shown])
    ticks = range(0, int(reach_m), 25 if reach_m < 225 else 50)
    axes.set_xticks(ticks, [*map(str, ticks[:-1]), f"{ticks[-1]} m"])
    axes.tick_params(colors=FAINT, labelsize=9, length=0, pad=4)


def _received_polar(axes: Axes, frame: Frame) -> None:
    _titled(axes, "Polar scan", "as the sensor writes it: azimuth down, range across")
    _show_polar(axes, frame, ECHO_COLOURMAP(_pooled(brightness(frame.scan.codes)))[..., :3])


def _components_polar(axes: Axes, frame: Frame) -> None:
    _titled(
        axes,
        "Component",
        "strongest contribution; ghost: several bounces, none of the surfaces there",
    )
    component, names = frame.shown_components()
    table = np.array([to_rgb(COMPONENT_COLOURS[name]) for name in names], np.float32)
    light = 0.2 + 0.9 * brightness(frame.scan.codes)
    light = np.where(frame.scan.codes > 0, light, 0.0)
    image = _faded(table[component], light)
    _show_polar(axes, frame, _pooled(image))
    present = [names[index] for index in np.unique(component).tolist()]
    _legend(axes, component_legend(present), columns=9, drop=-0.1)


def _pooled(values: NDArray) -> NDArray:
    """Return a polar image with its range bins averaged to about `_COLUMNS` columns."""
    step = max(1, values.shape[1] // _COLUMNS)
    whole = values[:, : values.shape[1] // step * step]
    return whole.reshape(len(values), -1, step, *values.shape[2:]).mean(axis=2)
