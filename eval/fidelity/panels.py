"""The panels of a fidelity page: curves of a folder's statistics, marked with the targets.

White marks are targets with their tolerance (eval/fidelity/reference_values.py); thick bars are spans.
"""

from collections.abc import Callable, Sequence
from itertools import pairwise

import numpy as np
from matplotlib.axes import Axes
from numpy.typing import NDArray

from echoscape.eval.fidelity import point_spread as spread
from echoscape.eval.fidelity import scan_statistics as stats
from echoscape.eval.fidelity.dataset_statistics import (
    EXCEEDED_DB,
    LEVEL_BANDS_M,
    NOISE_CODES,
    RANKS,
    DatasetStatistics,
)
from echoscape.eval.fidelity.reference_values import Target
from echoscape.eval.fidelity.score import number_text
from echoscape.eval.figures.style import FAINT, INK

Targets = dict[str, Target]
"""Targets by the name of their statistic."""
Draw = Callable[[Axes, DatasetStatistics, str], None]
"""Draws the curves of a folder in a colour."""
_QUANTILES = ((0.5, ":"), (0.9, "--"), (0.99, "-."))


def _marks(axes: Axes, targets: Targets, names: Sequence[str], at: Sequence[float]) -> None:
    """Mark targets at abscissas `at`: a dot for a value, a bar for a span, a thin bar for the tolerance."""
    for name, x in zip(names, at, strict=True):
        if (target := targets.get(name)) is not None:
            axes.plot([x, x], target.limits, color=INK, lw=1.2, alpha=0.7, zorder=4)
            if target.low < target.high:
                axes.plot([x, x], [target.low, target.high], color=INK, lw=4, solid_capstyle="butt", zorder=5)
            else:
                axes.plot([x], [target.low], "o", ms=5, color=INK, zorder=5)


# ---------------------------------------------------------------------- levels


def _draw_histogram(axes: Axes, found: DatasetStatistics, colour: str) -> None:
    counts = found.histogram
    code = np.flatnonzero(counts)
    axes.plot(code, 100 * counts[code] / counts.sum(), color=colour, lw=1.8)
    axes.set(yscale="log", ylim=(1e-5, 100), xlim=(-2, 165))


def _mark_histogram(axes: Axes, targets: Targets) -> None:
    if (zeros := targets.get("zeros_percent")) is not None:
        axes.plot([0, 0], [zeros.low, zeros.high], color=INK, lw=4, solid_capstyle="butt")
    for name in ("code_p50", "code_p90", "code_p99", "code_p99.9", "code_max"):
        if (target := targets.get(name)) is not None:
            low, high = target.low - 0.4, target.high + 0.4
            axes.plot([low, high], [2.5e-5, 2.5e-5], color=INK, lw=5, solid_capstyle="butt")
            axes.annotate(
                name.removeprefix("code_"), ((low + high) / 2, 3.3e-5), color=FAINT, size=9, ha="center"
            )


def _draw_exceedance(axes: Axes, found: DatasetStatistics, colour: str) -> None:
    share = 100 * stats.exceedance(found.histogram)
    shown = np.flatnonzero(share > 0)
    axes.plot(shown / 2, share[shown], color=colour, lw=1.8)
    axes.set(yscale="log", ylim=(1e-4, 100), xlim=(0, 82))


def _mark_exceedance(axes: Axes, targets: Targets) -> None:
    _marks(axes, targets, [f"exceedance_{level}_db_percent" for level in EXCEEDED_DB], EXCEEDED_DB)


def _draw_by_range(axes: Axes, found: DatasetStatistics, colour: str) -> None:
    middle = (np.arange(len(found.bands)) + 0.5) * stats.BAND_M
    axes.plot(middle, [stats.moments(band)[0] for band in found.bands], color=colour, lw=2.4)
    for share, style in _QUANTILES:
        levels = [stats.quantile(band, share) for band in found.bands]
        axes.plot(middle, levels, color=colour, lw=1.1, ls=style)
    axes.set(ylim=(0, 125), xlim=(0, max(165.0, found.bands.shape[0] * stats.BAND_M)))


def _mark_by_range(axes: Axes, targets: Targets) -> None:
    for low, high in LEVEL_BANDS_M:
        names = [f"mean_code_{low:g}_{high:g}_m"]
        names += [f"code_p{100 * share:g}_{low:g}_{high:g}_m" for share, _ in _QUANTILES]
        for name, width in zip(names, (3.5, 1.6, 1.6, 1.6), strict=True):
            if (target := targets.get(name)) is not None:
                axes.plot([low, high], [target.low] * 2, color=INK, lw=width, solid_capstyle="butt", zorder=5)


# ---------------------------------------------------------------------- noise


def _draw_noise(axes: Axes, found: DatasetStatistics, colour: str) -> None:
    share = 100 * found.noise / max(int(found.noise.sum()), 1)
    codes = np.array(NOISE_CODES)
    axes.plot(range(len(codes)), share[codes], color=colour, lw=1.6, marker=".", ms=8)
    axes.set(yscale="log", ylim=(0.1, 100))
    axes.set_xticks(range(len(codes)), [str(code) for code in codes])


def _mark_noise(axes: Axes, targets: Targets) -> None:
    _marks(axes, targets, [f"noise_code_{code}_percent" for code in NOISE_CODES], range(len(NOISE_CODES)))


def _draw_correlation(axes: Axes, found: DatasetStatistics, colour: str) -> None:
    axes.plot(np.arange(stats.LAGS + 1), found.noise_correlation, color=colour, lw=1.8, marker=".", ms=6)
    axes.set(ylim=(-0.15, 1.03), xlim=(0, stats.LAGS))


def _mark_correlation(axes: Axes, targets: Targets) -> None:
    lags = range(1, 9)
    _marks(axes, targets, [f"noise_correlation_lag_{lag}" for lag in lags], lags)


def _draw_envelope(axes: Axes, found: DatasetStatistics, colour: str) -> None:
    axes.stairs(found.envelope, stats.ENVELOPE_M, color=colour, lw=1.8, baseline=None)
    axes.set(yscale="log", ylim=(0.3, 30), xlim=(3, 163))


def _mark_envelope(axes: Axes, targets: Targets) -> None:
    bands = list(pairwise(stats.ENVELOPE_M))
    _marks(axes, targets, [f"envelope_{low:g}_{high:g}_m_power" for low, high in bands],
           [(low + high) / 2 for low, high in bands])  # fmt: skip


# ---------------------------------------------------------------------- point spread


def _draw_range_spread(axes: Axes, found: DatasetStatistics, colour: str) -> None:
    profile = found.range_profile
    offset_m = (np.arange(len(profile)) - len(profile) // 2) * found.bin_m
    axes.plot(offset_m, profile, color=colour, lw=1.8)
    axes.set(ylim=(-45, 4), xlim=(-2.2, 2.2))


def _mark_range_spread(axes: Axes, targets: Targets) -> None:
    bin_m = 0.0432  # of the sensor whose widths in bins are known
    for level in spread.LEVELS_DB[:4]:
        _width(axes, targets.get(f"range_width_{level:g}_db_bins"), level, bin_m)
    for name, target in targets.items():
        if name.startswith("range_skirt_"):
            at = float(name.split("_")[2])
            for side in (-at, at):
                axes.plot([side], [target.low], "o", ms=5, color=INK, zorder=5)


def _width(axes: Axes, target: Target | None, level_db: float, unit: float) -> None:
    """Mark the target of a width by a bar at its level, with thick ends for the tolerance."""
    if target is None:
        return
    half = target.low * unit / 2
    axes.plot([-half, half], [-level_db] * 2, color=INK, lw=1.6, zorder=5)
    for side in (-1, 1):
        ends = [side * limit * unit / 2 for limit in target.limits]
        axes.plot(ends, [-level_db] * 2, color=INK, lw=5, alpha=0.45, solid_capstyle="butt", zorder=4)
    # Above the right end of the bar, outside the curve.
    right = max(target.limits) * unit / 2
    axes.annotate(number_text(target.low * unit), (right, -level_db), xytext=(3, 1), color=FAINT, size=9,
                  textcoords="offset points", va="bottom", zorder=6)  # fmt: skip


def _draw_azimuth_spread(axes: Axes, found: DatasetStatistics, colour: str) -> None:
    profile = found.azimuth_profile
    offset_deg = (np.arange(len(profile)) - len(profile) // 2) * 360 / found.azimuths
    axes.plot(offset_deg, profile, color=colour, lw=1.8, marker=".", ms=6)
    axes.set(ylim=(-45, 4), xlim=(-7.4, 7.4))


def _mark_azimuth_spread(axes: Axes, targets: Targets) -> None:
    for level in spread.LEVELS_DB:
        _width(axes, targets.get(f"azimuth_width_{level:g}_db_deg"), level, 1.0)
    if (skirt := targets.get("azimuth_skirt_beyond_5_deg_db")) is not None:
        for low, high in ((-7.2, -5.4), (5.4, 7.2)):
            axes.fill_between([low, high], skirt.low, skirt.high, color=INK, alpha=0.6, lw=0)


# ---------------------------------------------------------------------- azimuths


def _draw_ranks(axes: Axes, found: DatasetStatistics, colour: str) -> None:
    for share, style, width in ((0.5, "-", 1.8), (0.1, ":", 1.0), (0.9, ":", 1.0)):
        levels = [stats.quantile(counts, share) for counts in found.ranks]
        axes.plot(RANKS, levels, color=colour, lw=width, ls=style)
    axes.set(xscale="log", ylim=(0, 140), xlim=(0.9, 450))
    axes.set_xticks([1, 3, 12, 40, 100, 400], ["1", "3", "12", "40", "100", "400"])
    axes.minorticks_off()


def _mark_ranks(axes: Axes, targets: Targets) -> None:
    ranks = (1, 12, 40, 100, 400)
    _marks(axes, targets, [f"strongest_{k}_code" for k in ranks], ranks)


def _draw_leakage(axes: Axes, found: DatasetStatistics, colour: str) -> None:
    range_m = (np.arange(len(found.near)) + 0.5) * found.bin_m
    mean = found.near @ np.arange(256) / np.maximum(found.near.sum(axis=1), 1)
    axes.plot(range_m, mean, color=colour, lw=1.8)
    axes.plot(range_m, [stats.quantile(bin_, 0.5) for bin_ in found.near], color=colour, lw=1.0, ls=":")
    axes.set(ylim=(0, 95 if mean.max() > 58 else 60), xlim=(0, stats.NEAR_M))


def _mark_leakage(axes: Axes, targets: Targets) -> None:
    least, most = targets.get("leakage_min_code"), targets.get("leakage_max_code")
    if least is not None and most is not None:
        for level in (least.low, most.low):
            axes.plot([0, 1.43], [level, level], color=INK, lw=1.4, ls=(0, (4, 3)))
    _marks(axes, targets, ["near_3_m_code_p50"], [3.0])


def _draw_spokes(axes: Axes, found: DatasetStatistics, colour: str) -> None:
    level: NDArray[np.float64] = found.far_median.reshape(-1, found.azimuths)
    spokes = 100 * stats.spoke_azimuths(level).mean(axis=0)
    width = max(1, found.azimuths // 50)
    around = np.concatenate([spokes[-width:], spokes, spokes[:width]])
    smooth = np.convolve(around, np.full(2 * width + 1, 1 / (2 * width + 1)), "valid")
    azimuth_deg = found.first_azimuth_deg + np.arange(found.azimuths) * 360 / found.azimuths
    axes.fill_between(azimuth_deg, smooth, color=colour, alpha=0.25, lw=0)
    axes.plot(azimuth_deg, smooth, color=colour, lw=1.6)
    share = 100 * float(stats.spoke_azimuths(level).mean())
    axes.axhline(share, color=colour, lw=1.0, ls="--")
    axes.set(ylim=(0, None), xlim=(0, 360))
    axes.set_xticks([0, 90, 180, 270, 360], ["ahead", "right", "behind", "left", "ahead"])


def _mark_spokes(axes: Axes, targets: Targets) -> None:
    if (target := targets.get("spoke_azimuths_percent")) is not None:
        axes.axhspan(target.low, target.high, color=INK, alpha=0.1, lw=0)
    axes.set_ylim(0, max(50.0, axes.get_ylim()[1]))


PANELS: tuple[tuple[str, str, Draw, Callable[[Axes, Targets], None]], ...] = (
    ("Histogram", "share of cells [%] by code [0.5 dB]", _draw_histogram, _mark_histogram),
    ("Exceedance", "share of cells at or above a level [%], by dB", _draw_exceedance, _mark_exceedance),
    ("Levels by range", "mean (thick), p50, p90, p99 by range [m]", _draw_by_range, _mark_by_range),
    ("Noise", "share of quiet far cells [%] by code [0.5 dB]", _draw_noise, _mark_noise),
    ("Noise over range", "autocorrelation by lag [bins]", _draw_correlation, _mark_correlation),
    ("Lower envelope", "5th percentile of power by range [m]", _draw_envelope, _mark_envelope),
    ("Point spread in range", "median peak [dB] by offset [m]", _draw_range_spread,
     _mark_range_spread),
    ("Point spread in azimuth", "median peak [dB] by offset [°]", _draw_azimuth_spread,
     _mark_azimuth_spread),
    ("Strongest bins", "median code (p10, p90 dotted) by rank", _draw_ranks, _mark_ranks),
    ("Leakage", "mean code (median dotted) by range [m]", _draw_leakage, _mark_leakage),
    ("Spokes", "share of scans with a raised floor [%], by azimuth", _draw_spokes, _mark_spokes),
)  # fmt: skip
"""Title and caption of each panel, what draws the curves of a folder, and what marks the targets."""
