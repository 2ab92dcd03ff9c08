"""Odometry over a drive: each scan matched with the one before and a keyframe, around its predicted pose.

Source: keyframes and a constant-velocity prediction are common in odometry (Burnett et al., RSS 2021; Vizzo
et al., RA-L 2023); Barnes & Posner 2020 solve each pair by itself. Errors of pairs accumulate, and are biased
if the network is; keyframes bound that, and the scan before keeps the next step smooth. Every image is
rendered in the keyframe's frame at the predicted pose of its scan, so that static objects keep their place in
it and a bias towards equal places in both images, which pooling causes, does not shorten the motion.
"""

import logging
import math
from dataclasses import dataclass, replace

from echoscape.learn.geometry.motion_compensation import ScanMotionModel, Twist, twist_between
from echoscape.learn.geometry.se2 import to_motion
from echoscape.learn.odometry.pair_estimate import PairEstimate
from echoscape.learn.odometry.scan_matcher import Reference, ScanFeatures, ScanMatcher
from echoscape.sim.datasets.polar_scan import PolarScan
from echoscape.sim.datasets.se2 import IDENTITY, SE2

_LOG = logging.getLogger(__name__)


@dataclass(frozen=True, kw_only=True)
class OdometryConfig:
    """Settings of the odometry.

    Attributes:
        keyframe_m: Distance from the keyframe at which the scan before becomes the next one [m].
        keyframe_rad: Rotation from the keyframe at which it does [rad].
        keyframe_weight: Weight of a match with the keyframe against one with the scan before, above 0.
        innovation_gate_m: Distance between predicted and estimated pose above which the scan is rendered and
            matched again at the estimate; a second estimate farther than that from the first is dropped [m].
        innovation_gate_rad: The same for the rotation [rad].
        max_extrapolation_m: Largest predicted motion between scans; beyond it nothing is predicted [m].
        max_extrapolation_rad: The same for the rotation [rad].
        search_sigma_m: Standard deviation of matches from the predicted location, above 0; infinity searches
            the whole image always [m].
    """

    keyframe_m: float = 20.0
    keyframe_rad: float = 0.3
    keyframe_weight: float = 3.0
    innovation_gate_m: float = 0.5
    innovation_gate_rad: float = 0.02
    max_extrapolation_m: float = 15.0
    max_extrapolation_rad: float = 0.5
    search_sigma_m: float = 1.5

    def __post_init__(self) -> None:
        for name, value in vars(self).items():
            if not value >= 0:
                raise ValueError(f"{name} must be 0 or more, got {value}")
        for name in ("keyframe_weight", "search_sigma_m"):
            if not getattr(self, name) > 0:
                raise ValueError(f"{name} must be above 0, got 0")


ROBUST_PAIRS = OdometryConfig(
    keyframe_m=0.0,
    max_extrapolation_m=0.0,
    max_extrapolation_rad=0.0,
    innovation_gate_m=math.inf,
    innovation_gate_rad=math.inf,
    search_sigma_m=math.inf,
)
"""Each pair by itself, as in the paper: neither keyframe nor prediction, no image moved."""


@dataclass(frozen=True, kw_only=True)
class Keyframe:
    """A scan that the next one is matched with.

    Attributes:
        features: Its features, rendered at `pose`.
        pose: Its pose in the frame of the keyframe.
        twist: Of a keyframe, the velocities of the motion to it, or of the first motion from it if there was
            none; None until one is known.
    """

    features: ScanFeatures
    pose: SE2
    twist: Twist | None = None


@dataclass(frozen=True, kw_only=True)
class OdometryState:
    """What is kept of a drive so far.

    Attributes:
        keyframe: The keyframe.
        previous: The scan before, the same object as `keyframe` after a start.
        motion: The last motion and its duration [s]; None after a start.
        mid_scan_s: Time of mid-scan of the scan before [s].
    """

    keyframe: Keyframe
    previous: Keyframe
    motion: tuple[SE2, float] | None
    mid_scan_s: float


class KeyframeOdometry:
    """Odometry with keyframes and a constant-velocity prediction."""

    def __init__(
        self,
        matcher: ScanMatcher,
        config: OdometryConfig | None = None,
        *,
        doppler_beta_s: float | None = None,
    ) -> None:
        """Build the odometry on a matcher.

        Args:
            matcher: Matches scans.
            config: Settings; None for the default ones.
            doppler_beta_s: Range by which an approaching point appears too near, by its closing speed
                [m per m/s], for poses from mid-scan to mid-scan; None takes points as measured.
        """
        self.matcher, self.config = matcher, config or OdometryConfig()
        self._doppler_beta_s = doppler_beta_s

    @property
    def compensates(self) -> bool:
        """Whether points are moved to mid-scan."""
        return self._doppler_beta_s is not None

    def start(self, scan: PolarScan) -> OdometryState:
        """Begin a drive.

        Args:
            scan: The first scan.

        Returns:
            The state after it, with the scan as keyframe.

        Raises:
            ValueError: The scan has no azimuths or bins.
        """
        keyframe = Keyframe(features=self.matcher.features(scan), pose=IDENTITY)
        return OdometryState(keyframe=keyframe, previous=keyframe, motion=None, mid_scan_s=_mid_scan_s(scan))

    def follow(self, state: OdometryState, scan: PolarScan) -> tuple[PairEstimate, OdometryState]:
        """Estimate the motion since the scan before.

        Points are taken as measured, with a warning, if the timestamps give no velocity or scan duration.

        Args:
            state: The state after the scan before.
            scan: The next scan.

        Returns:
            The motion T_previous_scan with the matches between the two, and the state after the scan.

        Raises:
            ValueError: The scan has no azimuths or bins.
        """
        state = self._with_keyframe_in_reach(state)
        gap_s = _mid_scan_s(scan) - state.mid_scan_s
        scan_motion = self._scan_motion(scan, gap_s)
        prediction = self._prediction(state, gap_s)
        predicted_pose = state.previous.pose @ (prediction or IDENTITY)
        source = self.matcher.features(scan, rendered_at=predicted_pose)
        found = self._estimate(state, source, scan_motion, predicted=prediction is not None)
        if found.certain and self._fails_gate(predicted_pose.inverse() @ found.motion):
            rendered = self.matcher.rendered(source, found.motion)
            again = self._estimate(state, rendered, scan_motion, predicted=True)
            if again.certain and not self._fails_gate(found.motion.inverse() @ again.motion):
                found, source = again, rendered
        motion = state.previous.pose.inverse() @ found.motion
        after = replace(
            state,
            keyframe=_with_twist(state.keyframe, motion, gap_s),
            previous=Keyframe(features=source, pose=found.motion),
            motion=(motion, gap_s),
            mid_scan_s=_mid_scan_s(scan),
        )
        return replace(found, motion=motion), after

    def _with_keyframe_in_reach(self, state: OdometryState) -> OdometryState:
        """Return the state, with the scan before as its new keyframe where the old one is too far."""
        pose = state.previous.pose
        if pose.length_m < self.config.keyframe_m and abs(pose.yaw_rad) < self.config.keyframe_rad:
            return state
        features = self.matcher.rendered(state.previous.features, IDENTITY)
        keyframe = Keyframe(features=features, pose=IDENTITY)
        if state.motion is not None:
            keyframe = _with_twist(keyframe, *state.motion)
        return replace(state, keyframe=keyframe, previous=keyframe)

    def _scan_motion(self, scan: PolarScan, gap_s: float) -> ScanMotionModel | None:
        """Return the timing of a pair, None where points are taken as measured."""
        if self._doppler_beta_s is None:
            return None
        scan_s = scan.revolution_s
        if gap_s == 0 or scan_s <= 0:
            _LOG.warning("scan of %g s, %g s after the one before: points as measured", scan_s, gap_s)
            return None
        return ScanMotionModel(
            scan_s=scan_s, seam_rad=scan.seam_rad, doppler_beta_s=self._doppler_beta_s, gap_s=gap_s
        )

    def _prediction(self, state: OdometryState, gap_s: float) -> SE2 | None:
        """Return the motion at constant velocity, None where nothing is predicted."""
        if state.motion is None:
            return None
        motion, duration_s = state.motion
        predicted = motion.scaled(gap_s / duration_s if duration_s > 0 and gap_s > 0 else 1.0)
        within_m = predicted.length_m <= self.config.max_extrapolation_m
        within_rad = abs(predicted.yaw_rad) <= self.config.max_extrapolation_rad
        return predicted if within_m and within_rad else None

    def _fails_gate(self, innovation: SE2) -> bool:
        too_far = innovation.length_m > self.config.innovation_gate_m
        return too_far or abs(innovation.yaw_rad) > self.config.innovation_gate_rad

    def _estimate(
        self,
        state: OdometryState,
        source: ScanFeatures,
        scan_motion: ScanMotionModel | None,
        *,
        predicted: bool,
    ) -> PairEstimate:
        """Return the scan's pose in the frame of the keyframe, with its matches with the scan before."""
        previous = Reference(features=state.previous.features, pose=state.previous.pose)
        keyframe = Reference(
            features=state.keyframe.features,
            pose=state.keyframe.pose,
            twist=state.keyframe.twist,
            weight=self.config.keyframe_weight,
        )
        references = [previous] if state.keyframe is state.previous else [keyframe, previous]
        local = predicted and math.isfinite(self.config.search_sigma_m)
        return self.matcher.estimate(
            source,
            references,
            scan_motion=scan_motion,
            search_sigma_m=self.config.search_sigma_m if local else None,
        )


def _mid_scan_s(scan: PolarScan) -> float:
    """Return the time halfway between the first azimuth and the last [s]."""
    return (int(scan.timestamp_us[0]) + int(scan.timestamp_us[-1])) / 2e6


def _with_twist(keyframe: Keyframe, motion: SE2, duration_s: float) -> Keyframe:
    """Return a keyframe with velocities, unless it has them, from a motion next to it."""
    if keyframe.twist is not None or duration_s == 0:
        return keyframe
    return replace(keyframe, twist=twist_between(to_motion(motion), duration_s))
