"""Statistics of a folder of scans, pooled over its scans: curves to draw and values to compare with targets.

Counts add up over scans, correlations are averaged, widths are medians over all peaks. The definitions are in
eval/fidelity/scan_statistics.py and eval/fidelity/point_spread.py.
"""

import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray

from echoscape.eval.fidelity import point_spread as spread
from echoscape.eval.fidelity import scan_statistics as stats
from echoscape.scenes.core.progress import Progress
from echoscape.sim.datasets.files.atomic_write import DatasetError
from echoscape.sim.datasets.scan_folder import ScanFolder

RANKS = np.array([1, 2, 3, 5, 8, 12, 18, 27, 40, 60, 100, 150, 200, 300, 400])
"""Ranks k of the k-th strongest range bin of an azimuth."""
NOISE_CODES = (0, 6, 9, 12, 14, 15, 17, 18)
"""The lowest codes that the quantiser produces."""
LEVEL_BANDS_M = ((5, 7.5), (10, 15), (20, 30), (40, 50), (60, 80), (80, 100), (120, 140))
"""Range bands whose levels are statistics [m]."""
EXCEEDED_DB = (6, 12, 20, 30, 40)
"""Levels whose exceedance is a statistic [dB]."""
_KEPT_RANKS = (1, 12, 40, 100, 400)
_LAGS = range(1, 9)
_RADOME_M = 1.43
"""Range within which the leakage is stronger than every echo [m]."""
_SKIRTS_M = (0.52, 1.04, 1.73)
"""Offsets at which the range profile is measured beside its widths: its shoulder and its skirt [m]."""
_SKIRT_DEG = (5.4, 6.3, 7.2)


@dataclass(frozen=True, kw_only=True)
class ScanStatistics:
    """Statistics of one scan that can be pooled with those of other scans.

    Attributes:
        bands: Histogram of codes in each range band of 2.5 m (bands, 256).
        near: Histogram of codes in each near range bin (bins, 256).
        ranks: Histogram of codes of each rank of `RANKS` (ranks, 256).
        noise: Histogram of codes in the noise region (256,).
        noise_range_correlation: Autocorrelation of noise power over range (LAGS + 1,).
        noise_azimuth_correlation: Correlation of noise power between adjacent azimuths.
        quiet: Azimuths of the noise region (azimuths,).
        power: Power in its range bins, at all azimuths (azimuths, bins).
        band_power: Mean power by azimuth in the bands of `ENVELOPE_M` (azimuths, bands).
        far_median: Median code of each azimuth beyond 60 m (azimuths,).
        maxima: Number of local maxima of code 58 or more.
        peaks: Number of peaks of code 80 or more.
        range_profiles: Profiles of isolated peaks over range (peaks, offsets) [dB].
        azimuth_profiles: Profiles of isolated peaks over azimuth (peaks, offsets) [dB].
    """

    bands: NDArray[np.int64]
    near: NDArray[np.int64]
    ranks: NDArray[np.int64]
    noise: NDArray[np.int64]
    noise_range_correlation: NDArray[np.float64]
    noise_azimuth_correlation: float
    quiet: NDArray[np.bool_]
    power: NDArray[np.float64]
    band_power: NDArray[np.float64]
    far_median: NDArray[np.float64]
    maxima: int
    peaks: int
    range_profiles: NDArray[np.float32]
    azimuth_profiles: NDArray[np.float32]


@dataclass(frozen=True, kw_only=True)
class DatasetStatistics:
    """Statistics of a folder of scans.

    Attributes:
        name: Name of the folder.
        sensor: Name of the radar.
        scans: Number of scans.
        azimuths: Azimuths of a scan.
        first_azimuth_deg: Direction of the first of them, clockwise from ahead [deg].
        bin_m: Length of a range bin [m].
        bands: Histogram of codes in each range band of 2.5 m (bands, 256).
        near: Histogram of codes in each near range bin (bins, 256).
        ranks: Histogram of codes of each rank of `RANKS` (ranks, 256).
        noise: Histogram of codes in the noise region (256,).
        noise_correlation: Autocorrelation of noise power over range (LAGS + 1,).
        envelope: 5th percentile over azimuths of the mean power in the bands of `ENVELOPE_M` (bands,).
        far_median: Median code of each azimuth beyond 60 m, all scans (azimuths of all scans,).
        range_profile: Median profile of isolated peaks over range (offsets,) [dB].
        azimuth_profile: Median profile of isolated peaks over azimuth (offsets,) [dB].
        isolated: Number of isolated peaks.
        values: Statistics by name, NaN where the folder does not determine them.
    """

    name: str
    sensor: str
    scans: int
    azimuths: int
    first_azimuth_deg: float
    bin_m: float
    bands: NDArray[np.int64]
    near: NDArray[np.int64]
    ranks: NDArray[np.int64]
    noise: NDArray[np.int64]
    noise_correlation: NDArray[np.float64]
    envelope: NDArray[np.float64]
    far_median: NDArray[np.float64]
    range_profile: NDArray[np.float64]
    azimuth_profile: NDArray[np.float64]
    isolated: int
    values: dict[str, float]

    @property
    def histogram(self) -> NDArray[np.int64]:
        """Number of cells by code (256,)."""
        return self.bands.sum(axis=0)


def measure(folder: ScanFolder, *, progress: Progress | None = None) -> DatasetStatistics:
    """Measure every scan of a folder.

    Args:
        folder: The folder.
        progress: Called as the work proceeds; its stage: scans.

    Returns:
        The pooled statistics.

    Raises:
        DatasetError: A scan cannot be read, or is not of the size of the first; the message names it.
    """
    range_m = (np.arange(folder.sensor.bins) + 0.5) * folder.sensor.bin_m + folder.range_offset_m
    scans: list[ScanStatistics] = []
    between: list[float] = []
    last: ScanStatistics | None = None
    for scan in _measured(folder, range_m, progress):
        if last is not None:
            both = last.quiet & scan.quiet
            between.append(stats.correlation(last.power[both], scan.power[both]))
        last = scan
        scans.append(_without_powers(scan))
    return pool(scans, between, name=folder.folder.resolve().name, folder=folder)


def _measured(
    folder: ScanFolder, range_m: stats.Ranges, progress: Progress | None
) -> Iterator[ScanStatistics]:
    for index in range(len(folder)):
        codes = folder.read(index).codes
        if codes.shape[1] != len(range_m):
            raise DatasetError(
                f"{folder.paths[index]}: {codes.shape[1]} range bins, the first scan has {len(range_m)}"
            )
        yield measure_scan(codes, range_m, folder.sensor.bin_m)
        if progress:
            progress("scans", index + 1, len(folder))


def measure_scan(codes: stats.Codes, range_m: stats.Ranges, bin_m: float) -> ScanStatistics:
    """Measure one scan.

    Args:
        codes: Codes (azimuths, bins) [half dB].
        range_m: Range of the centre of each bin (bins,) [m].
        bin_m: Length of a range bin [m].

    Returns:
        Its statistics.
    """
    quiet, far = stats.noise_region(codes, range_m)
    power = stats.CODE_POWER[codes[:, far]]
    peaks = spread.isolated_peaks(codes, range_m, bin_m)
    along, across = spread.profiles(codes, peaks, bin_m)
    return ScanStatistics(
        bands=stats.range_histograms(codes, range_m),
        near=stats.near_histograms(codes, range_m),
        ranks=stats.strongest(codes, range_m, RANKS),
        noise=np.bincount(codes[np.ix_(quiet, far)].ravel(), minlength=256),
        noise_range_correlation=stats.range_correlation(power[quiet]),
        noise_azimuth_correlation=stats.azimuth_correlation(power, quiet),
        quiet=quiet,
        power=power,
        band_power=stats.band_powers(codes, range_m),
        far_median=stats.far_medians(codes, range_m),
        maxima=stats.local_maxima(codes, range_m),
        peaks=stats.strong_peaks(codes, range_m),
        range_profiles=along,
        azimuth_profiles=across,
    )


def _without_powers(scan: ScanStatistics) -> ScanStatistics:
    """Return the statistics of a scan without the powers, which only the next scan needs."""
    return replace(scan, power=np.empty((0, 0)), quiet=np.empty(0, bool))


def pool(
    scans: Sequence[ScanStatistics], between: Sequence[float], *, name: str, folder: ScanFolder
) -> DatasetStatistics:
    """Pool the statistics of the scans of a folder.

    Args:
        scans: Statistics of each scan.
        between: Correlations of noise power from each scan to the next.
        name: Name of the folder.
        folder: The folder, which gives the geometry of its scans.

    Returns:
        The pooled statistics.
    """
    azimuths, bin_m = folder.sensor.azimuths, folder.sensor.bin_m
    along = np.concatenate([scan.range_profiles for scan in scans])
    across = np.concatenate([scan.azimuth_profiles for scan in scans])
    bands = np.sum([scan.bands for scan in scans], axis=0)
    near = np.sum([scan.near for scan in scans], axis=0)
    ranks = np.sum([scan.ranks for scan in scans], axis=0)
    noise = np.sum([scan.noise for scan in scans], axis=0)
    lags = _mean(np.stack([scan.noise_range_correlation for scan in scans]))
    envelope = np.quantile(np.concatenate([scan.band_power for scan in scans]), 0.05, axis=0)
    far = np.concatenate([scan.far_median for scan in scans])
    adjacent = np.array([[scan.noise_azimuth_correlation] for scan in scans])
    values = {
        **_noise_values(noise),
        **{f"noise_correlation_lag_{lag}": float(lags[lag]) for lag in _LAGS},
        "noise_correlation_azimuths": float(_mean(adjacent)[0]),
        "noise_correlation_scans": float(_mean(np.array(between).reshape(-1, 1))[0]),
        **_envelope_values(envelope),
        **_leakage_values(near, bin_m, folder.range_offset_m),
        **_spread_values(along, across, bin_m=bin_m, azimuth_deg=360 / azimuths),
        "isolated_peaks_per_scan": len(along) / len(scans),
        **_level_values(bands.sum(axis=0)),
        **_rank_values(ranks),
        "maxima_58_per_scan": float(np.mean([scan.maxima for scan in scans])),
        "peaks_80_per_scan": float(np.mean([scan.peaks for scan in scans])),
        **_band_values(bands),
        "spoke_azimuths_percent": 100 * float(stats.spoke_azimuths(far).mean()),
    }
    return DatasetStatistics(
        name=name,
        sensor=folder.sensor.name,
        scans=len(scans),
        azimuths=azimuths,
        first_azimuth_deg=math.degrees(folder.sensor.first_azimuth_rad),
        bin_m=bin_m,
        bands=bands,
        near=near,
        ranks=ranks,
        noise=noise,
        noise_correlation=lags,
        envelope=envelope,
        far_median=far,
        range_profile=spread.median_profile(along),
        azimuth_profile=spread.median_profile(across),
        isolated=len(along),
        values=values,
    )


def _mean(values: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return the mean over the first axis without NaN, NaN where there is nothing else."""
    finite = np.isfinite(values)
    number = finite.sum(axis=0)
    total = np.where(finite, values, 0).sum(axis=0)
    return np.where(number > 0, total / np.maximum(number, 1), np.nan)


# ---------------------------------------------------------------------- statistics by name


def _noise_values(noise: NDArray[np.int64]) -> dict[str, float]:
    share = noise / max(int(noise.sum()), 1)
    shares = {f"noise_code_{code}_percent": 100 * float(share[code]) for code in NOISE_CODES}
    return {"noise_mean_power": stats.noise_mean(float(share[0])), **shares}


def _envelope_values(envelope: NDArray[np.float64]) -> dict[str, float]:
    edges = pairwise(stats.ENVELOPE_M)
    names = [f"envelope_{low:g}_{high:g}_m_power" for low, high in edges]
    return {name: float(value) for name, value in zip(names, envelope, strict=True)}


def _leakage_values(near: NDArray[np.int64], bin_m: float, offset_m: float) -> dict[str, float]:
    """Return minimum and maximum of the mean code within the radome's range, and the median code at 3 m."""
    range_m = (np.arange(len(near)) + 0.5) * bin_m + offset_m
    mean = near @ np.arange(256) / np.maximum(near.sum(axis=1), 1)
    radome = mean[range_m < _RADOME_M]
    at_3_m = near[np.abs(range_m - 3.0) < 0.1].sum(axis=0)
    return {
        "leakage_min_code": float(radome.min()),
        "leakage_max_code": float(radome.max()),
        "near_3_m_code_p50": stats.quantile(at_3_m, 0.5),
    }


def _spread_values(
    along: NDArray[np.float32], across: NDArray[np.float32], *, bin_m: float, azimuth_deg: float
) -> dict[str, float]:
    bins = {level: spread.median_width(along, level) for level in spread.LEVELS_DB[:4]}
    azimuths = {level: spread.median_width(across, level) for level in spread.LEVELS_DB}
    range_db, azimuth_db = spread.median_profile(along), spread.median_profile(across)
    aside = [spread.level_at(azimuth_db, round(angle / azimuth_deg)) for angle in _SKIRT_DEG]
    return {
        **{f"range_width_{level:g}_db_bins": width for level, width in bins.items()},
        **{f"range_skirt_{at:g}_m_db": spread.level_at(range_db, round(at / bin_m)) for at in _SKIRTS_M},
        **{f"azimuth_width_{level:g}_db_deg": width * azimuth_deg for level, width in azimuths.items()},
        "azimuth_skirt_beyond_5_deg_db": float(np.mean(aside)),
    }


def _level_values(histogram: NDArray[np.int64]) -> dict[str, float]:
    mean, deviation = stats.moments(histogram)
    share, total = stats.exceedance(histogram), max(int(histogram.sum()), 1)
    return {
        "invalid_codes": float((histogram[~stats.VALID_CODES] > 0).sum()),
        "zeros_percent": 100 * float(histogram[0]) / total,
        "mean_code": mean,
        "std_code": deviation,
        **{f"code_p{100 * at:g}": stats.quantile(histogram, at) for at in (0.5, 0.9, 0.99, 0.999)},
        "code_max": float(np.flatnonzero(histogram).max(initial=0)),
        **{f"exceedance_{level}_db_percent": 100 * float(share[2 * level]) for level in EXCEEDED_DB},
    }


def _rank_values(ranks: NDArray[np.int64]) -> dict[str, float]:
    medians = {int(k): stats.quantile(counts, 0.5) for k, counts in zip(RANKS, ranks, strict=True)}
    return {f"strongest_{k}_code": medians[k] for k in _KEPT_RANKS}


def _band_values(bands: NDArray[np.int64]) -> dict[str, float]:
    values: dict[str, float] = {}
    for low, high in LEVEL_BANDS_M:
        inside = bands[int(low / stats.BAND_M) : int(high / stats.BAND_M)].sum(axis=0)
        values[f"mean_code_{low:g}_{high:g}_m"] = stats.moments(inside)[0]
        for share in (0.5, 0.9, 0.99):
            values[f"code_p{100 * share:g}_{low:g}_{high:g}_m"] = stats.quantile(inside, share)
    return values
