"""The point spread as isolated peaks of a scan show it: profiles over range and azimuth and their widths.

A peak's width at a level is where its own profile, straight between cells in decibels, falls below that level
on either side; the median over peaks is what real scans are described by.
"""

import math

import numpy as np
from numpy.typing import NDArray
from scipy.ndimage import maximum_filter

from echoscape.eval.fidelity.scan_statistics import Codes, Ranges

LEVELS_DB = (3.0, 6.0, 10.0, 20.0, 30.0)
"""Levels below the peak at which widths are taken [dB]."""
ALONE_M = 2.6
"""Half the stretch of range over which a peak must be the highest, and profiles reach [m]."""
ALONE_DEG = 7.2
"""The same over azimuth [deg]."""
_LEAST_CODE = 80
_FIRST_M, _LAST_M = 2.5, 160.0


def reach(codes: Codes, bin_m: float) -> tuple[int, int]:
    """Return how many rows and bins `ALONE_DEG` and `ALONE_M` are, at least 1."""
    return max(1, round(ALONE_DEG * len(codes) / 360)), max(1, round(ALONE_M / bin_m))


def isolated_peaks(codes: Codes, range_m: Ranges, bin_m: float) -> NDArray[np.int64]:
    """Return row and bin (P, 2) of peaks of code 80 or more that nothing within the reach passes.

    Equal cells side by side count each. Peaks too near an end for a whole profile are left out.
    """
    rows, bins = reach(codes, bin_m)
    top = maximum_filter(codes, (2 * rows + 1, 2 * bins + 1), mode=("wrap", "nearest"))  # type: ignore[arg-type]
    peak = (codes == top) & (codes >= _LEAST_CODE)
    peak[:, (range_m < _FIRST_M) | (range_m >= _LAST_M)] = False
    peak[:, :bins] = False
    peak[:, -bins:] = False
    return np.argwhere(peak)


def profiles(
    codes: Codes, peaks: NDArray[np.int64], bin_m: float
) -> tuple[NDArray[np.float32], NDArray[np.float32]]:
    """Return the profiles of peaks (P, 2) over range (P, 2 bins + 1) and azimuth (P, 2 rows + 1) [dB]."""
    rows, bins = reach(codes, bin_m)
    row, column = peaks[:, :1], peaks[:, 1:]
    top = codes[row, column].astype(np.float32)
    along = codes[row, column + np.arange(-bins, bins + 1)]
    across = codes[(row + np.arange(-rows, rows + 1)) % len(codes), column]
    return (along - top) / np.float32(2), (across - top) / np.float32(2)


def widths(profile_db: NDArray[np.float32], level_db: float) -> NDArray[np.float64]:
    """Return the full width [cells] of each profile (P, 2 n + 1) where it is `level_db` below its middle.

    NaN where a profile does not fall that far. Profiles are 0 dB at their middle and nowhere above.
    """
    middle = profile_db.shape[1] // 2
    halves = [_half(side, level_db) for side in (profile_db[:, middle:], profile_db[:, middle::-1])]
    return halves[0] + halves[1]


def _half(side_db: NDArray[np.float32], level_db: float) -> NDArray[np.float64]:
    """Return how many cells from its first each row (P, n + 1) falls below -`level_db`."""
    below = side_db <= -level_db
    after = np.maximum(below.argmax(axis=1), 1)
    number = np.arange(len(side_db))
    inner = side_db[number, after - 1].astype(np.float64)
    outer = side_db[number, after].astype(np.float64)
    crossing = after - 1 + (inner + level_db) / np.maximum(inner - outer, 1e-9)
    return np.where(below.any(axis=1), crossing, np.nan)


def median_width(profile_db: NDArray[np.float32], level_db: float) -> float:
    """Return the median of the widths [cells] over peaks, NaN if none falls that far."""
    found = widths(profile_db, level_db) if len(profile_db) else np.empty(0)
    found = found[np.isfinite(found)]
    return float(np.median(found)) if found.size else math.nan


def median_profile(profile_db: NDArray[np.float32]) -> NDArray[np.float64]:
    """Return the median over peaks (P, n) of the level at each offset (n,) [dB], NaN without peaks."""
    if not len(profile_db):
        return np.full(profile_db.shape[1], np.nan)
    return np.median(profile_db, axis=0).astype(np.float64)


def level_at(profile_db: NDArray[np.float64], offset: float) -> float:
    """Return the level `offset` cells from the middle of one profile (2 n + 1,), mean of both sides [dB].

    NaN beyond the profile's end.
    """
    middle = len(profile_db) // 2
    if offset > middle:
        return math.nan
    return float(np.interp([middle - offset, middle + offset], np.arange(len(profile_db)), profile_db).mean())
