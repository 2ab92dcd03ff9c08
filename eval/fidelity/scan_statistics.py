"""Statistics of one polar scan as arrays: levels, noise, strongest range bins, peaks, spokes and leakage.

With these definitions published raw scans (Barnes et al., "The Oxford Radar RobotCar Dataset", ICRA 2020)
give the targets of eval/fidelity/reference_values.py. Ranges come with the scan, so any sensor can be
measured.
"""

from itertools import pairwise

import numpy as np
from numpy.typing import NDArray
from scipy.ndimage import maximum_filter, maximum_filter1d

from echoscape.sim.receiver import quantiser

Codes = NDArray[np.uint8]
"""Codes (azimuths, bins) of a scan [half dB]."""
Ranges = NDArray[np.floating]
"""Range of the centre of each bin (bins,) [m]."""

BAND_M = 2.5
"""Width of the finest range bands [m]."""
ENVELOPE_M = (3.0, 5.0, 10.0, 20.0, 40.0, 60.0, 80.0, 100.0, 120.0, 163.0)
"""Edges of the bands of the lower envelope [m]."""
NEAR_M = 4.0
"""Range up to which leakage is measured [m]."""
LAGS = 16
"""Lags over range at which noise is correlated with itself [bins]."""
_FIRST_M = 2.5
"""Range beyond which leakage is weaker than echoes [m]."""
_FAR_SHARE = 0.75
"""Share of the range beyond which echoes are rare."""
_QUIET_SHARE = 0.1
_SPOKE_FROM_M = 60.0
_SPOKE_CODE = 15
_MAXIMA_CODE, _MAXIMA_BINS = 58, 21
_PEAK_CODE, _PEAK_AZIMUTHS, _PEAK_BINS = 80, 9, 41
_EXACT = 1 << 15
"""Integer powers that are enumerated to find the mean power of a code; beyond them it is 10^(code / 20)."""


def _code_power() -> NDArray[np.float64]:
    """Return the mean integer power of each code (256,); code 0 has 0.5, the mean of 0 and 1."""
    counts = np.arange(_EXACT)
    code = quantiser.codes(counts)
    number = np.bincount(code, minlength=256)
    power = np.bincount(code, counts, 256) / np.maximum(number, 1)
    code_of_last = int(code[-1])
    beyond = np.arange(256) >= code_of_last
    power[beyond] = 10 ** (np.arange(256)[beyond] / 20)
    return power


CODE_POWER = _code_power()
"""Mean integer power of each code (256,); 0 for codes that the quantiser cannot produce."""
VALID_CODES = np.isin(np.arange(256), quantiser.codes(2.0 ** np.linspace(0, 43, 1 << 16)))
"""Whether the quantiser can produce each code (256,)."""


# ---------------------------------------------------------------------- levels


def range_histograms(codes: Codes, range_m: Ranges) -> NDArray[np.int64]:
    """Count codes in each range band of `BAND_M`.

    Args:
        codes: Codes (azimuths, bins) [half dB].
        range_m: Range of the centre of each bin (bins,) [m].

    Returns:
        Number of cells by band and code (bands, 256).
    """
    band = np.maximum(range_m / BAND_M, 0).astype(np.int64)
    bands = int(band.max()) + 1
    flat = np.bincount((codes + 256 * band).ravel(), minlength=256 * bands)
    return flat.reshape(bands, 256)


def near_histograms(codes: Codes, range_m: Ranges) -> NDArray[np.int64]:
    """Count codes in each range bin up to `NEAR_M`, where leakage is.

    Args:
        codes: Codes (azimuths, bins) [half dB].
        range_m: Range of the centre of each bin (bins,) [m].

    Returns:
        Number of cells by range bin and code (bins, 256).
    """
    near = codes[:, range_m < NEAR_M]
    bins = near.shape[1]
    return np.bincount((near + 256 * np.arange(bins)).ravel(), minlength=256 * bins).reshape(bins, 256)


def exceedance(histogram: NDArray[np.int64]) -> NDArray[np.float64]:
    """Compute the share of cells at or above each code.

    Args:
        histogram: Number of cells by code (256,).

    Returns:
        Share by code (256,).
    """
    return histogram[::-1].cumsum()[::-1] / max(int(histogram.sum()), 1)


def quantile(histogram: NDArray[np.int64], share: float) -> float:
    """Compute a quantile of codes.

    Args:
        histogram: Number of cells by code (256,).
        share: Share of the cells, 0 to 1.

    Returns:
        The smallest code that at least `share` of the cells do not exceed, NaN without cells.
    """
    total = int(histogram.sum())
    return float(np.argmax(histogram.cumsum() >= share * total)) if total else float("nan")


def moments(histogram: NDArray[np.int64]) -> tuple[float, float]:
    """Compute the mean and standard deviation of codes.

    Args:
        histogram: Number of cells by code (256,).

    Returns:
        Mean and standard deviation [half dB], NaN without cells.
    """
    total = int(histogram.sum())
    if not total:
        return float("nan"), float("nan")
    mean = float(histogram @ np.arange(256)) / total
    return mean, float(np.sqrt(histogram @ (np.arange(256) - mean) ** 2 / total))


def band_powers(codes: Codes, range_m: Ranges) -> NDArray[np.float64]:
    """Compute the mean power of each azimuth in the bands of `ENVELOPE_M`.

    The 5th percentile over azimuths is the lower envelope: the power of an azimuth with hardly any echo.

    Args:
        codes: Codes (azimuths, bins) [half dB].
        range_m: Range of the centre of each bin (bins,) [m].

    Returns:
        Power (azimuths, bands), NaN beyond the scan's range.
    """
    power = CODE_POWER[codes]
    columns = []
    for low, high in pairwise(ENVELOPE_M):
        inside = (range_m >= low) & (range_m < high)
        columns.append(power[:, inside].mean(axis=1) if inside.any() else np.full(len(codes), np.nan))
    return np.stack(columns, axis=1)


# ---------------------------------------------------------------------- noise


def noise_region(codes: Codes, range_m: Ranges) -> tuple[NDArray[np.bool_], NDArray[np.bool_]]:
    """Select the azimuths and range bins whose cells hold little but noise.

    The bins are the last quarter of the range; the azimuths are the tenth with the smallest mean code there.
    The selection lowers the mean of pure noise by about a tenth, equally in every scan.

    Args:
        codes: Codes (azimuths, bins) [half dB].
        range_m: Range of the centre of each bin (bins,) [m].

    Returns:
        Whether each azimuth (azimuths,), and whether each bin (bins,), is selected.
    """
    far = range_m >= _FAR_SHARE * range_m[-1]
    mean = codes[:, far].mean(axis=1)
    return mean <= np.quantile(mean, _QUIET_SHARE), far


def noise_mean(share_of_zeros: float) -> float:
    """Compute the mean of exponential noise power from the share of code 0.

    Code 0 stands for powers that round to 0 or 1: share = 1 - exp(-1.5 / mean).

    Args:
        share_of_zeros: Share of cells with code 0.

    Returns:
        Mean power, NaN if the share is 0 or 1.
    """
    return float(-1.5 / np.log1p(-share_of_zeros)) if 0 < share_of_zeros < 1 else float("nan")


def range_correlation(power: NDArray[np.float64]) -> NDArray[np.float64]:
    """Compute the autocorrelation of power over range.

    Args:
        power: Power (azimuths, bins).

    Returns:
        Coefficients at lags of 0 to `LAGS` bins (LAGS + 1,), NaN where undefined.
    """
    off = power - power.mean()
    variance = float((off**2).mean())
    bins = power.shape[1]
    lags = [float((off[:, : bins - lag] * off[:, lag:]).mean()) for lag in range(min(LAGS + 1, bins))]
    found = np.full(LAGS + 1, np.nan)
    if variance > 0:
        found[: len(lags)] = np.array(lags) / variance
    return found


def correlation(one: NDArray[np.float64], other: NDArray[np.float64]) -> float:
    """Compute the correlation coefficient of two arrays.

    Args:
        one: Power of any shape.
        other: Power of the same shape.

    Returns:
        The coefficient, NaN if one of them is constant.
    """
    if one.size < 2 or not one.std() * other.std() > 0:
        return float("nan")
    return float(((one - one.mean()) * (other - other.mean())).mean() / (one.std() * other.std()))


def azimuth_correlation(power: NDArray[np.float64], quiet: NDArray[np.bool_]) -> float:
    """Compute the correlation of noise power between adjacent azimuths.

    Args:
        power: Power (azimuths, bins).
        quiet: Azimuths to use (azimuths,); a pair counts if both are quiet.

    Returns:
        The coefficient, NaN without pairs.
    """
    pairs = np.flatnonzero(quiet & np.roll(quiet, -1))
    return correlation(power[pairs], power[(pairs + 1) % len(power)])


# ---------------------------------------------------------------------- echoes


def strongest(codes: Codes, range_m: Ranges, ranks: NDArray[np.int64]) -> NDArray[np.int64]:
    """Count the codes of the k-th strongest range bin of each azimuth, beyond 2.5 m.

    Args:
        codes: Codes (azimuths, bins) [half dB].
        range_m: Range of the centre of each bin (bins,) [m].
        ranks: Ranks k, from 1 (ranks,).

    Returns:
        Number of azimuths by rank and code (ranks, 256).
    """
    order = np.sort(codes[:, range_m >= _FIRST_M], axis=1)
    inside = np.minimum(ranks, order.shape[1])
    return np.stack([np.bincount(order[:, -k], minlength=256) for k in inside])


def local_maxima(codes: Codes, range_m: Ranges) -> int:
    """Count local maxima beyond 4 m: code 58 or more, and none larger within 10 bins of the azimuth.

    Args:
        codes: Codes (azimuths, bins) [half dB].
        range_m: Range of the centre of each bin (bins,) [m].

    Returns:
        The number; equal neighbours all count.
    """
    top = maximum_filter1d(codes, _MAXIMA_BINS, axis=1, mode="nearest")
    return int(((codes == top) & (codes >= _MAXIMA_CODE))[:, range_m >= NEAR_M].sum())


def strong_peaks(codes: Codes, range_m: Ranges) -> int:
    """Count peaks from 4 to 100 m: code 80 or more, and none larger within 4 azimuths and 20 bins.

    Args:
        codes: Codes (azimuths, bins) [half dB].
        range_m: Range of the centre of each bin (bins,) [m].

    Returns:
        The number; equal neighbours all count.
    """
    top = maximum_filter(codes, (_PEAK_AZIMUTHS, _PEAK_BINS), mode=("wrap", "nearest"))  # type: ignore[arg-type]
    inside = (range_m >= NEAR_M) & (range_m < 100.0)
    return int(((codes == top) & (codes >= _PEAK_CODE))[:, inside].sum())


def far_medians(codes: Codes, range_m: Ranges) -> NDArray[np.float64]:
    """Compute the median code of each azimuth beyond 60 m.

    Args:
        codes: Codes (azimuths, bins) [half dB].
        range_m: Range of the centre of each bin (bins,) [m].

    Returns:
        Median (azimuths,) [half dB], NaN if the scan ends before 60 m.
    """
    far = codes[:, range_m >= _SPOKE_FROM_M]
    return np.median(far, axis=1) if far.shape[1] else np.full(len(codes), np.nan)


def spoke_azimuths(far_median: NDArray[np.float64]) -> NDArray[np.bool_]:
    """Find spokes: azimuths whose median code beyond 60 m is 15 or more.

    Args:
        far_median: Median code of each azimuth beyond 60 m, any shape.

    Returns:
        Whether each azimuth is a spoke, same shape.
    """
    return far_median >= _SPOKE_CODE
