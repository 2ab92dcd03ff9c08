"""The interface of a detector: a scan becomes places with scores, in the polar frame of the scan itself.

A detection stays at the azimuth that measured it. The truth of a cell is that of the same azimuth, at its own
time and pose, so that neither the motion of the car during a scan nor a Doppler shift comes between the two.
"""

import math
from dataclasses import dataclass
from typing import Any, Protocol, runtime_checkable

import numpy as np
from numpy.typing import NDArray

from echoscape.sim.datasets.polar_scan import PolarScan


@dataclass(frozen=True, kw_only=True)
class Detections:
    """N places of a scan with their scores.

    Attributes:
        azimuth: Numbers of the azimuths (N,) int64.
        range_m: Ranges (N,) float64 [m]; bin k reaches from k bin_m to (k + 1) bin_m.
        score: Scores (N,) float64, higher for places that are more likely targets.
    """

    azimuth: NDArray[np.int64]
    range_m: NDArray[np.float64]
    score: NDArray[np.float64]

    def __post_init__(self) -> None:
        shapes = self.azimuth.shape, self.range_m.shape, self.score.shape
        if len(set(shapes)) > 1 or len(shapes[0]) != 1:
            raise ValueError(f"azimuth, range_m and score must be (N,), got {shapes}")
        if not (np.isfinite(self.range_m).all() and np.isfinite(self.score).all()):
            raise ValueError("range_m and score must be finite")

    def __len__(self) -> int:
        """Return the number of places."""
        return len(self.azimuth)


@dataclass(frozen=True, kw_only=True)
class ScoredScan:
    """What a detector makes of a scan.

    Attributes:
        detections: The places that it reports.
        score_map: Every place that it scores, reported or not: the cells of the scan, or pixels of an image.
            None of a detector that scores nothing but what it reports.
    """

    detections: Detections
    score_map: Detections | None = None


class Detector(Protocol):
    """A detector. The same scan always gives the same detections."""

    @property
    def name(self) -> str:
        """Name of the method in results."""
        ...

    @property
    def score_name(self) -> str:
        """What the score is, with its unit."""
        ...

    @property
    def score_limits(self) -> tuple[float, float]:
        """Lowest and highest score: scores beyond them count as these."""
        ...

    def detect(self, scan: PolarScan) -> ScoredScan:
        """Detect targets.

        Args:
            scan: A scan.

        Returns:
            The detections, and the scores of all places.
        """
        ...


@runtime_checkable
class Recorded(Protocol):
    """A detector with a record of what decides its detections, beside its name and the scan."""

    def record(self) -> dict[str, Any]:
        """Return its settings, as JSON takes them.

        Returns:
            Values by name, with a hash of each file that it reads.
        """
        ...


def cells_of(mask: NDArray[np.bool_], score: NDArray[Any], bin_m: float) -> Detections:
    """Return the cells of a mask as detections at the centres of their bins.

    Args:
        mask: Which cells (azimuths, bins).
        score: Scores of all cells (azimuths, bins).
        bin_m: Length of a range bin [m].

    Returns:
        The cells, by azimuth, nearest first.
    """
    azimuth, bins = np.nonzero(mask)
    return Detections(
        azimuth=azimuth,
        range_m=((bins + 0.5) * bin_m).astype(np.float64),
        score=score[azimuth, bins].astype(np.float64),
    )


def polar_detections(
    points_m: NDArray[np.floating], score: NDArray[np.floating], scan: PolarScan
) -> Detections:
    """Convert points in the frame of a scan, not corrected for motion, to detections.

    Args:
        points_m: Points (N, 2): forward, right [m].
        score: Their scores (N,).
        scan: The scan, which gives the directions of the azimuths.

    Returns:
        The detections, each at the azimuth whose direction is nearest.
    """
    azimuths = len(scan.encoder)
    points = np.asarray(points_m, np.float64).reshape(-1, 2)
    forward, right = points[:, 0], points[:, 1]
    steps = (np.arctan2(right, forward) - scan.first_azimuth_rad) * (azimuths / (2 * math.pi))
    return Detections(
        azimuth=np.rint(steps).astype(np.int64) % azimuths,
        range_m=np.asarray(np.hypot(forward, right), np.float64),
        score=np.asarray(score, np.float64),
    )
