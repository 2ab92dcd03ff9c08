"""What a detector should find in a scan, by the truth of its cells, and what each detection fell on.

A *target cell* holds a direct echo, by default of something that stands still. An *echo* is a run of target
cells of one object along an azimuth. A detection is *true* if a target cell lies within the tolerance: within
`tolerance_m` in range, and across within `tolerance_m` or one azimuth, whichever is wider. What made a false
one is the label of the strongest cell within the tolerance.
"""

import math
from dataclasses import dataclass
from functools import cached_property
from typing import Literal

import numpy as np
from numpy.typing import NDArray

from echoscape.eval.detections.interface import Detections
from echoscape.eval.detections.reach import Reach
from echoscape.eval.figures.frame import shown_components
from echoscape.eval.figures.style import IN_PLACE
from echoscape.sim.datasets.polar_scan import CellTruth, Component, PolarScan
from echoscape.sim.sensor.link_budget import range_gain
from echoscape.sim.sensor.sensor import Sensor

MOVER = "mover"
"""Name of direct echoes of movers where these are no targets."""
LABELS = (*(component.name.lower() for component in Component), IN_PLACE, MOVER)
"""What a detection may fall on, by number: components, ghosts in place apart, movers apart."""
TARGET = int(Component.DIRECT)
"""The label of targets: the number of `direct`."""
OUTSIDE = 255
"""Label of a detection outside the judged ranges, which counts as nothing."""
_MOVER = LABELS.index(MOVER)


@dataclass(frozen=True, kw_only=True)
class JudgeSettings:
    """How detections are judged."""

    targets: Literal["static", "direct"] = "static"
    """Cells to be found. static: direct echoes of what stands still; direct: those of movers as well."""
    tolerance_m: float = 0.35
    """Largest distance of a true detection from a target cell, in range and across [m]; across at least one
    azimuth is allowed."""
    min_snr_db: float = 10.0
    """Least level above the sensor's noise of the strongest cell of an echo that counts in recall [dB]."""
    near_m: float = 3.0
    """Nearest range that is judged [m]: leakage and the car itself are nearer."""
    far_m: float | None = None
    """Farthest range that is judged [m]; by default the sensor's last bin."""

    def __post_init__(self) -> None:
        if self.targets not in ("static", "direct"):
            raise ValueError(f"targets must be static or direct, got {self.targets!r}")
        for name in ("tolerance_m", "near_m"):
            if not 0 <= getattr(self, name) < math.inf:
                raise ValueError(f"{name} must be finite and 0 or more, got {getattr(self, name)}")
        if not math.isfinite(self.min_snr_db):
            raise ValueError(f"min_snr_db must be finite, got {self.min_snr_db}")
        if self.far_m is not None and not self.near_m < self.far_m < math.inf:
            raise ValueError(f"far_m must be finite and above near_m ({self.near_m:g}), got {self.far_m}")


@dataclass(frozen=True, kw_only=True)
class TargetEchoes:
    """The E echoes of a scan that count in recall.

    Attributes:
        first: Flat number (azimuth bins + bin) of the first cell of each (E,) int64.
        last: Flat number of its last cell (E,) int64.
        peak: Bin of its strongest cell (E,) int64.
        class_id: Class of its object (E,) uint8.
        instance: Its object (E,) uint32.
    """

    first: NDArray[np.int64]
    last: NDArray[np.int64]
    peak: NDArray[np.int64]
    class_id: NDArray[np.uint8]
    instance: NDArray[np.uint32]

    def __len__(self) -> int:
        """Return the number of echoes."""
        return len(self.first)


class ScanTargets:
    """The targets of one scan."""

    def __init__(self, scan: PolarScan, cells: CellTruth, sensor: Sensor, settings: JudgeSettings) -> None:
        """Label the cells of a scan.

        Args:
            scan: The scan.
            cells: The truth of its cells.
            sensor: The radar, which gives the level of noise.
            settings: How detections are judged.

        Raises:
            ValueError: The truth has another shape than the scan, or no bin is judged.
        """
        if cells.component.shape != scan.codes.shape:
            raise ValueError(f"truth has the shape {cells.component.shape}, the scan {scan.codes.shape}")
        self._scan, self._cells, self._sensor, self._settings = scan, cells, sensor, settings
        self.labels = _labels(cells, settings)
        self._bins = judged_bins(scan.codes.shape[1], scan.bin_m, settings)

    @cached_property
    def reach(self) -> Reach:
        """The tolerance, in cells."""
        azimuths, bins = self._scan.codes.shape
        return Reach.of(self._settings.tolerance_m, azimuths=azimuths, bins=bins, bin_m=self._scan.bin_m)

    @cached_property
    def _is_target(self) -> NDArray[np.bool_]:
        """Whether each cell is a target cell within the judged ranges (azimuths, bins)."""
        found = self.labels == TARGET
        found[:, : self._bins.start] = False
        found[:, self._bins.stop :] = False
        return found

    @cached_property
    def near_target(self) -> NDArray[np.bool_]:
        """Whether a target cell lies within the tolerance of each cell (azimuths, bins)."""
        return self.reach.from_cells(self._is_target.astype(np.uint8)) > 0

    @cached_property
    def echoes(self) -> TargetEchoes:
        """The echoes that count in recall."""
        instance = np.where(self._is_target, self._cells.instance.astype(np.int64), -1)
        edge = np.diff(np.pad(instance, ((0, 0), (1, 1)), constant_values=-1), axis=1) != 0
        inside = instance.ravel() >= 0
        first = np.flatnonzero(edge[:, :-1].ravel() & inside)
        last = np.flatnonzero(edge[:, 1:].ravel() & inside)
        level = (self._level_db().ravel()).astype(np.float32)
        peak = _first_peaks(level, first, last)
        kept = level[peak] >= self._settings.min_snr_db if len(peak) else np.zeros(0, np.bool_)
        first, last, peak = first[kept], last[kept], peak[kept]
        return TargetEchoes(
            first=first,
            last=last,
            peak=peak % self._scan.codes.shape[1],
            class_id=self._cells.class_id.ravel()[first],
            instance=self._cells.instance.ravel()[first],
        )

    @property
    def echo_range_m(self) -> NDArray[np.float64]:
        """Range of the strongest cell of each echo (E,) [m]."""
        return ((self.echoes.peak + 0.5) * self._scan.bin_m).astype(np.float64)

    def _level_db(self) -> NDArray[np.float64]:
        """Return the level of each cell above the sensor's noise (azimuths, bins) [dB]."""
        bins = self._scan.codes.shape[1]
        ranges_m = (np.arange(bins) + 0.5) * self._scan.bin_m
        noise = self._sensor.noise_units * range_gain(self._sensor, ranges_m)
        return np.asarray(self._scan.codes / 2 - 10 * np.log10(noise), np.float64)

    def places(self, found: Detections) -> tuple[NDArray[np.int64], NDArray[np.bool_]]:
        """Return the bins of detections, and which of them are within the judged ranges.

        Args:
            found: N detections.

        Returns:
            Bins (N,), 0 where outside, and whether each is judged (N,).

        Raises:
            ValueError: An azimuth does not exist.
        """
        azimuths = self._scan.codes.shape[0]
        if len(found) and not (found.azimuth.min() >= 0 and found.azimuth.max() < azimuths):
            raise ValueError(f"azimuths of detections must be between 0 and {azimuths - 1}")
        bins = np.floor(found.range_m / self._scan.bin_m).astype(np.int64)
        judged = (bins >= self._bins.start) & (bins < self._bins.stop)
        return np.where(judged, bins, 0), judged

    def label(self, found: Detections) -> NDArray[np.uint8]:
        """Return what detections fell on.

        Args:
            found: N detections.

        Returns:
            Numbers from `LABELS` (N,): `TARGET` for true ones; `OUTSIDE` where they are not judged.
        """
        bins, judged = self.places(found)
        true = judged & self.near_target[found.azimuth, bins]
        labels = np.where(true, np.uint8(TARGET), np.uint8(OUTSIDE))
        false = np.flatnonzero(judged & ~true)
        strongest = self.reach.strongest(self._scan.codes, found.azimuth[false], bins[false])
        labels[false] = self.labels.ravel()[strongest]
        return labels

    def best_levels(self, found: Detections, level: NDArray[np.int64]) -> NDArray[np.int64]:
        """Return the highest level of the detections of each echo.

        Args:
            found: N detections.
            level: Their levels (N,), 0 or more.

        Returns:
            Levels of the echoes (E,), -1 for echoes that no detection is within the tolerance of.
        """
        bins, judged = self.places(found)
        highest = np.full(self._scan.codes.shape, -1, np.int16)
        np.maximum.at(highest, (found.azimuth[judged], bins[judged]), level[judged].astype(np.int16))
        highest = self.reach.to_cells(highest).ravel()
        return _run_maxima(highest, self.echoes.first, self.echoes.last).astype(np.int64)


def judged_bins(bins: int, bin_m: float, settings: JudgeSettings) -> slice:
    """Return the bins whose centres are within the judged ranges.

    Args:
        bins: Bins of an azimuth.
        bin_m: Length of a bin [m].
        settings: How detections are judged.

    Returns:
        The bins.

    Raises:
        ValueError: There is none.
    """
    centres_m = (np.arange(bins) + 0.5) * bin_m
    far_m = math.inf if settings.far_m is None else settings.far_m
    inside = np.flatnonzero((centres_m >= settings.near_m) & (centres_m <= far_m))
    if not len(inside):
        raise ValueError(f"near_m must be below the last bin, {bins * bin_m:.4g} m, got {settings.near_m:g}")
    return slice(int(inside[0]), int(inside[-1]) + 1)


def _labels(cells: CellTruth, settings: JudgeSettings) -> NDArray[np.uint8]:
    """Return the label of each cell (azimuths, bins)."""
    labels = shown_components(cells, LABELS[: len(Component)]).astype(np.uint8)
    if settings.targets == "static":
        labels[(labels == TARGET) & cells.moving] = _MOVER
    return labels


def _run_maxima(values: NDArray, first: NDArray[np.int64], last: NDArray[np.int64]) -> NDArray:
    """Return the maximum of flat values over each run from `first` to `last` (E,)."""
    if not len(first):
        return values[:0]
    edges = np.stack([first, last + 1], axis=1).ravel()
    return np.maximum.reduceat(np.append(values, values[-1]), edges)[::2]


def _first_peaks(level: NDArray, first: NDArray[np.int64], last: NDArray[np.int64]) -> NDArray[np.int64]:
    """Return the first cell with the highest level of each run (E,), flat."""
    lengths = last - first + 1
    cell = np.arange(lengths.sum()) + np.repeat(first - np.cumsum(lengths) + lengths, lengths)
    run = np.repeat(np.arange(len(first)), lengths)
    at_peak = level[cell] == _run_maxima(level, first, last)[run]
    found, where = np.unique(run[at_peak], return_index=True)
    return cell[at_peak][where[: len(found)]]
