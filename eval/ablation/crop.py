"""The part of a scan that an artefact changes most, from above or as the sensor writes it.

It maximises the change of level, smoothed over the size of the part, of the cells that the artefact concerns.
"""

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.ndimage import gaussian_filter, gaussian_filter1d

from echoscape.eval.ablation.run import CaseScans, levels_db
from echoscape.sim.datasets.cartesian import polar_to_cartesian
from echoscape.sim.datasets.polar_scan import Component, PolarScan

AZIMUTHS = 120
"""Azimuths of a polar part."""
PIXELS = 400
"""Width of a part seen from above."""
_SEARCH_M = 1.0
_COLUMNS = 1200


@dataclass(frozen=True, kw_only=True)
class Part:
    """A part of a scan: a square seen from above, or some azimuths.

    Attributes:
        forward_m: Centre of the square, ahead of the car [m].
        right_m: Centre of the square, to the right [m].
        azimuth: Number of the first azimuth of a polar part.
        edges_rad: Azimuths at which a polar part begins and ends, clockwise from ahead [rad].
        span_m: Side of the square, or range up to which a polar part reaches [m].
    """

    forward_m: float = 0.0
    right_m: float = 0.0
    azimuth: int = 0
    edges_rad: tuple[float, float] = (0.0, 0.0)
    span_m: float


def most_changed(found: CaseScans) -> Part:
    """Find the part of a scan that an artefact changes most at its last strength.

    Args:
        found: The scan at each strength.

    Returns:
        The part.
    """
    first, last = found.scans[0], found.scans[-1]
    span_m, bin_m = found.case.span_m, first.bin_m
    if found.case.view == "polar":
        change = np.abs(levels_db(last) - levels_db(first))
        bins = min(round(span_m / bin_m), change.shape[1])
        by_azimuth = gaussian_filter1d(change[:, :bins].mean(axis=1), AZIMUTHS / 4, mode="wrap")
        count = min(AZIMUTHS, len(change))
        azimuth = (int(np.argmax(by_azimuth)) - count // 2) % len(change)
        step_rad = 2 * math.pi / len(change)
        edges_rad = (first.seam_rad + azimuth * step_rad, first.seam_rad + (azimuth + count) * step_rad)
        return Part(azimuth=azimuth, edges_rad=edges_rad, span_m=bins * bin_m)
    forward, right = _most_changed_above(first, last, span_m, region_cells(last, found.case.region))
    return Part(forward_m=forward, right_m=right, span_m=span_m)


def region_cells(scan: PolarScan, region: str) -> NDArray[np.bool_]:
    """Return the cells that an artefact concerns.

    Args:
        scan: The scan with its truth.
        region: Name of a component (of ghosts the displaced ones), "mover" for direct echoes of
            moving objects, or "" for all.

    Returns:
        Whether each cell (azimuths, bins) is one of them; all of them without truth.
    """
    if scan.truth is None or not region:
        return np.ones(scan.codes.shape, np.bool_)
    cells = scan.truth.cells
    if region == "mover":
        return cells.moving & (cells.component == Component.DIRECT)
    concerned = cells.component == Component[region.upper()]
    return concerned & cells.displaced if region == "ghost" else concerned


def _most_changed_above(
    first: PolarScan, last: PolarScan, span_m: float, cells: NDArray[np.bool_]
) -> tuple[float, float]:
    """Return forward and right [m] of the square that changes most, (0, 0) where nothing does."""
    range_m = first.codes.shape[1] * first.bin_m
    # Far cells are wide and cover much of the image: the smaller the part, the nearer it is searched.
    search_m = min(range_m, 1.5 * span_m)
    size = round(2 * search_m / _SEARCH_M)
    by_cell = np.abs(levels_db(last) - levels_db(first)) * cells
    change = polar_to_cartesian(
        by_cell, last.bin_m, first_rad=last.first_azimuth_rad, pixel_m=_SEARCH_M, size=size
    )
    window = max(1, round(span_m / _SEARCH_M))
    smooth = gaussian_filter(change, window / 4, mode="constant")
    margin = min(window // 2, (size - 1) // 2)
    inside = smooth[margin : size - margin, margin : size - margin]
    if not inside.max() > 0:
        return 0.0, 0.0
    row, column = np.unravel_index(int(np.argmax(inside)), inside.shape)
    middle = (inside.shape[0] - 1) / 2
    return float((middle - row) * _SEARCH_M), float((column - middle) * _SEARCH_M)


def polar_part(scan: PolarScan, part: Part) -> NDArray[np.float32]:
    """Return a part of a scan as the sensor writes it.

    Args:
        scan: The scan.
        part: Its part.

    Returns:
        Levels (azimuths, columns) [dB], range bins averaged to some 1200 columns.
    """
    azimuths = (part.azimuth + np.arange(min(AZIMUTHS, len(scan.codes)))) % len(scan.codes)
    values = levels_db(scan)[azimuths, : round(part.span_m / scan.bin_m)]
    step = max(1, values.shape[1] // _COLUMNS)
    whole = values[:, : values.shape[1] // step * step]
    return whole.reshape(len(values), -1, step).mean(axis=2)


def above_part(scan: PolarScan, part: Part) -> NDArray[np.float32]:
    """Return a part of a scan seen from above.

    Args:
        scan: The scan.
        part: Its part.

    Returns:
        Levels (PIXELS, PIXELS) [dB].
    """
    oversampling = 2 if part.span_m > 60 else 1
    pixel_m = part.span_m / (PIXELS * oversampling)
    reach = max(abs(part.forward_m), abs(part.right_m)) + part.span_m / 2
    size = 2 * int(np.ceil(reach / pixel_m))
    whole = polar_to_cartesian(
        levels_db(scan), scan.bin_m, first_rad=scan.first_azimuth_rad, pixel_m=pixel_m, size=size
    )
    top = round(size / 2 - (part.forward_m + part.span_m / 2) / pixel_m)
    left = round(size / 2 + (part.right_m - part.span_m / 2) / pixel_m)
    fine = whole[max(top, 0) :, max(left, 0) :][: PIXELS * oversampling, : PIXELS * oversampling]
    return fine.reshape(PIXELS, oversampling, PIXELS, oversampling).mean(axis=(1, 3))
