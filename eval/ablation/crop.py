"""The part of a scan that an effect changes most: from above, or as the sensor writes it.

It is looked for by the change of level, smoothed over a part, of the cells that the effect is about.
"""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.ndimage import gaussian_filter, gaussian_filter1d

from echoscape.eval.ablation.run import Shown, levels_db
from echoscape.sim.datasets.cartesian import polar_to_cartesian
from echoscape.sim.datasets.polar_scan import Component, PolarScan

ROWS = 120
"""Rows that a polar part has."""
PIXELS = 400
"""Width of a part seen from above."""
_SEARCH_M = 1.0


@dataclass(frozen=True, kw_only=True)
class Part:
    """What of a scan is shown: a square about (ahead, right) [m], or the rows from `row` on up to span_m."""

    ahead_m: float = 0.0
    right_m: float = 0.0
    row: int = 0
    span_m: float


def most_changed(shown: Shown) -> Part:
    """Return the part of a scan that the effect changes most at its last strength."""
    first, last = shown.scans[0], shown.scans[-1]
    span_m, bin_m = shown.effect.span_m, first.bin_m
    if shown.effect.view == "polar":
        change = np.abs(levels_db(last) - levels_db(first))
        bins = min(round(span_m / bin_m), change.shape[1])
        by_row = gaussian_filter1d(change[:, :bins].mean(axis=1), ROWS / 4, mode="wrap")
        middle = int(np.argmax(by_row))
        return Part(row=(middle - min(ROWS, len(change)) // 2) % len(change), span_m=bins * bin_m)
    ahead, right = _most_changed_above(first, last, span_m, counted(last, shown.effect.of))
    return Part(ahead_m=ahead, right_m=right, span_m=span_m)


def counted(scan: PolarScan, of: str) -> NDArray[np.bool_]:
    """Return the cells (azimuths, bins) of a component, of movers, or all of them."""
    if scan.truth is None or not of:
        return np.ones(scan.codes.shape, np.bool_)
    cells = scan.truth.cells
    if of == "mover":
        return cells.moving & (cells.component == Component.DIRECT)
    return cells.component == Component[of.upper()]


def _most_changed_above(
    first: PolarScan, last: PolarScan, span_m: float, cells: NDArray[np.bool_]
) -> tuple[float, float]:
    """Return the middle [m] ahead and to the right of the square that changes most; the radar where none."""
    reach_m = first.codes.shape[1] * first.bin_m
    # Far cells are wide and cover much of the picture: the smaller the part, the nearer it is looked for.
    search_m = min(reach_m, 1.5 * span_m)
    size = round(2 * search_m / _SEARCH_M)
    by_cell = np.abs(levels_db(last) - levels_db(first)) * cells
    change = polar_to_cartesian(by_cell, last.bin_m, pixel_m=_SEARCH_M, size=size)
    window = max(1, round(span_m / _SEARCH_M))
    found = gaussian_filter(change, window / 4, mode="constant")
    room = min(window // 2, (size - 1) // 2)
    inside = found[room : size - room, room : size - room]
    if not inside.max() > 0:
        return 0.0, 0.0
    row, column = np.unravel_index(int(np.argmax(inside)), inside.shape)
    middle = (inside.shape[0] - 1) / 2
    return float((middle - row) * _SEARCH_M), float((column - middle) * _SEARCH_M)


def polar_part(scan: PolarScan, part: Part) -> NDArray[np.float32]:
    """Return rows and ranges of a scan [dB], at most some 1200 columns."""
    rows = (part.row + np.arange(min(ROWS, len(scan.codes)))) % len(scan.codes)
    values = levels_db(scan)[rows, : round(part.span_m / scan.bin_m)]
    step = max(1, values.shape[1] // 1200)
    whole = values[:, : values.shape[1] // step * step]
    return whole.reshape(len(values), -1, step).mean(axis=2)


def above_part(scan: PolarScan, part: Part) -> NDArray[np.float32]:
    """Return a square of a scan seen from above [dB] (PIXELS, PIXELS)."""
    fineness = 2 if part.span_m > 60 else 1
    pixel_m = part.span_m / (PIXELS * fineness)
    reach = max(abs(part.ahead_m), abs(part.right_m)) + part.span_m / 2
    size = 2 * int(np.ceil(reach / pixel_m))
    whole = polar_to_cartesian(levels_db(scan), scan.bin_m, pixel_m=pixel_m, size=size)
    top = round(size / 2 - (part.ahead_m + part.span_m / 2) / pixel_m)
    left = round(size / 2 + (part.right_m - part.span_m / 2) / pixel_m)
    fine = whole[max(top, 0) :, max(left, 0) :][: PIXELS * fineness, : PIXELS * fineness]
    return fine.reshape(PIXELS, fineness, PIXELS, fineness).mean(axis=(1, 3))
