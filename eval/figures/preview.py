"""A dataset at a glance: OUT/preview.png shows a scan as received, what made it, and where it was taken.

Everything is read from the folder's files, so that any dataset can be drawn again at any time.
"""

import io
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from matplotlib import font_manager, patheffects
from matplotlib.axes import Axes
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.colors import to_rgb
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from matplotlib.patches import Circle, Polygon
from numpy.typing import NDArray
from PIL import Image

from echoscape.eval.figures.style import (
    ACCENT,
    BRIGHTEST,
    COMPONENT_COLOURS,
    FAINT,
    HEAT,
    INK,
    PAGE,
    THINGS,
    drive_window,
)
from echoscape.eval.figures.target_markers import TARGET_COLOUR, TargetMark, draw_target_marks, target_marks
from echoscape.eval.figures.town_plan import Window, plan_picture
from echoscape.sim.datasets.cartesian import nearest_cells, polar_to_cartesian
from echoscape.sim.datasets.files.atomic_write import write_whole
from echoscape.sim.datasets.files.metadata import read_manifest, world_of
from echoscape.sim.datasets.files.truth_npz import read_arrays, read_truth
from echoscape.sim.datasets.polar_scan import PolarScan, ScanTruth
from echoscape.sim.datasets.scan_folder import open_folder

REACH_M = 100.0
"""Half the width of the pictures seen from above [m]."""


_PIXELS = 720
_FINENESS = 2
_COLUMNS = 1256
_DPI = 100


@dataclass(frozen=True, kw_only=True)
class Frame:
    """One scan of a dataset with its surroundings.

    path (scans, 4): the car's pose at every scan; targets: those of the recipe, in the world.
    """

    folder: Path
    manifest: dict[str, Any]
    scan: PolarScan
    truth: ScanTruth
    number: int
    path: NDArray[np.float64]
    targets: tuple[TargetMark, ...] = ()


def preview(folder: Path, *, scan: int | None = None) -> Path:
    """Draw scan number `scan` (None: the middle one) of a dataset to `folder`/preview.png; return its path.

    Raises:
        DatasetError: the folder lacks a file or one is damaged; the message names it.
        ValueError: there is no such scan.
    """
    frame = read_frame(Path(folder), scan)
    write_whole(frame.folder / "preview.png", _png(_figure(frame)))
    return frame.folder / "preview.png"


def small_copy(page: Path, to: Path) -> None:
    """Write a preview to `to` in 256 colours and 1500 pixels wide: a fifth of the size, for a README."""
    with Image.open(page) as image:
        height = round(image.height * 1500 / image.width)
        small = image.convert("RGB").resize((1500, height), Image.Resampling.LANCZOS)
    data = io.BytesIO()
    colours = small.quantize(256, method=Image.Quantize.MAXCOVERAGE, kmeans=2, dither=Image.Dither.NONE)
    colours.save(data, "png", optimize=True)
    write_whole(to, data.getvalue())


def read_frame(folder: Path, scan: int | None) -> Frame:
    """Read what a preview shows; for arguments and errors see `preview`."""
    content = read_manifest(folder)
    scans = open_folder(folder)
    number = len(scans) // 2 if scan is None else scan
    if not 0 <= number < len(scans):
        raise ValueError(f"scan must be between 0 and {len(scans) - 1}, got {number}")
    truths = [folder / "truth" / f"{path.stem}.npz" for path in scans.paths]
    poses = [read_arrays(truth, ("middle_pose",))["middle_pose"] for truth in truths]
    return Frame(
        folder=folder,
        manifest=content,
        scan=scans.read(number),
        truth=read_truth(truths[number]),
        number=number,
        path=np.array(poses),
        targets=target_marks(content, start=read_arrays(truths[0], ("pose",))["pose"][0]),
    )


# ---------------------------------------------------------------------- the page


def _figure(frame: Frame) -> Figure:
    """Return the page: three pictures seen from above, two of the polar scan below them, a caption."""
    figure = Figure(figsize=(18, 11.4), dpi=_DPI, facecolor=PAGE)
    FigureCanvasAgg(figure)
    pictures = figure.add_gridspec(1, 3, left=0.022, right=0.978, top=0.905, bottom=0.385, wspace=0.05)
    strips = figure.add_gridspec(1, 2, left=0.03, right=0.978, top=0.285, bottom=0.075, wspace=0.06)
    _received_above(figure.add_subplot(pictures[0, 0]), frame)
    _things_above(figure.add_subplot(pictures[0, 1]), frame)
    _plan(figure.add_subplot(pictures[0, 2]), frame)
    _received_polar(figure.add_subplot(strips[0, 0]), frame)
    _components_polar(figure.add_subplot(strips[0, 1]), frame)
    _caption(figure, frame)
    return figure


def _caption(figure: Figure, frame: Frame) -> None:
    recipe = frame.manifest["recipe"]
    azimuths, bins = frame.scan.codes.shape
    figure.text(0.022, 0.962, "echoscape", size=25, color=INK, weight="bold", va="center", family=_family())
    figure.text(
        0.978,
        0.962,
        f"{world_of(frame.manifest)}, seed {recipe['seed']}   ·   "
        f"scan {frame.number + 1} of {recipe['scans']}   ·   "
        f"{recipe['sensor']['name'].upper()}, {recipe['sensor']['carrier_hz'] / 1e9:g} GHz FMCW, "
        f"{azimuths} × {bins} cells of {frame.scan.bin_m * 100:.2f} cm",
        size=13,
        color=FAINT,
        ha="right",
        va="center",
        family=_family(),
    )


def _family() -> list[str]:
    """Return the best-looking typeface that is there."""
    known = {font.name for font in font_manager.fontManager.ttflist}
    return [name for name in ("Inter", "Source Sans 3", "Open Sans", "DejaVu Sans") if name in known]


def _titled(axes: Axes, title: str, text: str) -> None:
    axes.set(xticks=[], yticks=[])
    for spine in axes.spines.values():
        spine.set(color="#2a313b", linewidth=0.8)
    axes.annotate(
        title, (0, 1), xytext=(0, 8), xycoords="axes fraction", textcoords="offset points",
        size=14, color=INK, weight="bold", family=_family(),
    )  # fmt: skip
    axes.annotate(
        text, (1, 1), xytext=(0, 8), xycoords="axes fraction", textcoords="offset points",
        size=11, color=FAINT, ha="right", family=_family(),
    )  # fmt: skip


def _legend(axes: Axes, colours: dict[str, str], *, columns: int) -> None:
    axes.legend(
        handles=[
            Line2D([], [], marker="o", ls="", ms=8, mec="none", mfc=colour, label=name)
            for name, colour in colours.items()
        ],
        loc="upper left",
        bbox_to_anchor=(-0.012, -0.012),
        ncols=columns,
        frameon=False,
        labelcolor=INK,
        handletextpad=0.2,
        columnspacing=1.0,
        prop={"size": 10.5, "family": _family()},
    )


# ---------------------------------------------------------------------- seen from above


def _brightness(codes: NDArray) -> NDArray[np.float32]:
    return np.clip(codes.astype(np.float32) / BRIGHTEST, 0, 1)


def _above(frame: Frame, values: NDArray) -> NDArray[np.float32]:
    pixel_m = 2 * REACH_M / (_PIXELS * _FINENESS)
    return _shrunk(polar_to_cartesian(values, frame.scan.bin_m, pixel_m=pixel_m, size=_PIXELS * _FINENESS))


def _shrunk(fine: NDArray) -> NDArray:
    """Return a picture's means over blocks of pixels."""
    return fine.reshape(_PIXELS, _FINENESS, _PIXELS, _FINENESS, *fine.shape[2:]).mean(axis=(1, 3))


def _show_above(axes: Axes, picture: NDArray) -> None:
    axes.imshow(picture, extent=(-REACH_M, REACH_M, -REACH_M, REACH_M), interpolation="antialiased")
    for radius in (25, 50, 75):
        axes.add_patch(Circle((0, 0), radius, fill=False, ec="white", lw=0.6, alpha=0.16))
        axes.annotate(f"{radius} m", (0, -radius), color="white", alpha=0.5, size=8, ha="center", va="center")
    axes.add_patch(Polygon([(-2.2, -2.6), (0, 3.8), (2.2, -2.6), (0, -1.2)], fc=ACCENT, ec=PAGE, lw=0.6))
    axes.set(xlim=(-REACH_M, REACH_M), ylim=(-REACH_M, REACH_M))


def _received_above(axes: Axes, frame: Frame) -> None:
    _titled(axes, "Received", "seen from above, driving upwards")
    _show_above(axes, HEAT(_brightness(_above(frame, frame.scan.codes)))[..., :3])
    bar = axes.inset_axes((0.0, -0.062, 0.62, 0.018))
    bar.imshow(np.linspace(0, 1, 256)[None], aspect="auto", cmap=HEAT, extent=(0, BRIGHTEST / 2, 0, 1))
    bar.set(yticks=[], xticks=[0, 10, 20, 30, 40], xticklabels=["0", "10", "20", "30", "40 dB"])
    bar.tick_params(colors=FAINT, labelsize=9, length=0, pad=4)
    bar.spines[:].set_visible(False)


def _things_above(axes: Axes, frame: Frame) -> None:
    _titled(axes, "What was hit", "truth of direct echoes, as bright as received")
    names = frame.manifest["classes"]
    table = np.tile(np.array(to_rgb("#2b3441"), np.float32), (256, 1))
    for colour, members in THINGS.values():
        table[[names.index(name) for name in members if name in names]] = to_rgb(colour)
    pixel_m = 2 * REACH_M / (_PIXELS * _FINENESS)
    size = _PIXELS * _FINENESS
    cells = frame.truth.cells
    hit = np.where(cells.component == frame.manifest["components"].index("direct"), cells.class_id, 0)
    labels = nearest_cells(hit, frame.scan.bin_m, pixel_m=pixel_m, size=size)
    light = polar_to_cartesian(_brightness(frame.scan.codes), frame.scan.bin_m, pixel_m=pixel_m, size=size)
    lit = np.where(labels > 0, 0.25 + 0.95 * light**0.8, 0.9 * light)
    _show_above(axes, np.clip(_shrunk(_over_page(table[labels], lit)), 0, 1))
    _legend(axes, {group: colour for group, (colour, _) in THINGS.items()}, columns=4)


def _over_page(colours: NDArray, light: NDArray) -> NDArray[np.float32]:
    """Return colours (..., 3) faded to the page's as `light` (...) falls to 0."""
    page = np.array(to_rgb("#0b0e13"), np.float32)
    share = np.clip(light, 0, 1)[..., None].astype(np.float32)
    return (page + (colours - page) * share).astype(np.float32)


# ---------------------------------------------------------------------- the town


def _plan(axes: Axes, frame: Frame) -> None:
    """Draw the town round the drive, the drive, and who moves."""
    _titled(axes, "Where", f"drive and movers, north up, {world_of(frame.manifest)}")
    window = drive_window(frame.path)
    own = frame.manifest["recipe"].get("scene") is not None
    picture = plan_picture(frame.folder / "scene.glb", window, pixels=_PIXELS, all_faces=own)
    axes.imshow(picture, extent=(window[0], window[2], window[1], window[3]))
    here = frame.truth.middle_pose
    ring = Circle((here[0], here[1]), REACH_M, fill=False, ec=INK, lw=0.8, ls=(0, (4, 4)), alpha=0.5)
    axes.add_patch(ring)
    glow = [patheffects.Stroke(linewidth=5.5, foreground=PAGE, alpha=0.6), patheffects.Normal()]
    axes.plot(
        frame.path[:, 0], frame.path[:, 1], color=ACCENT, lw=2.6, solid_capstyle="round", path_effects=glow
    )
    axes.plot(*frame.path[0, :2], "o", ms=8, mfc=PAGE, mec=ACCENT, mew=2)
    for corners in _box_corners(frame.truth):
        axes.add_patch(Polygon(corners, fc="#4cc9f0", ec=PAGE, lw=0.5, zorder=4))
    scale = (window[2] - window[0]) / (2 * REACH_M)
    arrow = np.array([(3.8, 0), (-2.6, 2.2), (-1.2, 0), (-2.6, -2.2)]) * 1.6 * scale
    axes.add_patch(Polygon(_turned(arrow, here[3]) + here[:2], fc=ACCENT, ec=PAGE, lw=0.8, zorder=5))
    draw_target_marks(axes, frame.targets, ink=INK, glow=PAGE, family=_family())
    axes.set(xlim=(window[0], window[2]), ylim=(window[1], window[3]))
    _scale_bar(axes, window)
    marks = {"drive": ACCENT, "mover": "#4cc9f0"} | ({"test target": TARGET_COLOUR} if frame.targets else {})
    _legend(axes, marks, columns=3)


def _turned(points: NDArray, yaw: float) -> NDArray[np.float64]:
    cosine, sine = np.cos(yaw), np.sin(yaw)
    return points @ np.array([[cosine, sine], [-sine, cosine]])


def _box_corners(truth: ScanTruth) -> list[NDArray[np.float64]]:
    """Return the corners (4, 2) of the movers' boxes seen from above [m], no side shorter than 1.5 m."""
    unit = np.array([(0.5, 0.5), (-0.5, 0.5), (-0.5, -0.5), (0.5, -0.5)])
    boxes = truth.boxes
    return [
        _turned(unit * np.maximum(extent[:2], 1.5), yaw) + centre[:2]
        for centre, extent, yaw in zip(boxes.centre, boxes.extent, boxes.yaw, strict=True)
    ]


def _scale_bar(axes: Axes, window: Window) -> None:
    width = window[2] - window[0]
    length = next(step for step in (500, 200, 100, 50, 20) if step < 0.3 * width)
    x, y = window[2] - 0.04 * width, window[1] + 0.04 * width
    axes.plot([x - length, x], [y, y], color=INK, lw=2, solid_capstyle="butt")
    axes.annotate(f"{length} m", (x - length / 2, y), xytext=(0, 5), textcoords="offset points", color=INK,
                  size=9, ha="center", family=_family())  # fmt: skip


# ---------------------------------------------------------------------- the polar scan


def _show_polar(axes: Axes, frame: Frame, picture: NDArray) -> None:
    bins = frame.scan.codes.shape[1]
    axes.imshow(
        picture, aspect="auto", extent=(0, bins * frame.scan.bin_m, 360, 0), interpolation="antialiased"
    )
    axes.set_yticks([0, 90, 180, 270, 360], ["0°", "90°", "180°", "270°", "360°"])
    reach_m = bins * frame.scan.bin_m
    ticks = range(0, int(reach_m), 25 if reach_m < 225 else 50)
    axes.set_xticks(ticks, [*map(str, ticks[:-1]), f"{ticks[-1]} m"])
    axes.tick_params(colors=FAINT, labelsize=9, length=0, pad=4)


def _received_polar(axes: Axes, frame: Frame) -> None:
    _titled(axes, "As the sensor writes it", "azimuth down, range across, half decibels")
    _show_polar(axes, frame, HEAT(_pooled(_brightness(frame.scan.codes)))[..., :3])


def _components_polar(axes: Axes, frame: Frame) -> None:
    _titled(axes, "Why it is there", "component of every cell")
    table = np.array([to_rgb(COMPONENT_COLOURS[name]) for name in frame.manifest["components"]], np.float32)
    light = 0.2 + 0.9 * _brightness(frame.scan.codes)
    light = np.where(frame.scan.codes > 0, light, 0.0)
    picture = _over_page(table[frame.truth.cells.component], light)
    _show_polar(axes, frame, _pooled(picture))
    _legend(axes, COMPONENT_COLOURS, columns=6)
    legend = axes.get_legend()
    if legend is not None:
        legend.set_bbox_to_anchor((-0.012, -0.1))


def _pooled(values: NDArray) -> NDArray:
    """Return a polar picture with its range columns averaged to about `_COLUMNS`."""
    step = max(1, values.shape[1] // _COLUMNS)
    whole = values[:, : values.shape[1] // step * step]
    return whole.reshape(len(values), -1, step, *values.shape[2:]).mean(axis=2)


def _png(figure: Figure) -> bytes:
    """Return a figure as a PNG without transparency."""
    canvas = FigureCanvasAgg(figure)
    canvas.draw()
    data = io.BytesIO()
    Image.fromarray(np.asarray(canvas.buffer_rgba())[..., :3]).save(data, "png", optimize=True)
    return data.getvalue()
