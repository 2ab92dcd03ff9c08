"""Polar scans as pictures seen from above and back: forward is up, right is right, the radar in the middle.

Row i looks along azimuth 2 pi i / azimuths, clockwise from ahead; bin k is centred at (k + 1/2) bin_m.
"""

import math

import numpy as np
from numpy.typing import ArrayLike, NDArray

Grid = tuple[NDArray[np.float64], NDArray[np.float64]]


def polar_to_cartesian(codes: ArrayLike, bin_m: float, *, pixel_m: float, size: int) -> NDArray[np.float32]:
    """Return a scan as a picture (size, size) float32, interpolated linearly in azimuth and range.

    codes: (azimuths, bins) real numbers; pixel_m: width of a pixel [m]; the radar is at the middle of the
    picture, between the middle pixels where `size` is even. Beyond the last bin's centre the picture is 0.

    Raises:
        ValueError: an argument is no size or no scan.
    """
    values = np.asarray(codes, np.float32)
    row, column = _places(values, bin_m, pixel_m=pixel_m, size=size)
    azimuths, bins = values.shape
    low_row, low_column = np.floor(row).astype(np.int64), np.floor(column).astype(np.int64)
    u, v = (row - low_row).astype(np.float32), (column - low_column).astype(np.float32)
    above, below = low_row % azimuths, (low_row + 1) % azimuths
    near, far = np.clip(low_column, 0, bins - 1), np.clip(low_column + 1, 0, bins - 1)
    first = (1 - v) * values[above, near] + v * values[above, far]
    second = (1 - v) * values[below, near] + v * values[below, far]
    return np.where(column <= bins - 1, (1 - u) * first + u * second, np.float32(0))


def nearest_cells(values: NDArray, bin_m: float, *, pixel_m: float, size: int) -> NDArray:
    """Return labels (azimuths, bins) as a picture (size, size) of the same type: each pixel's nearest cell.

    Raises:
        ValueError: an argument is no size or no scan.
    """
    row, column = _places(values, bin_m, pixel_m=pixel_m, size=size)
    azimuths, bins = values.shape
    cells = np.clip(np.rint(column), 0, bins - 1).astype(np.int64)
    picture = values[np.rint(row).astype(np.int64) % azimuths, cells]
    return np.where(column <= bins - 0.5, picture, np.zeros((), values.dtype))


def cartesian_to_polar(
    picture: ArrayLike, *, pixel_m: float, azimuths: int, bins: int, bin_m: float
) -> NDArray[np.float32]:
    """Return a picture as a scan (azimuths, bins) float32, interpolated linearly between pixels' middles.

    picture: (height, width) real numbers, forward up and right right; pixel_m: width of a pixel [m]; the
    radar is at the middle of the picture. Outside the outermost pixels' middles the scan is 0.

    Raises:
        ValueError: an argument is no size or no picture.
    """
    values = np.asarray(picture, np.float32)
    if values.ndim != 2 or 0 in values.shape:
        raise ValueError(f"picture must be (height, width), got shape {values.shape}")
    _check_sizes(pixel_m=pixel_m, azimuths=azimuths, bins=bins, bin_m=bin_m)
    azimuth = np.arange(azimuths)[:, None] * (2 * math.pi / azimuths)
    range_m = (np.arange(bins) + 0.5) * bin_m
    height, width = values.shape
    # A billionth of a pixel, so that what lies on the edge is not lost to rounding.
    down = np.round((height - 1) / 2 - np.cos(azimuth) * range_m / pixel_m, 9)
    right = np.round((width - 1) / 2 + np.sin(azimuth) * range_m / pixel_m, 9)
    inside = (down >= 0) & (down <= height - 1) & (right >= 0) & (right <= width - 1)
    y, x = np.clip(down, 0, height - 1), np.clip(right, 0, width - 1)
    top, left = y.astype(np.int64), x.astype(np.int64)
    bottom, beside = np.minimum(top + 1, height - 1), np.minimum(left + 1, width - 1)
    u, v = (y - top).astype(np.float32), (x - left).astype(np.float32)
    above = (1 - v) * values[top, left] + v * values[top, beside]
    below = (1 - v) * values[bottom, left] + v * values[bottom, beside]
    return np.where(inside, (1 - u) * above + u * below, np.float32(0))


def _check_sizes(**sizes: float) -> None:
    """Raise ValueError unless every size is finite and above 0."""
    for name, value in sizes.items():
        if not (math.isfinite(value) and value > 0):
            raise ValueError(f"{name} must be finite and above 0, got {value}")


def _places(values: NDArray, bin_m: float, *, pixel_m: float, size: int) -> Grid:
    """Return the fractional row and column (size, size) of every pixel's middle in the scan."""
    if values.ndim != 2 or 0 in values.shape:
        raise ValueError(f"codes must be (azimuths, bins), got shape {values.shape}")
    _check_sizes(bin_m=bin_m, pixel_m=pixel_m, size=size)
    offset = (np.arange(size) - (size - 1) / 2) * pixel_m
    right, forward = offset[None, :], -offset[:, None]
    azimuth = np.arctan2(right, forward) % (2 * math.pi)
    return azimuth * (values.shape[0] / (2 * math.pi)), np.hypot(right, forward) / bin_m - 0.5
