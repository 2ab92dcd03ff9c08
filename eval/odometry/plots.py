"""Plots of an odometry: the trajectory beside the true one, motion and errors over time, matches of a pair.

Seen from above as everywhere (docs/conventions.md): forward of the first scan is up, right is right, in
metres.
"""

import math
from collections.abc import Sequence
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.collections import LineCollection
from matplotlib.colors import to_rgb
from numpy.typing import NDArray
from scipy.ndimage import map_coordinates

from echoscape.eval.figures.style import (
    ACCENT,
    ECHO_COLOURMAP,
    ERROR_COLOUR,
    FAINT,
    FRAME,
    INK,
    PAGE,
    TRUTH_COLOUR,
    brightness,
    new_page,
    png_bytes,
    style_curves,
)
from echoscape.eval.odometry.interface import MatchedPoints, PairMotion
from echoscape.eval.odometry.metrics import pair_errors, runs_of_true
from echoscape.eval.odometry.run import OdometryResult
from echoscape.sim.datasets.cartesian import polar_to_cartesian
from echoscape.sim.datasets.polar_scan import PolarScan
from echoscape.sim.datasets.se2 import compose, relative

REACH_M = 60.0
"""Half the width of images of scans [m]."""
_PIXELS = 600
_MAX_DOTS = 200
"""Pairs up to which each has a dot."""
_MIN_EXTENT_M = 1.0
"""Smallest extent of a trajectory plot [m], for a car that stands."""
_TRUTH_LINE: dict[str, Any] = {"color": TRUTH_COLOUR, "lw": 3, "alpha": 0.75, "solid_capstyle": "round"}

# ---------------------------------------------------------------------- the trajectory


def trajectory_figure(result: OdometryResult) -> bytes:
    """Draw the trajectory from above, with the true one from where it is first known.

    Args:
        result: The odometry.

    Returns:
        A PNG file.
    """
    figure = new_page(9.0, 9.0)
    axes = figure.add_axes((0.1, 0.08, 0.86, 0.82))
    style_curves(axes, "right [m]", "forward [m]")
    poses = result.poses
    shown = [poses[:, :2]]
    if result.truth is not None:
        for true in _true_runs(result):
            axes.plot(true[:, 1], true[:, 0], **_TRUTH_LINE)
            shown.append(true[:, :2])
        axes.plot([], [], label="truth", **_TRUTH_LINE)
    axes.plot(poses[:, 1], poses[:, 0], color=ACCENT, lw=1.6, label=result.method)
    axes.plot(0, 0, "o", ms=9, mfc="none", mec=INK, label="start")
    _mark_failed(axes, poses[1:, 1][result.failed], poses[1:, 0][result.failed])
    _set_equal_limits(axes, np.concatenate(shown))
    _legend(axes)
    figure.text(0.1, 0.945, "Trajectory", size=20, color=INK, weight="bold", va="center")
    text = "   ·   ".join([_counts_text(result), *_final_error_text(result)])
    figure.text(0.96, 0.945, text, size=11, color=FAINT, va="center", ha="right")
    return png_bytes(figure)


def _final_error_text(result: OdometryResult) -> list[str]:
    """Return the distance from the last pose to the true one as text, nothing where that is unknown."""
    if result.truth is None or not result.known[-1]:
        return []
    run = runs_of_true(result.known)[-1]
    error_m = float(np.hypot(*(_true_runs(result)[-1][-1] - result.poses[-1])[:2]))
    length_m = float(np.hypot(*np.diff(result.truth[run, :2], axis=0).T).sum())
    return [f"final position error: {error_m:.2f} m after {length_m:.0f} m"]


def _true_runs(result: OdometryResult) -> list[NDArray[np.float64]]:
    """Return the known runs of true poses (K, 3), moved so that each begins on the estimate."""
    if result.truth is None:
        return []
    found = []
    for part in runs_of_true(result.known):
        true = result.truth[part]
        found.append(compose(result.poses[part.start], relative(true[0], true)))
    return found


def _set_equal_limits(axes: Axes, points: NDArray[np.float64]) -> None:
    """Fit the axes to points (K, 2), forward and right [m], with a margin and equal scales."""
    low, high = points.min(axis=0), points.max(axis=0)
    half = 0.55 * max(float((high - low).max()), _MIN_EXTENT_M)
    forward, right = ((low + high) / 2).tolist()
    axes.set(xlim=(right - half, right + half), ylim=(forward - half, forward + half), aspect="equal")


# ---------------------------------------------------------------------- over time


def pairs_figure(result: OdometryResult) -> bytes:
    """Draw the motion of every pair over time, and its errors where the truth is known.

    Args:
        result: The odometry.

    Returns:
        A PNG file.
    """
    curves = _curves(result)
    time_s = (result.middle_us[1:] - result.middle_us[0]) / 1e6
    height = 1.2 + 2.0 * len(curves)
    figure = new_page(13.0, height)
    grid = figure.add_gridspec(
        len(curves), 1, left=0.07, right=0.98, top=1 - 0.7 / height, bottom=0.6 / height, hspace=0.28
    )
    for row, (label, values, truth) in enumerate(curves):
        axes = figure.add_subplot(grid[row])
        style_curves(axes, "time [s]" if row == len(curves) - 1 else "", label)
        if truth is not None:
            axes.plot(time_s, truth, label="truth", **_TRUTH_LINE)
        dot = 3.0 if len(time_s) < _MAX_DOTS else 0.0
        axes.plot(time_s, values, "-o", ms=dot, color=ACCENT, lw=1.2, label=result.method)
        _mark_failed(axes, time_s[result.failed], values[result.failed])
        if "error" in label:
            axes.set_ylim(bottom=0)
        if row == 0:
            _legend(axes)
    top = 1 - 0.35 / height
    figure.text(0.07, top, "Motion from scan to scan", size=20, color=INK, weight="bold", va="center")
    figure.text(0.98, top, _counts_text(result), size=11, color=FAINT, va="center", ha="right")
    return png_bytes(figure)


_Curve = tuple[str, NDArray[np.float64], NDArray[np.float64] | None]


def _curves(result: OdometryResult) -> list[_Curve]:
    """Return label, values (N - 1,) and true values of each plot over time."""
    scale = np.array([1.0, 1.0, 180 / math.pi])
    labels = ("forward [m]", "right [m]", "yaw [deg]")
    found = (result.motions * scale).T
    if result.true_motions is None:
        return [(label, values, None) for label, values in zip(labels, found, strict=True)]
    true = (result.true_motions * scale).T
    error_m, error_rad = pair_errors(result).T
    errors = [
        ("translation error [m]", error_m, None),
        ("rotation error [deg]", np.degrees(error_rad), None),
    ]
    return [*zip(labels, found, true, strict=True), *errors]


# ---------------------------------------------------------------------- one pair


def matches_figure(
    earlier: PolarScan,
    later: PolarScan,
    motion: PairMotion,
    *,
    title: str,
    true_motion: NDArray[np.float64] | None = None,
) -> bytes:
    """Draw a pair of scans laid over each other, as received and aligned by the motion, and its matches.

    Args:
        earlier: The earlier scan, red.
        later: The later scan, cyan; where both have an echo they add to white.
        motion: The motion; a third panel shows its matches, if it has any.
        title: Title of the figure.
        true_motion: The true motion (3,): forward, right [m], yaw [rad]; None where it is unknown.

    Returns:
        A PNG file.
    """
    panels = 3 if motion.matches is not None else 2
    height = 7.8
    figure = new_page(6.4 * panels, height)
    grid = figure.add_gridspec(
        1, panels, left=0.02, right=0.98, top=1 - 1.6 / height, bottom=0.15 / height, wspace=0.03
    )
    first, second = _image(earlier), _image(later)
    for column, (name, other) in enumerate((("as received", second), ("aligned", _moved(second, motion)))):
        axes = figure.add_subplot(grid[column])
        _show(axes, np.stack([first, other, other], axis=-1), name)
    if motion.matches is not None:
        axes = figure.add_subplot(grid[2])
        background = 0.6 * ECHO_COLOURMAP(first)[..., :3]
        _show(axes, background, "matches, on the earlier scan")
        _draw_matches(axes, motion.matches)
    figure.text(0.02, 1 - 0.4 / height, title, size=18, color=INK, weight="bold", va="center")
    motions = [f"estimate: {_motion_text(motion.x_m, motion.y_m, motion.yaw_rad)}"]
    if true_motion is not None:
        motions.append(f"truth: {_motion_text(*true_motion.tolist())}")
    legend = ["red: earlier, cyan: later, white: both"]
    if motion.matches is not None:
        legend.append("dot: earlier point, line: to the later one, opacity: weight")
    for below_in, texts in ((0.78, motions), (1.04, legend)):
        text = "   ·   ".join(texts)
        figure.text(0.02, 1 - below_in / height, text, size=11, color=FAINT, va="center")
    return png_bytes(figure)


def _motion_text(forward_m: float, right_m: float, yaw_rad: float) -> str:
    return f"{forward_m:+.3f} m forward, {right_m:+.3f} m right, yaw {math.degrees(yaw_rad):+.3f} deg"


def _image(scan: PolarScan) -> NDArray[np.float32]:
    """Return a scan from above (pixels, pixels), 0 to 1."""
    return brightness(
        polar_to_cartesian(
            scan.codes,
            scan.bin_m,
            first_rad=scan.first_azimuth_rad,
            pixel_m=2 * REACH_M / _PIXELS,
            size=_PIXELS,
        )
    )


def _moved(image: NDArray[np.float32], motion: PairMotion) -> NDArray[np.float32]:
    """Return the later scan's image in the frame of the earlier scan."""
    pixel_m, middle = 2 * REACH_M / _PIXELS, (_PIXELS - 1) / 2
    steps = (np.arange(_PIXELS) - middle) * pixel_m
    forward, right = np.meshgrid(-steps, steps, indexing="ij")
    points = np.stack([forward, right, np.zeros_like(forward)], axis=-1)
    later = relative(np.array([motion.x_m, motion.y_m, motion.yaw_rad]), points)
    places = [middle - later[..., 0] / pixel_m, middle + later[..., 1] / pixel_m]
    return np.asarray(map_coordinates(image, places, order=1), np.float32)


def _show(axes: Axes, image: NDArray, name: str) -> None:
    axes.imshow(image, extent=(-REACH_M, REACH_M, -REACH_M, REACH_M), interpolation="antialiased")
    axes.set(xticks=[], yticks=[], xlim=(-REACH_M, REACH_M), ylim=(-REACH_M, REACH_M))
    axes.set_title(name, color=FAINT, size=12, loc="left")
    axes.plot([REACH_M - 25, REACH_M - 5], [5 - REACH_M, 5 - REACH_M], color=INK, lw=2)
    axes.annotate("20 m", (REACH_M - 15, 7 - REACH_M), color=INK, size=10, ha="center")


def _draw_matches(axes: Axes, matches: MatchedPoints) -> None:
    """Draw each match as a line, with an opacity that is its weight over the largest."""
    lines = np.stack([matches.later_m[:, ::-1], matches.earlier_m[:, ::-1]], axis=1)  # (N, 2, right forward)
    share = matches.weights / max(float(matches.weights.max(initial=0.0)), 1e-12)
    opacity = np.clip(share, 0.05, 1.0)
    axes.add_collection(LineCollection(list(lines), colors=INK, linewidths=1.2, alpha=opacity))
    colours = [(*to_rgb(ACCENT), part) for part in opacity.tolist()]
    axes.scatter(lines[:, 1, 0], lines[:, 1, 1], s=9, c=colours, linewidths=0)


# ---------------------------------------------------------------------- elements of the figures


def _mark_failed(axes: Axes, x: NDArray[np.float64], y: NDArray[np.float64]) -> None:
    if len(x):
        axes.plot(x, y, "x", ms=9, mew=2, color=ERROR_COLOUR, label="failed")


def _legend(axes: Axes) -> None:
    axes.legend(facecolor=PAGE, edgecolor=FRAME, labelcolor=INK, fontsize=10, loc="best")


def _counts_text(result: OdometryResult) -> str:
    failed = int(result.failed.sum())
    parts: Sequence[str] = [f"{len(result.pairs)} pairs", *([f"{failed} failed"] if failed else [])]
    return "   ·   ".join(parts)
