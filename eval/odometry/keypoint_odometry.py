"""Odometry by hand-made keypoints as an `OdometryMethod`: each scan is matched with the one before.

Source: eval/methods; this module converts its results to eval/odometry/interface.py.
"""

from dataclasses import dataclass

from echoscape.eval.methods.keypoint_matcher import DescribedKeypoints, KeypointMatcher, ScanMatch
from echoscape.eval.odometry.interface import MatchedPoints, PairFailed, PairMotion
from echoscape.sim.datasets.polar_scan import PolarScan


@dataclass(frozen=True, kw_only=True)
class KeypointOdometrySettings:
    """When a motion counts as found."""

    least_inliers: int = 20
    """Matches that have to agree with a motion."""

    def __post_init__(self) -> None:
        if self.least_inliers < 2:
            raise ValueError(f"least_inliers must be 2 or more, got {self.least_inliers}")


class KeypointOdometry:
    """Keypoints of successive scans, matched by their surroundings, and the motion that most agree on."""

    def __init__(self, matcher: KeypointMatcher, settings: KeypointOdometrySettings | None = None) -> None:
        """Take a matcher.

        Args:
            matcher: Extracts and matches keypoints.
            settings: When a motion counts as found; None for the default.
        """
        self.matcher = matcher
        self.settings = settings or KeypointOdometrySettings()

    @property
    def name(self) -> str:
        """Name of the method in results."""
        return self.matcher.extractor.name

    def start(self, scan: PolarScan) -> DescribedKeypoints:
        """Begin a drive with a scan.

        Args:
            scan: The first scan.

        Returns:
            Its keypoints.

        Raises:
            PairFailed: There are too few.
        """
        found = self.matcher.describe(scan)
        least = self.settings.least_inliers
        if len(found.keypoints) < least:
            raise PairFailed(f"{len(found.keypoints)} keypoints in the scan, fewer than {least}")
        return found

    def follow(self, state: DescribedKeypoints, scan: PolarScan) -> tuple[PairMotion, DescribedKeypoints]:
        """Estimate the motion since the scan before.

        Args:
            state: Keypoints of the scan before.
            scan: The next scan.

        Returns:
            The motion with its matches, those that disagree with weight 0, and the keypoints of the scan.

        Raises:
            PairFailed: There are too few keypoints, or too few of their matches agree.
        """
        later = self.start(scan)
        try:
            found = self.matcher.match(state, later)
        except ValueError as error:
            raise PairFailed(str(error)) from error
        agreeing = int(found.inliers.sum())
        if agreeing < self.settings.least_inliers:
            raise PairFailed(f"{agreeing} matches agree, fewer than {self.settings.least_inliers}")
        return _pair_motion(found, state, later), later


def _pair_motion(found: ScanMatch, earlier: DescribedKeypoints, later: DescribedKeypoints) -> PairMotion:
    matches = MatchedPoints(
        earlier_m=earlier.keypoints.points_m[found.earlier],
        later_m=later.keypoints.points_m[found.later],
        weights=found.inliers.astype(float),
    )
    motion = found.motion
    return PairMotion(x_m=motion.x_m, y_m=motion.y_m, yaw_rad=motion.yaw_rad, matches=matches)
