"""Statistics of one polar scan: levels, noise, strongest returns, peaks, spokes and leakage, as plain arrays.

Definitions are those with which published raw scans (Barnes et al., "The Oxford Radar RobotCar Dataset", ICRA
2020) give the figures of eval/fidelity/reference_values.py; ranges come with the scan, so any sensor can be measured.
"""

from itertools import pairwise

import numpy as np
from numpy.typing import NDArray
from scipy.ndimage import maximum_filter, maximum_filter1d

from echoscape.sim.receiver import quantiser

Codes = NDArray[np.uint8]
"""Codes (azimuths, bins) of a scan, half decibels."""
Ranges = NDArray[np.floating]
"""Range of the middle of each bin (bins,) [m]."""

BAND_M = 2.5
"""Width of the finest range bands [m]."""
ENVELOPE_M = (3.0, 5.0, 10.0, 20.0, 40.0, 60.0, 80.0, 100.0, 120.0, 163.0)
"""Edges of the bands of the lower envelope [m]."""
NEAR_M = 4.0
"""End of the range in which leakage is looked at [m]."""
LAGS = 16
"""Lags over range at which noise is correlated with itself [bins]."""
_FIRST_M = 2.5
"""Where leakage has ended, so that a row's strongest cell is an echo [m]."""
_FAR_SHARE = 0.75
"""From this share of the range on echoes are rare."""
_QUIET_SHARE = 0.1
_SPOKE_FROM_M = 60.0
_SPOKE_CODE = 15
_MAXIMA_CODE, _MAXIMA_BINS = 58, 21
_PEAK_CODE, _PEAK_ROWS, _PEAK_BINS = 80, 9, 41
_EXACT = 1 << 15
"""Integer powers counted through to learn what a code stands for; beyond, a code is 10^(code / 20)."""


def _code_power() -> NDArray[np.float64]:
    """Return the mean integer power that each code stands for (256,); 0 is half way between 0 and 1."""
    counts = np.arange(_EXACT)
    code = quantiser.codes(counts)
    number = np.bincount(code, minlength=256)
    power = np.bincount(code, counts, 256) / np.maximum(number, 1)
    code_of_last = int(code[-1])
    loud = np.arange(256) >= code_of_last
    power[loud] = 10 ** (np.arange(256)[loud] / 20)
    return power


CODE_POWER = _code_power()
"""Mean integer power (256,) behind each code; 0 where a code never occurs."""
WRITABLE = np.isin(np.arange(256), quantiser.codes(2.0 ** np.linspace(0, 43, 1 << 16)))
"""Codes (256,) that the quantiser can write."""


# ---------------------------------------------------------------------- levels


def range_histograms(codes: Codes, range_m: Ranges) -> NDArray[np.int64]:
    """Return how often each code occurs in each band `BAND_M` wide from the radar outwards (bands, 256)."""
    band = np.maximum(range_m / BAND_M, 0).astype(np.int64)
    bands = int(band.max()) + 1
    flat = np.bincount((codes + 256 * band).ravel(), minlength=256 * bands)
    return flat.reshape(bands, 256)


def near_histograms(codes: Codes, range_m: Ranges) -> NDArray[np.int64]:
    """Return how often each code occurs in each bin up to `NEAR_M` (bins, 256): the leakage."""
    near = codes[:, range_m < NEAR_M]
    bins = near.shape[1]
    return np.bincount((near + 256 * np.arange(bins)).ravel(), minlength=256 * bins).reshape(bins, 256)


def exceedance(histogram: NDArray[np.int64]) -> NDArray[np.float64]:
    """Return the share of cells at or above each code (256,) of a histogram (256,)."""
    return histogram[::-1].cumsum()[::-1] / max(int(histogram.sum()), 1)


def quantile(histogram: NDArray[np.int64], share: float) -> float:
    """Return the least code that at least `share` of the cells of a histogram (256,) do not pass."""
    total = int(histogram.sum())
    return float(np.argmax(histogram.cumsum() >= share * total)) if total else float("nan")


def moments(histogram: NDArray[np.int64]) -> tuple[float, float]:
    """Return mean and standard deviation of the codes of a histogram (256,)."""
    total = int(histogram.sum())
    if not total:
        return float("nan"), float("nan")
    mean = float(histogram @ np.arange(256)) / total
    return mean, float(np.sqrt(histogram @ (np.arange(256) - mean) ** 2 / total))


def band_powers(codes: Codes, range_m: Ranges) -> NDArray[np.float64]:
    """Return the mean power of each row in the bands of `ENVELOPE_M` (azimuths, bands); NaN beyond the end.

    The 5th percentile over rows is the lower envelope: what a row with hardly an echo holds.
    """
    power = CODE_POWER[codes]
    columns = []
    for low, high in pairwise(ENVELOPE_M):
        inside = (range_m >= low) & (range_m < high)
        columns.append(power[:, inside].mean(axis=1) if inside.any() else np.full(len(codes), np.nan))
    return np.stack(columns, axis=1)


# ---------------------------------------------------------------------- noise


def noise_region(codes: Codes, range_m: Ranges) -> tuple[NDArray[np.bool_], NDArray[np.bool_]]:
    """Return the rows (azimuths,) and bins (bins,) whose crossings hold little but noise.

    The bins of the last quarter of the range, and of the rows the tenth with the least mean code there. The
    choice itself lowers the mean of pure noise by about a tenth; it does so in every scan alike.
    """
    far = range_m >= _FAR_SHARE * range_m[-1]
    mean = codes[:, far].mean(axis=1)
    return mean <= np.quantile(mean, _QUIET_SHARE), far


def noise_mean(silent: float) -> float:
    """Return the mean of the exponential noise power of which a share `silent` is written as 0.

    Code 0 stands for powers that round to 0 or 1: silent = 1 - exp(-1.5 / mean).
    """
    return float(-1.5 / np.log1p(-silent)) if 0 < silent < 1 else float("nan")


def range_correlation(power: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return the autocorrelation over range of powers (rows, bins) at lags 0 to `LAGS` (LAGS + 1,)."""
    off = power - power.mean()
    variance = float((off**2).mean())
    bins = power.shape[1]
    lags = [float((off[:, : bins - lag] * off[:, lag:]).mean()) for lag in range(min(LAGS + 1, bins))]
    found = np.full(LAGS + 1, np.nan)
    if variance > 0:
        found[: len(lags)] = np.array(lags) / variance
    return found


def correlation(one: NDArray[np.float64], other: NDArray[np.float64]) -> float:
    """Return the correlation coefficient of two arrays of powers of one shape; NaN where one is constant."""
    if one.size < 2 or not one.std() * other.std() > 0:
        return float("nan")
    return float(((one - one.mean()) * (other - other.mean())).mean() / (one.std() * other.std()))


def row_correlation(power: NDArray[np.float64], quiet: NDArray[np.bool_]) -> float:
    """Return the correlation of noise (azimuths, bins) between adjacent rows that are both `quiet`."""
    pairs = np.flatnonzero(quiet & np.roll(quiet, -1))
    return correlation(power[pairs], power[(pairs + 1) % len(power)])


# ---------------------------------------------------------------------- echoes


def strongest(codes: Codes, range_m: Ranges, ranks: NDArray[np.int64]) -> NDArray[np.int64]:
    """Return how often each code is the k-th strongest of a row beyond 2.5 m, (ranks, 256); k from 1."""
    order = np.sort(codes[:, range_m >= _FIRST_M], axis=1)
    inside = np.minimum(ranks, order.shape[1])
    return np.stack([np.bincount(order[:, -k], minlength=256) for k in inside])


def local_maxima(codes: Codes, range_m: Ranges) -> int:
    """Return the number of cells beyond 4 m of code 58 or more that none within 10 bins of the row passes.

    Equal neighbours count each, as they do where cells are compared with the maximum around them.
    """
    top = maximum_filter1d(codes, _MAXIMA_BINS, axis=1, mode="nearest")
    return int(((codes == top) & (codes >= _MAXIMA_CODE))[:, range_m >= NEAR_M].sum())


def strong_peaks(codes: Codes, range_m: Ranges) -> int:
    """Return the number of cells, 4 to 100 m, of code 80 or more that none within 4 rows, 20 bins passes."""
    top = maximum_filter(codes, (_PEAK_ROWS, _PEAK_BINS), mode=("wrap", "nearest"))  # type: ignore[arg-type]
    inside = (range_m >= NEAR_M) & (range_m < 100.0)
    return int(((codes == top) & (codes >= _PEAK_CODE))[:, inside].sum())


def far_medians(codes: Codes, range_m: Ranges) -> NDArray[np.float64]:
    """Return each row's median code beyond 60 m (azimuths,), NaN where the scan ends before."""
    far = codes[:, range_m >= _SPOKE_FROM_M]
    return np.median(far, axis=1) if far.shape[1] else np.full(len(codes), np.nan)


def spoke_rows(far_median: NDArray[np.float64]) -> NDArray[np.bool_]:
    """Return the rows whose median code beyond 60 m is 15 or more: full-length streaks."""
    return far_median >= _SPOKE_CODE
