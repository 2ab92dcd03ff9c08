"""The interface of a radar odometry: it starts with a scan, then gives the motion to each scan that follows.

What a method keeps between scans is its own state: the features of the last scan, as in Barnes & Posner 2020,
or a keyframe and a velocity besides.
"""

import math
from dataclasses import dataclass
from typing import Protocol, TypeVar

import numpy as np
from numpy.typing import NDArray

from echoscape.sim.datasets.polar_scan import PolarScan

State = TypeVar("State")


class PairFailed(ValueError):
    """A method found no motion; the message says why. The pair is recorded as failed."""


@dataclass(frozen=True, kw_only=True)
class MatchedPoints:
    """Matched points of a pair of scans.

    Attributes:
        earlier_m: Points (N, 2) in the frame of the earlier scan: forward, right [m].
        later_m: Points (N, 2) in the frame of the later scan: forward, right [m].
        weights: Weights (N,), 0 or more.
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
    """The pose of the later scan in the frame of the earlier one, mid-scan to mid-scan, in Oxford axes.

    Attributes:
        x_m: Forward [m].
        y_m: Right [m].
        yaw_rad: Clockwise seen from above [rad].
        matches: The points behind the motion, None if the method matches no points.
    """

    x_m: float
    y_m: float
    yaw_rad: float
    matches: MatchedPoints | None = None

    @property
    def is_finite(self) -> bool:
        """Whether x, y and yaw are finite numbers."""
        return all(map(math.isfinite, (self.x_m, self.y_m, self.yaw_rad)))


class OdometryMethod(Protocol[State]):
    """A radar odometry, scan after scan. The same scans always give the same motions."""

    @property
    def name(self) -> str:
        """Name of the method in results."""
        ...

    def start(self, scan: PolarScan) -> State:
        """Begin a drive, or begin again, with a scan.

        Args:
            scan: The first scan.

        Returns:
            The state after it.

        Raises:
            PairFailed: The scan has nothing to compare.
        """
        ...

    def follow(self, state: State, scan: PolarScan) -> tuple[PairMotion, State]:
        """Estimate the motion since the scan before.

        Args:
            state: The state after the scan before.
            scan: The next scan.

        Returns:
            The motion, and the state after the scan.

        Raises:
            PairFailed: The scan has nothing to compare, or the motion is not determined.
        """
        ...
