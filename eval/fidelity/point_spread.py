"""Point spread measured on isolated peaks of a scan: profiles over range and azimuth, and their widths.

The width of a peak at a level is the distance between the points on both sides where its profile,
interpolated linearly in decibels, falls below that level. Real scans are described by the median over peaks.
"""

import math

import numpy as np
from numpy.typing import NDArray
from scipy.ndimage import maximum_filter

from echoscape.eval.fidelity.scan_statistics import Codes, Ranges

LEVELS_DB = (3.0, 6.0, 10.0, 20.0, 30.0)
"""Levels below the peak at which widths are taken [dB]."""
ISOLATION_M = 2.6
"""Half the range interval in which a peak must be the highest, and that profiles cover [m]."""
ISOLATION_DEG = 7.2
"""The same in azimuth [deg]."""
_MIN_CODE = 80
_FIRST_M, _LAST_M = 2.5, 160.0


def reach(codes: Codes, bin_m: float) -> tuple[int, int]:
    """Convert the isolation distances to cells.

    Args:
        codes: Codes (azimuths, bins) [half dB].
        bin_m: Length of a range bin [m].

    Returns:
        Azimuths of `ISOLATION_DEG` and bins of `ISOLATION_M`, each at least 1.
    """
    return max(1, round(ISOLATION_DEG * len(codes) / 360)), max(1, round(ISOLATION_M / bin_m))


def isolated_peaks(codes: Codes, range_m: Ranges, bin_m: float) -> NDArray[np.int64]:
    """Find isolated peaks: code 80 or more, and none larger within the isolation distances.

    Args:
        codes: Codes (azimuths, bins) [half dB].
        range_m: Range of the centre of each bin (bins,) [m].
        bin_m: Length of a range bin [m].

    Returns:
        Azimuth and range bin (peaks, 2); equal neighbours all count, peaks too near an end are left out.
    """
    azimuths, bins = reach(codes, bin_m)
    top = maximum_filter(codes, (2 * azimuths + 1, 2 * bins + 1), mode=("wrap", "nearest"))  # type: ignore[arg-type]
    peak = (codes == top) & (codes >= _MIN_CODE)
    peak[:, (range_m < _FIRST_M) | (range_m >= _LAST_M)] = False
    peak[:, :bins] = False
    peak[:, -bins:] = False
    return np.argwhere(peak)


def profiles(
    codes: Codes, peaks: NDArray[np.int64], bin_m: float
) -> tuple[NDArray[np.float32], NDArray[np.float32]]:
    """Extract the profiles of peaks.

    Args:
        codes: Codes (azimuths, bins) [half dB].
        peaks: Azimuth and range bin (peaks, 2).
        bin_m: Length of a range bin [m].

    Returns:
        Profiles over range (peaks, 2 bins + 1) and azimuth (peaks, 2 azimuths + 1), relative to the peak
        [dB].
    """
    azimuths, bins = reach(codes, bin_m)
    azimuth, column = peaks[:, :1], peaks[:, 1:]
    top = codes[azimuth, column].astype(np.float32)
    along = codes[azimuth, column + np.arange(-bins, bins + 1)]
    across = codes[(azimuth + np.arange(-azimuths, azimuths + 1)) % len(codes), column]
    return (along - top) / np.float32(2), (across - top) / np.float32(2)


def widths(profile_db: NDArray[np.float32], level_db: float) -> NDArray[np.float64]:
    """Compute the full width of each profile at a level.

    Profiles are 0 dB at their middle and nowhere above.

    Args:
        profile_db: Profiles (peaks, offsets) relative to their peak [dB].
        level_db: Level below the peak [dB].

    Returns:
        Widths (peaks,) [cells], NaN where a profile does not fall that far.
    """
    middle = profile_db.shape[1] // 2
    halves = [_half(side, level_db) for side in (profile_db[:, middle:], profile_db[:, middle::-1])]
    return halves[0] + halves[1]


def _half(side_db: NDArray[np.float32], level_db: float) -> NDArray[np.float64]:
    """Return the distance [cells] at which each half profile (P, n + 1) falls below -`level_db`."""
    below = side_db <= -level_db
    after = np.maximum(below.argmax(axis=1), 1)
    number = np.arange(len(side_db))
    inner = side_db[number, after - 1].astype(np.float64)
    outer = side_db[number, after].astype(np.float64)
    crossing = after - 1 + (inner + level_db) / np.maximum(inner - outer, 1e-9)
    return np.where(below.any(axis=1), crossing, np.nan)


def median_width(profile_db: NDArray[np.float32], level_db: float) -> float:
    """Compute the median width over peaks.

    Args:
        profile_db: Profiles (peaks, offsets) relative to their peak [dB].
        level_db: Level below the peak [dB].

    Returns:
        The median [cells], NaN if no profile falls that far.
    """
    found = widths(profile_db, level_db) if len(profile_db) else np.empty(0)
    found = found[np.isfinite(found)]
    return float(np.median(found)) if found.size else math.nan


def median_profile(profile_db: NDArray[np.float32]) -> NDArray[np.float64]:
    """Compute the median profile over peaks.

    Args:
        profile_db: Profiles (peaks, offsets) relative to their peak [dB].

    Returns:
        Level at each offset (offsets,) [dB], NaN without peaks.
    """
    if not len(profile_db):
        return np.full(profile_db.shape[1], np.nan)
    return np.median(profile_db, axis=0).astype(np.float64)


def level_at(profile_db: NDArray[np.float64], offset: float) -> float:
    """Read a profile at an offset, as the mean of both sides.

    Args:
        profile_db: One profile (offsets,) [dB].
        offset: Distance from the middle [cells].

    Returns:
        The level [dB], NaN beyond the profile's end.
    """
    middle = len(profile_db) // 2
    if offset > middle:
        return math.nan
    return float(np.interp([middle - offset, middle + offset], np.arange(len(profile_db)), profile_db).mean())
