"""What judges and commands ask of a radar odometry: features once per scan, and the motion between two scans.

The two steps are those of Barnes & Posner 2020 (keypoints once per scan, then matching), and of any method
that describes a scan before it compares.
"""

import math
from dataclasses import dataclass
from typing import Protocol, TypeVar

import numpy as np
from numpy.typing import NDArray

from echoscape.sim.polar_scan import PolarScan

Features = TypeVar("Features")


class PairFailed(ValueError):
    """An estimator found no motion; the message says why. The pair is recorded as failed."""


@dataclass(frozen=True, kw_only=True)
class Matches:
    """N matched points of a pair.

    earlier_m, later_m (N, 2): forward, right [m], each in its own scan's frame; weights (N,), 0 or more.
    """

    earlier_m: NDArray[np.float64]
    later_m: NDArray[np.float64]
    weights: NDArray[np.float64]

    def __post_init__(self) -> None:
        count = len(self.weights)
        shapes = self.earlier_m.shape, self.later_m.shape, self.weights.shape
        if shapes != ((count, 2), (count, 2), (count,)):
            raise ValueError(f"points must be (N, 2) twice and weights (N,), got {shapes}")


@dataclass(frozen=True, kw_only=True)
class PairMotion:
    """The pose of the later scan in the earlier one's frame, mid-scan to mid-scan, Oxford axes.

    x_m forward, y_m right [m]; yaw_rad clockwise seen from above [rad]; matches: what it was made from, where
    the estimator matches points.
    """

    x_m: float
    y_m: float
    yaw_rad: float
    matches: Matches | None = None

    @property
    def is_finite(self) -> bool:
        """Whether all three are numbers."""
        return all(map(math.isfinite, (self.x_m, self.y_m, self.yaw_rad)))


class Estimator(Protocol[Features]):
    """A radar odometry. The same scans always give the same motion."""

    @property
    def name(self) -> str:
        """What results are labelled with."""
        ...

    def features(self, scan: PolarScan) -> Features:
        """Return what a scan is compared by; called once for each scan.

        Raises:
            PairFailed: the scan has nothing to compare.
        """
        ...

    def motion(self, earlier: Features, later: Features) -> PairMotion:
        """Return the pose of the later scan in the earlier one's frame.

        Raises:
            PairFailed: the scans cannot be brought together.
        """
        ...
