"""Pictures of an odometry: the trajectory beside the true one, motion and errors over time, a pair's matches.

From above as everywhere (docs/conventions.md): forward of the first scan is up, right is right, metres.
"""

import io
import math
from collections.abc import Sequence

import numpy as np
from matplotlib.axes import Axes
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.collections import LineCollection
from matplotlib.colors import to_rgb
from matplotlib.figure import Figure
from numpy.typing import NDArray
from PIL import Image
from scipy.ndimage import map_coordinates

from echoscape.eval.figures.preview import ACCENT, FAINT, INK
from echoscape.eval.figures.style import BRIGHTEST, HEAT, PAGE
from echoscape.eval.odometry.interface import MatchedPoints, PairMotion
from echoscape.eval.odometry.metrics import pair_errors, stretches
from echoscape.eval.odometry.run import OdometryResult
from echoscape.sim.datasets.cartesian import polar_to_cartesian
from echoscape.sim.datasets.polar_scan import PolarScan
from echoscape.sim.datasets.se2 import compose, relative

TRUE, WRONG = "#59d0ff", "#ff5f6d"
REACH_M = 60.0
"""Half the width of pictures of scans [m]."""
_PIXELS = 600
_DPI = 100
_DOTTED = 200
"""Pairs up to which each has a dot of its own."""
_WAY_M = 1.0
"""Shortest axis of a trajectory [m], so that a standing car has one."""

# ---------------------------------------------------------------------- the trajectory


def trajectory_picture(odometry: OdometryResult) -> bytes:
    """Return the trajectory from above as a PNG, with the true one from where it is first known."""
    figure = _figure(9.0, 9.0)
    axes = figure.add_axes((0.1, 0.08, 0.86, 0.82))
    _dress(axes, "right [m]", "forward [m]")
    poses = odometry.poses
    shown = [poses[:, :2]]
    if odometry.truth is not None:
        for true in _true_stretches(odometry):
            axes.plot(true[:, 1], true[:, 0], color=TRUE, lw=3, alpha=0.75, solid_capstyle="round")
            shown.append(true[:, :2])
        axes.plot([], [], color=TRUE, lw=3, label="truth")
    axes.plot(poses[:, 1], poses[:, 0], color=ACCENT, lw=1.6, label=odometry.method)
    axes.plot(0, 0, "o", ms=9, mfc="none", mec=INK, label="start")
    _mark_failed(axes, poses[1:, 1][odometry.failed], poses[1:, 0][odometry.failed])
    _equal(axes, np.concatenate(shown))
    _legend(axes)
    figure.text(0.1, 0.945, "Trajectory", size=20, color=INK, weight="bold", va="center")
    figure.text(0.96, 0.945, _told(odometry), size=11, color=FAINT, va="center", ha="right")
    return _png(figure)


def _true_stretches(odometry: OdometryResult) -> list[NDArray[np.float64]]:
    """Return the true poses (K, 3) by stretches, moved so that each begins on the estimate."""
    if odometry.truth is None:
        return []
    found = []
    for part in stretches(odometry.known):
        true = odometry.truth[part]
        found.append(compose(odometry.poses[part.start], relative(true[0], true)))
    return found


def _equal(axes: Axes, points: NDArray[np.float64]) -> None:
    """Show points (K, 2), forward and right [m], with a margin, a metre as long up as aside."""
    low, high = points.min(axis=0), points.max(axis=0)
    half = 0.55 * max(float((high - low).max()), _WAY_M)
    forward, right = ((low + high) / 2).tolist()
    axes.set(xlim=(right - half, right + half), ylim=(forward - half, forward + half), aspect="equal")


# ---------------------------------------------------------------------- over time


def pairs_picture(odometry: OdometryResult) -> bytes:
    """Return the motion of every pair over time as a PNG, and its errors where truth is known."""
    curves = _curves(odometry)
    at_s = (odometry.middle_us[1:] - odometry.middle_us[0]) / 1e6
    height = 1.2 + 2.0 * len(curves)
    figure = _figure(13.0, height)
    grid = figure.add_gridspec(
        len(curves), 1, left=0.07, right=0.98, top=1 - 0.7 / height, bottom=0.6 / height, hspace=0.28
    )
    for row, (label, values, truth) in enumerate(curves):
        axes = figure.add_subplot(grid[row])
        _dress(axes, "time [s]" if row == len(curves) - 1 else "", label)
        if truth is not None:
            axes.plot(at_s, truth, color=TRUE, lw=3, alpha=0.75, label="truth")
        dot = 3.0 if len(at_s) < _DOTTED else 0.0
        axes.plot(at_s, values, "-o", ms=dot, color=ACCENT, lw=1.2, label=odometry.method)
        _mark_failed(axes, at_s[odometry.failed], values[odometry.failed])
        if label.startswith("error"):
            axes.set_ylim(bottom=0)
        if row == 0:
            _legend(axes)
    top = 1 - 0.35 / height
    figure.text(0.07, top, "From scan to scan", size=20, color=INK, weight="bold", va="center")
    figure.text(0.98, top, _told(odometry), size=11, color=FAINT, va="center", ha="right")
    return _png(figure)


Curve = tuple[str, NDArray[np.float64], NDArray[np.float64] | None]


def _curves(odometry: OdometryResult) -> list[Curve]:
    """Return label, values (N - 1,) and true values of all that is drawn over time."""
    scale = np.array([1.0, 1.0, 180 / math.pi])
    labels = ("forward [m]", "right [m]", "yaw [deg]")
    found = (odometry.motions * scale).T
    if odometry.true_motions is None:
        return [(label, values, None) for label, values in zip(labels, found, strict=True)]
    true = (odometry.true_motions * scale).T
    off_m, off_rad = pair_errors(odometry).T
    errors = [("error [m]", off_m, None), ("error [deg]", np.degrees(off_rad), None)]
    return [*zip(labels, found, true, strict=True), *errors]


# ---------------------------------------------------------------------- one pair


def matches_picture(earlier: PolarScan, later: PolarScan, motion: PairMotion, *, title: str) -> bytes:
    """Return a pair of scans as a PNG: laid over each other as they are and as the motion moves them.

    The earlier scan is red, the later one cyan, what agrees white; a third panel has the matches on the
    earlier scan, where the estimator has any.
    """
    panels = 3 if motion.matches is not None else 2
    figure = _figure(6.4 * panels, 7.0)
    grid = figure.add_gridspec(1, panels, left=0.02, right=0.98, top=0.83, bottom=0.02, wspace=0.03)
    first, second = _picture(earlier), _picture(later)
    for column, (name, other) in enumerate((("as they are", second), ("aligned", _moved(second, motion)))):
        axes = figure.add_subplot(grid[column])
        _show(axes, np.stack([first, other, other], axis=-1), name)
    if motion.matches is not None:
        axes = figure.add_subplot(grid[2])
        _show(
            axes,
            0.6 * HEAT(first)[..., :3],
            "matches: from where the later scan has a point to the earlier one's",
        )
        _draw_matches(axes, motion.matches)
    figure.text(0.02, 0.945, title, size=18, color=INK, weight="bold", va="center")
    told = (
        f"{motion.x_m:+.3f} m forward, {motion.y_m:+.3f} m right, {math.degrees(motion.yaw_rad):+.3f} deg   "
        "·   red: earlier, cyan: later, white: both"
    )
    figure.text(0.98, 0.945, told, size=11, color=FAINT, va="center", ha="right")
    return _png(figure)


def _picture(scan: PolarScan) -> NDArray[np.float32]:
    """Return a scan from above (pixels, pixels), 0 to 1."""
    picture = polar_to_cartesian(scan.codes, scan.bin_m, pixel_m=2 * REACH_M / _PIXELS, size=_PIXELS)
    return np.clip(picture / np.float32(BRIGHTEST), 0, 1)


def _moved(picture: NDArray[np.float32], motion: PairMotion) -> NDArray[np.float32]:
    """Return the later scan's picture as the earlier one's car would have seen it."""
    pixel_m, middle = 2 * REACH_M / _PIXELS, (_PIXELS - 1) / 2
    steps = (np.arange(_PIXELS) - middle) * pixel_m
    forward, right = np.meshgrid(-steps, steps, indexing="ij")
    points = np.stack([forward, right, np.zeros_like(forward)], axis=-1)
    own = relative(np.array([motion.x_m, motion.y_m, motion.yaw_rad]), points)
    places = [middle - own[..., 0] / pixel_m, middle + own[..., 1] / pixel_m]
    return np.asarray(map_coordinates(picture, places, order=1), np.float32)


def _show(axes: Axes, picture: NDArray, name: str) -> None:
    axes.imshow(picture, extent=(-REACH_M, REACH_M, -REACH_M, REACH_M), interpolation="antialiased")
    axes.set(xticks=[], yticks=[], xlim=(-REACH_M, REACH_M), ylim=(-REACH_M, REACH_M))
    axes.set_title(name, color=FAINT, size=12, loc="left")
    axes.plot([REACH_M - 25, REACH_M - 5], [5 - REACH_M, 5 - REACH_M], color=INK, lw=2)
    axes.annotate("20 m", (REACH_M - 15, 7 - REACH_M), color=INK, size=10, ha="center")


def _draw_matches(axes: Axes, matches: MatchedPoints) -> None:
    """Draw each match as a line, as opaque as its weight among the others."""
    lines = np.stack([matches.later_m[:, ::-1], matches.earlier_m[:, ::-1]], axis=1)  # (N, 2, right forward)
    share = matches.weights / max(float(matches.weights.max(initial=0.0)), 1e-12)
    opacity = np.clip(share, 0.05, 1.0)
    axes.add_collection(LineCollection(list(lines), colors=INK, linewidths=1.2, alpha=opacity))
    colours = [(*to_rgb(ACCENT), part) for part in opacity.tolist()]
    axes.scatter(lines[:, 1, 0], lines[:, 1, 1], s=9, c=colours, linewidths=0)


# ---------------------------------------------------------------------- the page


def _figure(width: float, height: float) -> Figure:
    figure = Figure(figsize=(width, height), dpi=_DPI, facecolor=PAGE)
    FigureCanvasAgg(figure)
    return figure


def _dress(axes: Axes, across: str, up: str) -> None:
    axes.set_facecolor(PAGE)
    axes.set_xlabel(across, color=FAINT)
    axes.set_ylabel(up, color=FAINT)
    axes.tick_params(colors=FAINT)
    axes.grid(color=FAINT, alpha=0.15, lw=0.8)
    for spine in axes.spines.values():
        spine.set_color("#2a313b")


def _mark_failed(axes: Axes, x: NDArray[np.float64], y: NDArray[np.float64]) -> None:
    if len(x):
        axes.plot(x, y, "x", ms=9, mew=2, color=WRONG, label="failed")


def _legend(axes: Axes) -> None:
    axes.legend(facecolor=PAGE, edgecolor="#2a313b", labelcolor=INK, fontsize=10, loc="best")


def _told(odometry: OdometryResult) -> str:
    failed = int(odometry.failed.sum())
    parts: Sequence[str] = [f"{len(odometry.pairs)} pairs", *([f"{failed} failed"] if failed else [])]
    return "   ·   ".join(parts)


def _png(figure: Figure) -> bytes:
    canvas = FigureCanvasAgg(figure)
    canvas.draw()
    data = io.BytesIO()
    Image.fromarray(np.asarray(canvas.buffer_rgba())[..., :3]).save(data, "png", optimize=True)
    return data.getvalue()
