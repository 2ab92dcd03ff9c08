"""Every statistic of a folder of scans, scan by scan and then together: curves to draw and figures to judge.

Counts add up over scans, correlations are averaged, widths are medians over all peaks; the definitions stand
in eval/fidelity/scan_statistics.py and eval/fidelity/point_spread.py.
"""

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, replace
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray

from echoscape.eval.fidelity import point_spread as spread
from echoscape.eval.fidelity import scan_statistics as stats
from echoscape.sim.datasets.files.atomic_write import DatasetError
from echoscape.sim.datasets.scan_folder import ScanFolder

Progress = Callable[[str, int, int], None]

RANKS = np.array([1, 2, 3, 5, 8, 12, 18, 27, 40, 60, 100, 150, 200, 300, 400])
"""Ranks k of the k-strongest cells of a row."""
NOISE_CODES = (0, 6, 9, 12, 14, 15, 17, 18)
"""The lowest codes that the quantiser writes."""
LEVEL_BANDS_M = ((5, 7.5), (10, 15), (20, 30), (40, 50), (60, 80), (80, 100), (120, 140))
"""Ranges [m] whose levels are figures."""
EXCEEDED_DB = (6, 12, 20, 30, 40)
_KEPT_RANKS = (1, 12, 40, 100, 400)
_LAGS = range(1, 9)
_RADOME_M = 1.43
"""Range [m] within which the leakage lies above every echo."""
_SKIRTS_M = (0.52, 1.04, 1.73)
"""Offsets [m] at which the range profile is told beside its widths: its shoulder and its skirt."""
_SKIRT_DEG = (5.4, 6.3, 7.2)


@dataclass(frozen=True, kw_only=True)
class ScanTally:
    """The statistics of one scan that can be put together with other scans' (shapes in the functions).

    noise: histogram (256,); power: of the noise region (azimuths, bins), quiet: its rows (azimuths,).
    """

    bands: NDArray[np.int64]
    near: NDArray[np.int64]
    ranks: NDArray[np.int64]
    noise: NDArray[np.int64]
    noise_range_correlation: NDArray[np.float64]
    noise_row_correlation: float
    quiet: NDArray[np.bool_]
    power: NDArray[np.float64]
    band_power: NDArray[np.float64]
    far_median: NDArray[np.float64]
    maxima: int
    peaks: int
    range_profiles: NDArray[np.float32]
    azimuth_profiles: NDArray[np.float32]


@dataclass(frozen=True, kw_only=True)
class Survey:
    """The statistics of a folder.

    bands (bands, 256), near (bins, 256), ranks (RANKS, 256), noise (256,): how often each code occurs in each
    band of 2.5 m, in each near bin, as the k-strongest of a row, in noise; correlations (LAGS + 1,); envelope
    (bands of ENVELOPE_M,): 5th percentile over rows of the mean power; far_median (rows of all scans,);
    profiles over range and azimuth, the medians over `isolated` peaks [dB]; azimuths, bin_m: of a scan;
    figures: by name, NaN where the folder cannot tell.
    """

    name: str
    sensor: str
    scans: int
    azimuths: int
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
    figures: dict[str, float]

    @property
    def histogram(self) -> NDArray[np.int64]:
        """How often each code occurs (256,)."""
        return self.bands.sum(axis=0)


def survey(folder: ScanFolder, *, progress: Progress | None = None) -> Survey:
    """Measure every scan of a folder.

    Raises:
        DatasetError: a scan cannot be read, or is of another size than the first; the message names it.
    """
    range_m = (np.arange(folder.sensor.bins) + 0.5) * folder.sensor.bin_m + folder.range_offset_m
    tallies: list[ScanTally] = []
    between: list[float] = []
    last: ScanTally | None = None
    for tally in _tallies(folder, range_m, progress):
        if last is not None:
            both = last.quiet & tally.quiet
            between.append(stats.correlation(last.power[both], tally.power[both]))
        last = tally
        tallies.append(_light(tally))
    return pooled(tallies, between, name=folder.folder.resolve().name, folder=folder)


def _tallies(folder: ScanFolder, range_m: stats.Ranges, progress: Progress | None) -> Iterator[ScanTally]:
    for index in range(len(folder)):
        codes = folder.read(index).codes
        if codes.shape[1] != len(range_m):
            raise DatasetError(
                f"{folder.paths[index]}: {codes.shape[1]} bins, the first scan has {len(range_m)}"
            )
        yield tally_of(codes, range_m, folder.sensor.bin_m)
        if progress:
            progress("scans", index + 1, len(folder))


def tally_of(codes: stats.Codes, range_m: stats.Ranges, bin_m: float) -> ScanTally:
    """Return the statistics of one scan of codes (azimuths, bins) with bins at `range_m` (bins,)."""
    quiet, far = stats.noise_region(codes, range_m)
    power = stats.CODE_POWER[codes[:, far]]
    peaks = spread.isolated_peaks(codes, range_m, bin_m)
    along, across = spread.profiles(codes, peaks, bin_m)
    return ScanTally(
        bands=stats.range_histograms(codes, range_m),
        near=stats.near_histograms(codes, range_m),
        ranks=stats.strongest(codes, range_m, RANKS),
        noise=np.bincount(codes[np.ix_(quiet, far)].ravel(), minlength=256),
        noise_range_correlation=stats.range_correlation(power[quiet]),
        noise_row_correlation=stats.row_correlation(power, quiet),
        quiet=quiet,
        power=power,
        band_power=stats.band_powers(codes, range_m),
        far_median=stats.far_medians(codes, range_m),
        maxima=stats.local_maxima(codes, range_m),
        peaks=stats.strong_peaks(codes, range_m),
        range_profiles=along,
        azimuth_profiles=across,
    )


def _light(tally: ScanTally) -> ScanTally:
    """Return a tally without the powers, which only the next scan needs."""
    return replace(tally, power=np.empty((0, 0)), quiet=np.empty(0, bool))


def pooled(
    tallies: Sequence[ScanTally], between: Sequence[float], *, name: str, folder: ScanFolder
) -> Survey:
    """Put the scans' statistics together; `between` are the correlations of noise from scan to scan."""
    azimuths, bin_m = folder.sensor.azimuths, folder.sensor.bin_m
    along = np.concatenate([tally.range_profiles for tally in tallies])
    across = np.concatenate([tally.azimuth_profiles for tally in tallies])
    bands = np.sum([tally.bands for tally in tallies], axis=0)
    near = np.sum([tally.near for tally in tallies], axis=0)
    ranks = np.sum([tally.ranks for tally in tallies], axis=0)
    noise = np.sum([tally.noise for tally in tallies], axis=0)
    lags = _mean(np.stack([tally.noise_range_correlation for tally in tallies]))
    envelope = np.quantile(np.concatenate([tally.band_power for tally in tallies]), 0.05, axis=0)
    far = np.concatenate([tally.far_median for tally in tallies])
    rows = np.array([[tally.noise_row_correlation] for tally in tallies])
    figures = {
        **_noise_figures(noise),
        **{f"noise_correlation_lag_{lag}": float(lags[lag]) for lag in _LAGS},
        "noise_correlation_rows": float(_mean(rows)[0]),
        "noise_correlation_scans": float(_mean(np.array(between).reshape(-1, 1))[0]),
        **_envelope_figures(envelope),
        **_leakage_figures(near, bin_m, folder.range_offset_m),
        **_spread_figures(along, across, bin_m=bin_m, row_deg=360 / azimuths),
        "isolated_peaks_a_scan": len(along) / len(tallies),
        **_level_figures(bands.sum(axis=0)),
        **_rank_figures(ranks),
        "maxima_58_a_scan": float(np.mean([tally.maxima for tally in tallies])),
        "peaks_80_a_scan": float(np.mean([tally.peaks for tally in tallies])),
        **_band_figures(bands),
        "spoke_rows_percent": 100 * float(stats.spoke_rows(far).mean()),
    }
    return Survey(
        name=name,
        sensor=folder.sensor.name,
        scans=len(tallies),
        azimuths=azimuths,
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
        figures=figures,
    )


def _mean(values: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return the mean over the first axis of what is no NaN, NaN where all is."""
    told = np.isfinite(values)
    number = told.sum(axis=0)
    total = np.where(told, values, 0).sum(axis=0)
    return np.where(number > 0, total / np.maximum(number, 1), np.nan)


# ---------------------------------------------------------------------- figures by name


def _noise_figures(noise: NDArray[np.int64]) -> dict[str, float]:
    share = noise / max(int(noise.sum()), 1)
    shares = {f"noise_code_{code}_percent": 100 * float(share[code]) for code in NOISE_CODES}
    return {"noise_mean_power": stats.noise_mean(float(share[0])), **shares}


def _envelope_figures(envelope: NDArray[np.float64]) -> dict[str, float]:
    edges = pairwise(stats.ENVELOPE_M)
    names = [f"envelope_{low:g}_{high:g}_m_power" for low, high in edges]
    return {name: float(value) for name, value in zip(names, envelope, strict=True)}


def _leakage_figures(near: NDArray[np.int64], bin_m: float, offset_m: float) -> dict[str, float]:
    """Return the least and the greatest mean code within the radome's reach, and the median at 3 m."""
    range_m = (np.arange(len(near)) + 0.5) * bin_m + offset_m
    mean = near @ np.arange(256) / np.maximum(near.sum(axis=1), 1)
    radome = mean[range_m < _RADOME_M]
    at_3_m = near[np.abs(range_m - 3.0) < 0.1].sum(axis=0)
    return {
        "leakage_least_code": float(radome.min()),
        "leakage_most_code": float(radome.max()),
        "near_3_m_code_p50": stats.quantile(at_3_m, 0.5),
    }


def _spread_figures(
    along: NDArray[np.float32], across: NDArray[np.float32], *, bin_m: float, row_deg: float
) -> dict[str, float]:
    bins = {level: spread.median_width(along, level) for level in spread.LEVELS_DB[:4]}
    rows = {level: spread.median_width(across, level) for level in spread.LEVELS_DB}
    range_db, azimuth_db = spread.median_profile(along), spread.median_profile(across)
    aside = [spread.level_at(azimuth_db, round(angle / row_deg)) for angle in _SKIRT_DEG]
    return {
        **{f"range_width_{level:g}_db_bins": width for level, width in bins.items()},
        **{f"range_skirt_{at:g}_m_db": spread.level_at(range_db, round(at / bin_m)) for at in _SKIRTS_M},
        **{f"azimuth_width_{level:g}_db_deg": width * row_deg for level, width in rows.items()},
        "azimuth_skirt_beyond_5_deg_db": float(np.mean(aside)),
    }


def _level_figures(histogram: NDArray[np.int64]) -> dict[str, float]:
    mean, deviation = stats.moments(histogram)
    share, total = stats.exceedance(histogram), max(int(histogram.sum()), 1)
    return {
        "unwritable_codes": float((histogram[~stats.WRITABLE] > 0).sum()),
        "zeros_percent": 100 * float(histogram[0]) / total,
        "mean_code": mean,
        "std_code": deviation,
        **{f"code_p{100 * at:g}": stats.quantile(histogram, at) for at in (0.5, 0.9, 0.99, 0.999)},
        "code_max": float(np.flatnonzero(histogram).max(initial=0)),
        **{f"exceedance_{level}_db_percent": 100 * float(share[2 * level]) for level in EXCEEDED_DB},
    }


def _rank_figures(ranks: NDArray[np.int64]) -> dict[str, float]:
    medians = {int(k): stats.quantile(counts, 0.5) for k, counts in zip(RANKS, ranks, strict=True)}
    return {f"strongest_{k}_code": medians[k] for k in _KEPT_RANKS}


def _band_figures(bands: NDArray[np.int64]) -> dict[str, float]:
    figures: dict[str, float] = {}
    for low, high in LEVEL_BANDS_M:
        inside = bands[int(low / stats.BAND_M) : int(high / stats.BAND_M)].sum(axis=0)
        figures[f"mean_code_{low:g}_{high:g}_m"] = stats.moments(inside)[0]
        for share in (0.5, 0.9, 0.99):
            figures[f"code_p{100 * share:g}_{low:g}_{high:g}_m"] = stats.quantile(inside, share)
    return figures
