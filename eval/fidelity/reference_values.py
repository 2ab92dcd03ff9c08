"""Target values of the statistics, measured on real scans, with their tolerances.

Oxford: 14 raw scans of the Oxford Radar RobotCar data set (Barnes et al., ICRA 2020) from two places; other
sensors: the few raw scans that are published as examples. Two places give a span; all of it passes.
"""

from dataclasses import dataclass
from typing import Literal

OXFORD = "14 raw scans of the Oxford Radar RobotCar data set"
MULRAN = "3 raw scans of the MulRan data set"
BOREAS = "1 raw scan of the Boreas-RT data set"


@dataclass(frozen=True, kw_only=True)
class Target:
    """The value of a statistic on real scans, or the span of its values at several places.

    Attributes:
        name: Name of the statistic.
        low: Smallest value.
        high: Largest value.
        rule: Meaning of `tolerance`: a share of the value, a factor, or a difference; it widens both ends.
        tolerance: The tolerance.
        source: Scans that the value was measured on.
    """

    name: str
    low: float
    high: float
    rule: Literal["share", "factor", "difference"]
    tolerance: float
    source: str

    @property
    def limits(self) -> tuple[float, float]:
        """The smallest and the largest value that pass."""
        low, high = (
            widened(self.low, self.rule, self.tolerance),
            widened(self.high, self.rule, self.tolerance),
        )
        return low[0], high[1]


def widened(value: float, rule: str, tolerance: float) -> tuple[float, float]:
    """Return the limits around a value.

    Args:
        value: The value.
        rule: Meaning of the tolerance: "share", "factor" or "difference".
        tolerance: The tolerance.

    Returns:
        The smallest and the largest value that pass.
    """
    if rule == "difference":
        return value - tolerance, value + tolerance
    ends = (value / tolerance, value * tolerance) if rule == "factor" else (
        value * (1 - tolerance),
        value * (1 + tolerance),
    )  # fmt: skip
    return min(ends), max(ends)


def tolerance_of(name: str) -> tuple[Literal["share", "factor", "difference"], float]:
    """Return the tolerance of a statistic, by the beginning of its name.

    Args:
        name: Name of the statistic.

    Returns:
        Rule and tolerance, as in `Target`.

    Raises:
        KeyError: There is no statistic of such a name.
    """
    for beginning, rule, tolerance in _TOLERANCES:
        if name.startswith(beginning):
            return rule, tolerance
    raise KeyError(name)


_TOLERANCES: tuple[tuple[str, Literal["share", "factor", "difference"], float], ...] = (
    ("noise_code_", "share", 0.15),
    ("noise_mean_", "share", 0.15),
    ("noise_correlation_", "difference", 0.05),
    ("envelope_", "factor", 1.5),
    ("leakage_", "difference", 6.0),
    ("near_3_m_", "difference", 6.0),
    ("range_width_", "share", 0.10),
    ("azimuth_width_", "share", 0.10),
    ("range_skirt_", "difference", 4.0),
    ("azimuth_skirt_", "difference", 4.0),
    ("isolated_", "factor", 1.5),
    ("invalid_", "difference", 0.0),
    ("zeros_", "share", 0.25),
    ("mean_code", "share", 0.25),
    ("std_code", "share", 0.25),
    ("exceedance_", "factor", 1.5),
    ("strongest_", "difference", 6.0),
    # Levels by range depend on the streets of one place.
    *((f"code_p{share}_", "difference", 12.0) for share in (50, 90, 99)),
    ("code_", "difference", 6.0),
    ("maxima_", "factor", 1.5),
    ("peaks_", "factor", 1.5),
    ("spoke_", "factor", 1.5),
)
"""Rule and tolerance by the beginning of a statistic's name; the first that fits applies."""

_SPANS_ONLY = ("spoke_azimuths_percent",)
"""Statistics whose span is wide enough to need no tolerance."""

Span = float | tuple[float, float]

_OXFORD: dict[str, Span] = {
    "noise_mean_power": 1.6,
    "noise_code_0_percent": 60.1,
    "noise_code_6_percent": 20.3,
    "noise_code_9_percent": 9.9,
    "noise_code_12_percent": 4.8,
    "noise_code_14_percent": 2.4,
    "noise_code_15_percent": 1.2,
    "noise_code_17_percent": 0.6,
    "noise_code_18_percent": 0.3,
    "noise_correlation_lag_1": 0.92,
    "noise_correlation_lag_2": 0.83,
    "noise_correlation_lag_3": 0.71,
    "noise_correlation_lag_4": 0.58,
    "noise_correlation_lag_5": 0.45,
    "noise_correlation_lag_6": 0.33,
    "noise_correlation_lag_7": 0.23,
    "noise_correlation_lag_8": 0.15,
    "noise_correlation_azimuths": (0.0, 0.15),
    "noise_correlation_scans": 0.01,
    "envelope_3_5_m_power": 0.79,
    "envelope_5_10_m_power": 1.26,
    "envelope_10_20_m_power": 2.1,
    "envelope_20_40_m_power": 2.5,
    "envelope_40_60_m_power": 2.2,
    "envelope_60_80_m_power": 2.0,
    "envelope_80_100_m_power": 1.8,
    "envelope_100_120_m_power": 1.5,
    "envelope_120_163_m_power": 1.4,
    "leakage_min_code": 29.0,
    "leakage_max_code": 47.0,
    "near_3_m_code_p50": 5.0,
    "range_width_3_db_bins": 8.3,
    "range_width_6_db_bins": 11.5,
    "range_width_10_db_bins": 14.7,
    "range_width_20_db_bins": 21.0,
    "range_skirt_0.52_m_db": -24.0,
    "range_skirt_1.04_m_db": -30.0,
    "range_skirt_1.73_m_db": -34.0,
    "azimuth_width_3_db_deg": 1.1,
    "azimuth_width_6_db_deg": 1.7,
    "azimuth_width_10_db_deg": 2.3,
    "azimuth_width_20_db_deg": 3.9,
    "azimuth_width_30_db_deg": 5.8,
    "azimuth_skirt_beyond_5_deg_db": (-40.0, -38.0),
    "isolated_peaks_per_scan": 275.0,  # 3849 in 14 scans
    "invalid_codes": 0.0,
    "zeros_percent": (24.3, 35.0),
    "mean_code": (11.6, 16.7),
    "std_code": (15.3, 18.0),
    "code_p50": (6.0, 12.0),
    "code_p90": (29.0, 40.0),
    "code_p99": (74.0, 83.0),
    "code_p99.9": (106.0, 115.0),
    "code_max": 136.0,
    "exceedance_6_db_percent": 38.5,
    "exceedance_12_db_percent": 13.5,
    "exceedance_20_db_percent": 5.9,
    "exceedance_30_db_percent": 2.1,
    "exceedance_40_db_percent": 0.75,
    "strongest_1_code": (99.0, 107.0),
    "strongest_12_code": (90.0, 97.0),
    "strongest_40_code": (66.0, 77.0),
    "strongest_100_code": (46.0, 59.0),
    "strongest_400_code": (20.0, 30.0),
    "maxima_58_per_scan": (4440.0, 4845.0),
    "peaks_80_per_scan": 400.0,
    "spoke_azimuths_percent": (8.0, 36.0),
}

_OXFORD_BY_RANGE = {
    "5_7.5": (12.4, 6, 43, 100),
    "10_15": (21.3, 12, 60, 106),
    "20_30": (17.4, 12, 44, 88),
    "40_50": (15.4, 12, 37, 78),
    "60_80": (12.6, 9, 31, 72),
    "80_100": (10.0, 6, 23, 60),
    "120_140": (6.8, 6, 17, 44),
}
"""Mean, median, 90th and 99th percentile of the codes between two ranges [m], at one of the two places."""

_CIR204: dict[str, Span] = {"noise_mean_power": 1.5, "code_max": 135.0, "invalid_codes": 0.0}
_CIR304_RT: dict[str, Span] = {"code_max": 160.0, "invalid_codes": 0.0}


def _targets(values: dict[str, Span], source: str) -> dict[str, Target]:
    targets = {}
    for name, value in values.items():
        low, high = value if isinstance(value, tuple) else (value, value)
        rule, tolerance = ("difference", 0.0) if name in _SPANS_ONLY else tolerance_of(name)
        targets[name] = Target(name=name, low=low, high=high, rule=rule, tolerance=tolerance, source=source)
    return targets


def _by_range() -> dict[str, Span]:
    values: dict[str, Span] = {}
    for band, levels in _OXFORD_BY_RANGE.items():
        for name, level in zip(("mean_code", "code_p50", "code_p90", "code_p99"), levels, strict=True):
            values[f"{name}_{band}_m"] = float(level)
    return values


TARGETS: dict[str, dict[str, Target]] = {
    "cts350x": _targets({**_OXFORD, **_by_range()}, OXFORD),
    "cir204": _targets(_CIR204, MULRAN),
    "cir304_rt": _targets(_CIR304_RT, BOREAS),
}
"""Targets by sensor and statistic; other sensors have none."""
