"""Constant false alarm rate (CFAR) along range: a cell is detected where it exceeds its surroundings.

The noise of a cell is estimated from training cells on both sides, beyond guard cells. Sources: cell
averaging, Finn & Johnson, RCA Review 29(3), 1968; order statistics, Rohling, IEEE Trans. AES 19(4), 1983.
Both hold for a square-law detector: codes are converted to power, which is exponentially distributed where
there is only noise.
"""

import math
from dataclasses import asdict, dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import root_scalar

from echoscape.eval.detections.interface import ScoredScan, cells_of
from echoscape.sim.datasets.polar_scan import PolarScan
from echoscape.sim.receiver.quantiser import middle_power, power_width
from echoscape.sim.sensor.link_budget import window
from echoscape.sim.sensor.sensor import Sensor

_CODES = np.arange(256)
_POWER, _WIDTH = middle_power(_CODES), power_width(_CODES)
"""Power of each code, and the width of the powers that have it (256,)."""
_UNCORRELATED = 0.05
"""Correlation of power below which two cells count as independent."""


@dataclass(frozen=True, kw_only=True)
class CfarSettings:
    """How the noise is estimated, and how far a cell must exceed it."""

    false_alarm_rate: float = 1e-4
    """Probability that a cell with nothing but noise exceeds the threshold."""
    guard_m: float = 1.0
    """Range on either side of a cell that is left out of its noise estimate [m]; at least as far as the noise
    of the radar is correlated."""
    training_m: float = 6.0
    """Range beyond that, on either side, from which the noise is estimated [m]."""
    peaks: bool = True
    """Report only cells that are maxima along range; otherwise every cell above its threshold."""

    def __post_init__(self) -> None:
        if not 0 < self.false_alarm_rate < 1:
            raise ValueError(f"false_alarm_rate must be above 0 and below 1, got {self.false_alarm_rate}")
        if not 0 <= self.guard_m < math.inf:
            raise ValueError(f"guard_m must be finite and 0 or more, got {self.guard_m}")
        if not 0 < self.training_m < math.inf:
            raise ValueError(f"training_m must be finite and above 0, got {self.training_m}")


@dataclass(frozen=True, kw_only=True)
class OrderedCfarSettings(CfarSettings):
    """CFAR by order statistics: the noise is the training cell of a given rank."""

    rank: float = 0.75
    """Rank of the training cell whose power is the noise, from the weakest, as a share of their number."""

    def __post_init__(self) -> None:
        super().__post_init__()
        if not 0 < self.rank <= 1:
            raise ValueError(f"rank must be above 0 and at most 1, got {self.rank}")


# ---------------------------------------------------------------------- thresholds


def averaging_factor(cells: NDArray[np.floating] | float, false_alarm_rate: float) -> NDArray[np.float64]:
    """Compute the threshold of cell averaging, in units of the mean of the training cells.

    P = (1 + T / N)^-N, so T = N (P^(-1/N) - 1).

    Args:
        cells: Numbers N of independent training cells, of any shape.
        false_alarm_rate: P.

    Returns:
        T, of the same shape.
    """
    count = np.asarray(cells, np.float64)
    return count * np.expm1(-math.log(false_alarm_rate) / count)


def ordered_false_alarm_rate(factor: float, *, cells: int, rank: int) -> float:
    """Compute the false alarm rate of order statistics, Rohling's equation (37).

    P = product over i from 0 to k - 1 of (N - i) / (N - i + T).

    Args:
        factor: T, the threshold in units of the training cell of the rank.
        cells: N, the number of independent training cells.
        rank: k, its rank from the weakest, from 1.

    Returns:
        P.
    """
    left = cells - np.arange(rank)
    return float(np.exp(np.log(left / (left + factor)).sum()))


def ordered_factor(false_alarm_rate: float, *, cells: int, rank: int) -> float:
    """Invert `ordered_false_alarm_rate`.

    Args:
        false_alarm_rate: P.
        cells: N, the number of independent training cells.
        rank: k, from 1.

    Returns:
        T.
    """

    def excess(log_factor: float) -> float:
        rate = ordered_false_alarm_rate(math.exp(log_factor), cells=cells, rank=rank)
        return math.log(rate) - math.log(false_alarm_rate)

    return math.exp(root_scalar(excess, bracket=(-30.0, 700.0 / rank), xtol=1e-12).root)


def noise_correlation(sensor: Sensor) -> NDArray[np.float64]:
    """Compute how the power of noise in a bin correlates with that of the bins beside it.

    A zero-padded transform has more bins than independent samples: noise of white samples x_n under a window
    w has the correlation |sum w_n^2 exp(2 pi i l n / F)|^2 / (sum w_n^2)^2 at a lag of l bins.

    Args:
        sensor: The radar.

    Returns:
        Correlations by lag, from 1 at lag 0 to the last one above 0.001.
    """
    weight = window(sensor) ** 2
    spectrum = np.abs(np.fft.rfft(weight, sensor.fft_size)) ** 2 / weight.sum() ** 2
    first_below = int(np.argmax(spectrum < 1e-3))
    return spectrum[:first_below]


# ---------------------------------------------------------------------- detectors


class Cfar:
    """CFAR by cell averaging, or with `OrderedCfarSettings` by order statistics."""

    score_name = "level above the estimated noise [dB]"
    score_limits = (0.0, 128.0)

    def __init__(
        self, settings: CfarSettings, *, bin_m: float, correlation: NDArray[np.float64] | None = None
    ) -> None:
        """Prepare for scans of one kind.

        Args:
            settings: Rate and windows.
            bin_m: Length of a range bin [m].
            correlation: Correlation of the noise's power by lag [bins], see `noise_correlation`; None for
                independent bins.

        Raises:
            ValueError: The training window is shorter than a bin.
        """
        self.settings = settings
        self._correlation = np.ones(1) if correlation is None else correlation
        # Noise beside a cell is its own noise as far as bins are correlated.
        self._guard = max(round(settings.guard_m / bin_m), len(self._correlation) - 1)
        self._training = round(settings.training_m / bin_m)
        if self._training < 1:
            raise ValueError(f"training_m must be a bin ({bin_m:g} m) or more, got {settings.training_m}")

    @property
    def name(self) -> str:
        """Name of the method in results."""
        return "oscfar" if isinstance(self.settings, OrderedCfarSettings) else "cfar"

    def record(self) -> dict[str, Any]:
        """Return the settings, for the record of a result."""
        return asdict(self.settings)

    def detect(self, scan: PolarScan) -> ScoredScan:
        """Detect cells that exceed their noise.

        Args:
            scan: A scan.

        Returns:
            The detections, and every cell by its level above the noise.
        """
        power = _POWER[scan.codes]
        noise, factor = self.noise(power, _WIDTH[scan.codes])
        above = power > factor * noise
        if self.settings.peaks:
            above &= _peaks_along_range(power)
        score = 10 * np.log10(power / noise)
        everywhere = np.ones_like(above)
        return ScoredScan(
            detections=cells_of(above, score, scan.bin_m),
            score_map=cells_of(everywhere, score, scan.bin_m),
        )

    def noise(
        self, power: NDArray[np.floating], width: NDArray[np.floating] | None = None
    ) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
        """Estimate the noise of every cell.

        Args:
            power: Powers (azimuths, bins).
            width: Width of the powers that were quantised to each of them (azimuths, bins); None for exact
                powers. It matters to order statistics only.

        Returns:
            The estimates (azimuths, bins), and the factors of the thresholds by bin (bins,).

        Raises:
            ValueError: The scan is shorter than the windows.
        """
        if power.shape[1] <= 2 * self._guard + self._training:
            needed = 2 * self._guard + self._training + 1
            raise ValueError(f"CFAR needs {needed} bins or more, the scan has {power.shape[1]}")
        if isinstance(self.settings, OrderedCfarSettings):
            return self._ordered_noise(power, np.zeros_like(power) if width is None else width, self.settings)
        return self._mean_noise(power)

    def _mean_noise(self, power: NDArray[np.floating]) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
        """Average the training cells; at the ends of a scan only those that exist."""
        sums = np.pad(np.cumsum(power, axis=1, dtype=np.float64), ((0, 0), (1, 0)))
        bins = power.shape[1]
        near, far = self._windows(bins)
        total = sums[:, near[1]] - sums[:, near[0]] + sums[:, far[1]] - sums[:, far[0]]
        nearer, farther = near[1] - near[0], far[1] - far[0]
        cells = nearer + farther
        independent = cells**2 / (self._variance(nearer) + self._variance(farther))
        return total / cells, averaging_factor(independent, self.settings.false_alarm_rate)

    def _windows(self, bins: int) -> tuple[NDArray[np.int64], NDArray[np.int64]]:
        """Return the first bin and the end (2, bins) of the nearer and of the farther window of every bin."""
        at, beyond = np.arange(bins), np.arange(bins) + self._guard + 1
        near = np.stack([at - self._guard - self._training, at - self._guard])
        far = np.stack([beyond, beyond + self._training])
        return np.clip(near, 0, bins), np.clip(far, 0, bins)

    def _variance(self, length: NDArray[np.int64]) -> NDArray[np.float64]:
        """Return the variance of the sum of so many neighbouring cells, that of one being 1."""
        lags = np.arange(1, len(self._correlation))
        pairs = np.maximum(length[:, None] - lags, 0) @ self._correlation[1:]
        return length + 2 * pairs

    def _ordered_noise(
        self, power: NDArray[np.floating], width: NDArray[np.floating], settings: OrderedCfarSettings
    ) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
        """Take the training cell of the rank, of cells so far apart that they are independent."""
        cells = self._spaced_cells(power.shape[1])
        count = cells.shape[1]
        rank = max(1, math.ceil(settings.rank * count))
        noise = np.empty(power.shape)
        for number in range(len(power)):  # a whole scan's training cells would fill the memory
            noise[number] = _of_rank(power[number, cells], width[number, cells], rank)
        factor = ordered_factor(settings.false_alarm_rate, cells=count, rank=rank)
        return noise, np.full(power.shape[1], factor)

    def _spaced_cells(self, bins: int) -> NDArray[np.int64]:
        """Return the training cells of every bin (bins, N), at the ends of a scan more from one side."""
        spacing = int(np.argmax(np.append(self._correlation, 0.0) < _UNCORRELATED))
        count = 2 * max(1, self._training // spacing)
        steps = np.arange(count) * spacing + self._guard + 1
        steps = steps[: max(1, (bins - self._guard) // spacing)]
        offsets = np.stack([-steps, steps], axis=1).ravel()  # nearest first, from both sides in turn
        cell = np.arange(bins)[:, None] + offsets
        exists = (cell >= 0) & (cell < bins)
        order = np.argsort(~exists, axis=1, kind="stable")[:, : min(count, int(exists.sum(axis=1).min()))]
        return np.take_along_axis(cell, order, axis=1)


def _of_rank(power: NDArray, width: NDArray, rank: int) -> NDArray[np.float64]:
    """Return the power of a rank from 1 in each row (bins,) of powers (bins, N) with their widths.

    Noise fills few codes, so that several cells have the power of that rank. They are taken as spread evenly
    over the width of their code.
    """
    at = np.argpartition(power, rank - 1, axis=1)[:, rank - 1, None]
    found = np.take_along_axis(power, at, axis=1)
    below = np.count_nonzero(power < found, axis=1)
    equal = np.count_nonzero(power == found, axis=1)
    spread = (rank - 0.5 - below) / equal - 0.5
    return found[:, 0] + spread * np.take_along_axis(width, at, axis=1)[:, 0]


def _peaks_along_range(power: NDArray[np.floating]) -> NDArray[np.bool_]:
    """Return which cells are local maxima along range, of equal neighbours the nearest (azimuths, bins)."""
    padded = np.pad(power, ((0, 0), (1, 1)), constant_values=-1.0)
    return (power > padded[:, :-2]) & (power >= padded[:, 2:])
