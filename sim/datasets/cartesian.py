"""Polar scans as Cartesian images from above, and back: forward is up, the radar is in the middle.

Azimuth i looks along first_rad + 2 pi i / azimuths, clockwise from ahead; bin k is centred at
(k + 1/2) bin_m. Where a pixel lies in a scan is computed in one place, `polar_places`, for arrays of NumPy
and of torch.
"""

import math
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray


def polar_places(
    offset: Any,
    *,
    first_rad: float,
    turn_rad: float = 0.0,
    shift: tuple[float, float] = (0.0, 0.0),
    xp: Any = np,
) -> tuple[Any, Any]:
    """Compute where the pixels of a square image lie in a polar scan.

    Args:
        offset: Offsets of the pixels' centres from the middle along a side of the image (size,), ascending,
            in range bins.
        first_rad: Direction of the scan's first azimuth, clockwise from ahead [rad].
        turn_rad: Clockwise rotation of the scan about the radar [rad].
        shift: Shift of the scan forward and right after the rotation, in range bins.
        xp: Array namespace of `offset`: `numpy` or `torch`.

    Returns:
        Azimuth in revolutions from the first one, 0 to 1, and range in bins from the first bin's centre,
        which is -1/2 at the radar; each (size, size), the first axis from ahead to behind.
    """
    ahead, aside = shift
    forward, right = (-offset - ahead)[:, None], (offset - aside)[None, :]
    azimuth, range_bins = xp.arctan2(right, forward), xp.hypot(forward, right)
    azimuth -= math.remainder(first_rad + turn_rad, 2 * math.pi)
    azimuth *= 1 / (2 * math.pi)
    azimuth -= xp.floor(azimuth)
    range_bins -= 0.5
    return azimuth, range_bins


def pixel_offsets(size: int, *, pixel_m: float, bin_m: float) -> NDArray[np.float64]:
    """Compute the offsets of the pixels' centres from the middle of an image.

    Args:
        size: Pixels along a side.
        pixel_m: Width of a pixel [m].
        bin_m: Length of a range bin [m].

    Returns:
        Offsets (size,) in range bins, ascending.
    """
    return (np.arange(size, dtype=np.float64) - (size - 1) / 2) * (pixel_m / bin_m)


def range_averages(
    codes: NDArray[np.uint8],
    bin_m: float,
    *,
    cell_m: float,
    cells: int,
    near_m: float = 0.0,
    range_offset_m: float = 0.0,
) -> NDArray[np.uint8]:
    """Average the codes of a scan over longer range cells.

    Cell j covers ranges from j cell_m to (j + 1) cell_m; bin k those from k bin_m + range_offset_m.

    Args:
        codes: Codes (azimuths, bins) [half dB].
        bin_m: Length of a range bin [m].
        cell_m: Length of a range cell [m].
        cells: Number of range cells.
        near_m: Range below which codes count as 0 [m].
        range_offset_m: Offset to the ranges of bins [m].

    Returns:
        Averages (azimuths, cells), rounded to whole codes; 0 beyond the last bin.

    Raises:
        ValueError: `codes` is no scan, or a length is not above 0.
    """
    if codes.ndim != 2 or 0 in codes.shape or codes.dtype != np.uint8:
        raise ValueError(f"codes must be (azimuths, bins) uint8, got {codes.dtype} of shape {codes.shape}")
    _check_sizes(bin_m=bin_m, cell_m=cell_m, cells=cells)
    azimuths, bins = codes.shape
    sums = np.zeros((azimuths, bins + 1), np.float32)  # of whole codes, exact in float32
    np.cumsum(codes, axis=1, out=sums[:, 1:])
    edges_m = np.maximum(np.arange(cells + 1) * cell_m, near_m)
    edges = np.clip((edges_m - range_offset_m) / bin_m, 0, bins)
    low = np.minimum(edges.astype(np.int64), bins - 1)
    part = (edges - low).astype(np.float32)
    below = np.take(sums, low, axis=1) * (1 - part) + np.take(sums, low + 1, axis=1) * part
    return np.rint(np.diff(below, axis=1) * np.float32(bin_m / cell_m)).astype(np.uint8)


def polar_to_cartesian(
    codes: ArrayLike, bin_m: float, *, first_rad: float, pixel_m: float, size: int, turn_rad: float = 0.0
) -> NDArray[np.float32]:
    """Convert a scan to an image, interpolated linearly in azimuth and range.

    Args:
        codes: Real numbers (azimuths, bins).
        bin_m: Length of a range bin [m].
        first_rad: Direction of the first azimuth, clockwise from ahead: `PolarScan.first_azimuth_rad` [rad].
        pixel_m: Width of a pixel [m].
        size: Pixels along a side; the radar is between the middle pixels where it is even.
        turn_rad: Clockwise rotation of the scan about the radar [rad].

    Returns:
        The image (size, size) float32, 0 beyond the centre of the last bin.

    Raises:
        ValueError: A size is not above 0, or `codes` is no scan.
    """
    values = np.asarray(codes, np.float32)
    azimuth, column = _places(
        values, bin_m, first_rad=first_rad, pixel_m=pixel_m, size=size, turn_rad=turn_rad
    )
    azimuths, bins = values.shape
    before, near = np.floor(azimuth).astype(np.int64), np.floor(column).astype(np.int64)
    u, v = (azimuth - before).astype(np.float32), (column - near).astype(np.float32)
    before, after = before % azimuths, (before + 1) % azimuths
    near, far = np.clip(near, 0, bins - 1), np.clip(near + 1, 0, bins - 1)
    first = (1 - v) * values[before, near] + v * values[before, far]
    second = (1 - v) * values[after, near] + v * values[after, far]
    return np.where(column <= bins - 1, (1 - u) * first + u * second, np.float32(0))


def nearest_cells(values: NDArray, bin_m: float, *, first_rad: float, pixel_m: float, size: int) -> NDArray:
    """Convert labels of a scan to an image in which every pixel has the label of its nearest cell.

    Args:
        values: Labels (azimuths, bins).
        bin_m: Length of a range bin [m].
        first_rad: Direction of the first azimuth, clockwise from ahead: `PolarScan.first_azimuth_rad` [rad].
        pixel_m: Width of a pixel [m].
        size: Pixels along a side.

    Returns:
        The image (size, size) of the same type, 0 beyond the end of the last bin.

    Raises:
        ValueError: A size is not above 0, or `values` is no scan.
    """
    azimuth, column = _places(values, bin_m, first_rad=first_rad, pixel_m=pixel_m, size=size)
    azimuths, bins = values.shape
    cells = np.clip(np.rint(column), 0, bins - 1).astype(np.int64)
    image = values[np.rint(azimuth).astype(np.int64) % azimuths, cells]
    return np.where(column <= bins - 0.5, image, np.zeros((), values.dtype))


def cartesian_to_polar(
    image: ArrayLike, *, first_rad: float, pixel_m: float, azimuths: int, bins: int, bin_m: float
) -> NDArray[np.float32]:
    """Convert an image to a scan, interpolated linearly between the centres of its pixels.

    Args:
        image: Real numbers (height, width), forward up and right to the right, the radar in the middle.
        first_rad: Direction of the scan's first azimuth, clockwise from ahead [rad].
        pixel_m: Width of a pixel [m].
        azimuths: Azimuths of the scan.
        bins: Range bins of the scan.
        bin_m: Length of a range bin [m].

    Returns:
        The scan (azimuths, bins) float32, 0 outside the centres of the outermost pixels.

    Raises:
        ValueError: A size is not above 0, or `image` is no image.
    """
    values = np.asarray(image, np.float32)
    if values.ndim != 2 or 0 in values.shape:
        raise ValueError(f"image must be (height, width), got shape {values.shape}")
    _check_sizes(pixel_m=pixel_m, azimuths=azimuths, bins=bins, bin_m=bin_m)
    azimuth = first_rad + np.arange(azimuths)[:, None] * (2 * math.pi / azimuths)
    range_m = (np.arange(bins) + 0.5) * bin_m
    height, width = values.shape
    # A billionth of a pixel, so that no cell on the edge is lost to rounding.
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


def _places(
    values: NDArray, bin_m: float, *, first_rad: float, pixel_m: float, size: int, turn_rad: float = 0.0
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Return the fractional azimuth index and bin (size, size) of every pixel's centre in the scan."""
    if values.ndim != 2 or 0 in values.shape:
        raise ValueError(f"codes must be (azimuths, bins), got shape {values.shape}")
    _check_sizes(bin_m=bin_m, pixel_m=pixel_m, size=size)
    offsets = pixel_offsets(size, pixel_m=pixel_m, bin_m=bin_m)
    azimuth, column = polar_places(offsets, first_rad=first_rad, turn_rad=turn_rad)
    return azimuth * values.shape[0], column
