"""Keypoints of a polar scan: the common result and interface of hand-made extractors."""

import math
from dataclasses import dataclass, fields
from typing import Protocol

import numpy as np
from numpy.typing import NDArray

from echoscape.sim.datasets.array_record import ArrayRecord
from echoscape.sim.datasets.polar_scan import PolarScan


@dataclass(frozen=True, kw_only=True, eq=False)
class Keypoints(ArrayRecord):
    """The N keypoints of a scan as measured: each in the frame of the car at the time of its azimuth.

    Attributes:
        azimuth: Numbers of their azimuths (N,) int64.
        bin: Numbers of their range bins (N,) int64.
        azimuth_rad: Directions, clockwise from ahead, 0 to 2 pi (N,) float64 [rad].
        range_m: Ranges (N,) float64 [m].
        score: Scores (N,) float64, higher for those that stand out more.
    """

    azimuth: NDArray[np.int64]
    bin: NDArray[np.int64]
    azimuth_rad: NDArray[np.float64]
    range_m: NDArray[np.float64]
    score: NDArray[np.float64]

    def __len__(self) -> int:
        """Return the number of keypoints."""
        return len(self.azimuth)

    @property
    def x_m(self) -> NDArray[np.float64]:
        """Forward of the radar (N,) [m]."""
        return self.range_m * np.cos(self.azimuth_rad)

    @property
    def y_m(self) -> NDArray[np.float64]:
        """To the right of the radar (N,) [m]."""
        return self.range_m * np.sin(self.azimuth_rad)

    @property
    def points_m(self) -> NDArray[np.float64]:
        """Forward, right (N, 2) [m]."""
        return np.stack([self.x_m, self.y_m], axis=-1)

    def strongest(self, count: int) -> "Keypoints":
        """Keep the keypoints of the highest scores.

        Args:
            count: How many are kept at most; of equal scores the first.

        Returns:
            The kept ones in their order.
        """
        kept = np.sort(np.argsort(-self.score, kind="stable")[:count])
        return Keypoints(**{each.name: getattr(self, each.name)[kept] for each in fields(self)})


class KeypointExtractor(Protocol):
    """Finds the keypoints of single scans. The same scan always gives the same keypoints."""

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
        """Lowest and highest score."""
        ...

    def scores(self, scan: PolarScan) -> NDArray[np.float64]:
        """Score every cell.

        Args:
            scan: A scan.

        Returns:
            Scores of the cells (azimuths, bins), within the limits.
        """
        ...

    def extract(self, scan: PolarScan, *, range_offset_m: float = 0.0) -> Keypoints:
        """Find the keypoints.

        Args:
            scan: A scan.
            range_offset_m: Offset to the ranges of bins [m], as in `ScanFolder`.

        Returns:
            The keypoints by azimuth, nearest first.
        """
        ...


def keypoints_at(
    scan: PolarScan,
    azimuth: NDArray[np.int64],
    bins: NDArray[np.int64],
    score: NDArray[np.float64],
    *,
    range_offset_m: float = 0.0,
) -> Keypoints:
    """Make keypoints of cells.

    Args:
        scan: The scan, which gives directions and ranges.
        azimuth: Numbers of the azimuths (N,).
        bins: Numbers of the bins (N,).
        score: Scores (N,).
        range_offset_m: Offset to the ranges of bins [m].

    Returns:
        The keypoints, each at the centre of its cell.
    """
    step_rad = 2 * math.pi / len(scan.codes)
    return Keypoints(
        azimuth=azimuth.astype(np.int64),
        bin=bins.astype(np.int64),
        azimuth_rad=(scan.first_azimuth_rad + azimuth.astype(np.float64) * step_rad) % (2 * math.pi),
        range_m=(bins.astype(np.float64) + 0.5) * scan.bin_m + range_offset_m,
        score=score.astype(np.float64),
    )


def first_bin(near_m: float, bin_m: float) -> int:
    """Return the first bin whose centre is at or beyond a range.

    Args:
        near_m: The range [m].
        bin_m: Length of a bin [m].

    Returns:
        Its number.
    """
    return max(0, math.ceil(near_m / bin_m - 0.5))
