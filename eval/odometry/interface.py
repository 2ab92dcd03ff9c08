"""What judges and commands ask of a radar odometry: a start, and then the motion to each scan that follows.

What a method keeps of the scans before is its own: the features of the last one, as Barnes & Posner 2020 do,
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
    """An estimator found no motion; the message says why. The pair is recorded as failed."""


@dataclass(frozen=True, kw_only=True)
class MatchedPoints:
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
    matches: MatchedPoints | None = None

    @property
    def is_finite(self) -> bool:
        """Whether all three are numbers."""
        return all(map(math.isfinite, (self.x_m, self.y_m, self.yaw_rad)))


class OdometryMethod(Protocol[State]):
    """A radar odometry, scan after scan. The same scans always give the same motions."""

    @property
    def name(self) -> str:
        """What results are labelled with."""
        ...

    def start(self, scan: PolarScan) -> State:
        """Return what is kept of a drive that begins, or begins again, with a scan.

        Raises:
            PairFailed: the scan has nothing to compare.
        """
        ...

    def follow(self, state: State, scan: PolarScan) -> tuple[PairMotion, State]:
        """Return the pose of a scan in the frame of the one before it, and what is kept then.

        Raises:
            PairFailed: the scan has nothing to compare, or the scans cannot be brought together.
        """
        ...
