"""The motion between two scans by hand-made keypoints: descriptors, graph matching, RANSAC, least squares.

Source: Cen & Newman, ICRA 2018 and ICRA 2019; RANSAC as in Burnett et al., RA-L 2021. Points are taken as
measured: between successive scans at constant velocity the distortions of the two are nearly alike.
"""

import math
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from echoscape.eval.methods.graph_matching import compatibility, compatible_set, most_alike
from echoscape.eval.methods.keypoints import KeypointExtractor, Keypoints
from echoscape.eval.methods.rigid_motion import RansacSettings, ransac_motion
from echoscape.eval.methods.ring_descriptor import RingSettings, ring_descriptors
from echoscape.sim.datasets.polar_scan import PolarScan
from echoscape.sim.datasets.se2 import SE2

_SEED = 20_180_521
"""Of the samples of RANSAC, for each pair anew: its motion depends on the two scans only."""


@dataclass(frozen=True, kw_only=True)
class MatcherSettings:
    """How keypoints of two scans are matched."""

    rings: RingSettings = field(default_factory=RingSettings)
    """The descriptors."""
    tolerance_m: float = 0.5
    """Difference of the distances of two keypoints in both scans from which on their matches disagree [m]."""
    ransac: RansacSettings = field(default_factory=RansacSettings)
    """How the motion is searched."""
    most_keypoints: int = 2500
    """Keypoints of a scan that are matched at most, those of the highest scores: the time grows with the
    square."""

    def __post_init__(self) -> None:
        if not 0 < self.tolerance_m < math.inf:
            raise ValueError(f"tolerance_m must be finite and above 0, got {self.tolerance_m}")
        if self.most_keypoints < 2:
            raise ValueError(f"most_keypoints must be 2 or more, got {self.most_keypoints}")


@dataclass(frozen=True, kw_only=True)
class DescribedKeypoints:
    """Keypoints of a scan with what they are matched by.

    Attributes:
        keypoints: The N keypoints.
        descriptors: Their descriptors (N, D).
    """

    keypoints: Keypoints
    descriptors: NDArray[np.float64]


@dataclass(frozen=True, kw_only=True)
class ScanMatch:
    """The motion between two scans, and the matches behind it.

    Attributes:
        motion: T_earlier_later.
        earlier: Numbers of the matched keypoints of the earlier scan (K,) int64.
        later: Their matches in the later scan (K,) int64.
        inliers: Which matches agree with the motion (K,) bool.
    """

    motion: SE2
    earlier: NDArray[np.int64]
    later: NDArray[np.int64]
    inliers: NDArray[np.bool_]


class KeypointMatcher:
    """Matches the keypoints of scans. The same two scans always give the same motion."""

    def __init__(
        self,
        extractor: KeypointExtractor,
        settings: MatcherSettings | None = None,
        *,
        range_offset_m: float = 0.0,
    ) -> None:
        """Take the extractor.

        Args:
            extractor: Finds the keypoints.
            settings: How they are matched; None for the default.
            range_offset_m: Offset to the ranges of bins [m], as in `ScanFolder`.
        """
        self.extractor = extractor
        self.settings = settings or MatcherSettings()
        self.range_offset_m = range_offset_m

    def describe(self, scan: PolarScan) -> DescribedKeypoints:
        """Extract and describe the keypoints of a scan.

        Args:
            scan: The scan.

        Returns:
            The keypoints, those of the highest scores where there are too many.
        """
        found = self.extractor.extract(scan, range_offset_m=self.range_offset_m)
        found = found.strongest(self.settings.most_keypoints)
        return DescribedKeypoints(
            keypoints=found, descriptors=ring_descriptors(found.points_m, self.settings.rings)
        )

    def match(self, earlier: DescribedKeypoints, later: DescribedKeypoints) -> ScanMatch:
        """Match the keypoints of two scans, and find the motion.

        Args:
            earlier: Keypoints of the earlier scan.
            later: Keypoints of the later scan.

        Returns:
            The motion and its matches.

        Raises:
            ValueError: Fewer than two matches agree.
        """
        if not len(earlier.keypoints) or not len(later.keypoints):
            raise ValueError("a scan has no keypoints")
        target = most_alike(earlier.descriptors, later.descriptors)
        a, b = earlier.keypoints.points_m, later.keypoints.points_m
        chosen = compatible_set(compatibility(a, b[target], self.settings.tolerance_m), target)
        if len(chosen) < 2:
            raise ValueError("no two matches of keypoints agree about their distance")
        rng = np.random.default_rng(_SEED)
        motion, inliers = ransac_motion(a[chosen], b[target[chosen]], self.settings.ransac, rng=rng)
        return ScanMatch(motion=motion, earlier=chosen, later=target[chosen], inliers=inliers)
