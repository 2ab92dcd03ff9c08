"""A drive scan by scan: each matched with the one before and a keyframe, seen from where it should be.

Source: keyframes and the expectation of constant velocity are common in odometry (Burnett et al., RSS 2021;
Vizzo et al., RA-L 2023); Barnes & Posner 2020 take every pair by itself. Pairs alone add up what every one of
them is off, to the same side where the network leans to one: keyframes stop that from adding up, the scan
before keeps the next step smooth. Every picture is shown in the keyframe's frame at the pose that its scan is
expected at, so that what stands still stays where it was in the picture, and no lean towards that place,
which pooling brings about, makes a motion too short.
"""

import logging
import math
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from echoscape.learn.geometry.motion_compensation import Part, ScanMotionModel, Twist, twist_between
from echoscape.learn.geometry.se2 import to_motion
from echoscape.learn.odometry.scan_matcher import MatchTarget, PairEstimate, ScanFeatures, ScanMatcher
from echoscape.sim.datasets.se2 import IDENTITY, SE2

_LOG = logging.getLogger(__name__)


@dataclass(frozen=True, kw_only=True)
class OdometryConfig:
    """How a drive is followed.

    keyframe_m, keyframe_rad: how far from its keyframe a scan may be before it is the next one [m], [rad];
    keyframe_weight: how much a match with the keyframe counts against one with the scan before, above 0;
    surprise_m, surprise_rad: by how much a pose may miss what was expected before its scan is shown anew,
    where it was found, and what is found then may miss that; likely_m, likely_rad: the largest motion that is
    expected to go on [m], [rad]; within_m: how far from where it is expected a match is looked for, as a
    standard deviation [m], above 0, once there is an expectation.
    """

    keyframe_m: float = 20.0
    keyframe_rad: float = 0.3
    keyframe_weight: float = 3.0
    surprise_m: float = 0.5
    surprise_rad: float = 0.02
    likely_m: float = 15.0
    likely_rad: float = 0.5
    within_m: float = 1.5

    def __post_init__(self) -> None:
        for name, value in vars(self).items():
            if not value >= 0:
                raise ValueError(f"{name} must be 0 or more, got {value}")
        for name in ("keyframe_weight", "within_m"):
            if not getattr(self, name) > 0:
                raise ValueError(f"{name} must be above 0, got 0")


PAIRS_ALONE = OdometryConfig(
    keyframe_m=0.0,
    likely_m=0.0,
    likely_rad=0.0,
    surprise_m=math.inf,
    surprise_rad=math.inf,
    within_m=math.inf,
)
"""Every pair by itself, as the paper takes it: both scans upright, neither keyframe nor expectation."""


@dataclass(frozen=True, kw_only=True)
class Scan:
    """A scan as it comes: codes (azimuths, bins) uint8, a bin's length [m], and its time.

    range_offset_m: what to add to the ranges of bins [m]; middle_s: time of mid-scan; turn_s: how long a turn
    took [s].
    """

    codes: NDArray[np.uint8]
    bin_m: float
    range_offset_m: float
    middle_s: float
    turn_s: float


@dataclass(frozen=True, kw_only=True)
class Keyframe:
    """A scan on the way: what is kept of it, ready to be searched, and its pose in the keyframe's frame.

    twist: of a keyframe, the velocities of the motion that led to it, or for want of one, of the first that
    led on from it; None where there is neither yet.
    """

    features: ScanFeatures
    searchable: MatchTarget
    pose: SE2
    twist: Twist | None = None


@dataclass(frozen=True, kw_only=True)
class OdometryState:
    """What is kept of a drive so far.

    keyframe, before: the scans that the next one is matched with, the same one right after a start; motion:
    the last one, and the time that it took [s], None after a start; middle_s: of the last scan.
    """

    keyframe: Keyframe
    before: Keyframe
    motion: tuple[SE2, float] | None
    middle_s: float


class KeyframeOdometry:
    """Odometry that goes on from what it kept of the scans before."""

    def __init__(
        self,
        estimator: ScanMatcher,
        settings: OdometryConfig | None = None,
        *,
        doppler_beta_s: float | None = None,
    ) -> None:
        """Take an estimator.

        doppler_beta_s: range by which what approaches appears too near, by its speed [m per m/s], to move
        points to mid-scan and rid them of Doppler shifts (`rolling`); None takes points as they are.
        """
        self.estimator, self.settings = estimator, settings or OdometryConfig()
        self._doppler_beta_s = doppler_beta_s

    @property
    def compensates(self) -> bool:
        """Whether points are moved to mid-scan."""
        return self._doppler_beta_s is not None

    def start(self, scan: Scan) -> OdometryState:
        """Return the track of a drive that begins with a scan.

        Raises:
            ValueError: it is no scan.
        """
        found = self.estimator.features(scan.codes, scan.bin_m, range_offset_m=scan.range_offset_m)
        keyframe = self._keyframe(found)
        return OdometryState(keyframe=keyframe, before=keyframe, motion=None, middle_s=scan.middle_s)

    def follow(self, track: OdometryState, scan: Scan) -> tuple[PairEstimate, OdometryState]:
        """Return the motion T_before_scan with the matches between the two, and the track with the scan.

        Points stay as they are, with a warning, where times tell no velocity or no turn.

        Raises:
            ValueError: it is no scan.
        """
        track = self._with_keyframe_in_reach(track)
        gap_s = scan.middle_s - track.middle_s
        rolling = self._rolling(scan, gap_s)
        going_on = self._expected(track, gap_s)
        expected = track.before.pose @ (going_on or IDENTITY)
        source = self.estimator.features(
            scan.codes, scan.bin_m, range_offset_m=scan.range_offset_m, shown_at=expected
        )
        found = self._found(track, source, rolling, expecting=going_on is not None)
        if found.certain and self._is_surprise(expected.inverse() @ found.motion):
            shown = self.estimator.shown(source, found.motion)
            again = self._found(track, shown, rolling, expecting=True)
            if again.certain and not self._is_surprise(found.motion.inverse() @ again.motion):
                found, source = again, shown
        motion = track.before.pose.inverse() @ found.motion
        before = Keyframe(features=source, searchable=self.estimator.searchable(source), pose=found.motion)
        after = replace(
            track,
            keyframe=_with_twist(track.keyframe, motion, gap_s),
            before=before,
            motion=(motion, gap_s),
            middle_s=scan.middle_s,
        )
        return replace(found, motion=motion), after

    def _keyframe(self, features: ScanFeatures) -> Keyframe:
        shown = self.estimator.shown(features, IDENTITY)
        return Keyframe(features=shown, searchable=self.estimator.searchable(shown), pose=IDENTITY)

    def _with_keyframe_in_reach(self, track: OdometryState) -> OdometryState:
        """Return the track, with the scan before as its new keyframe where the old one is too far back."""
        pose, reach = track.before.pose, self.settings
        if pose.length_m < reach.keyframe_m and abs(pose.yaw_rad) < reach.keyframe_rad:
            return track
        keyframe = self._keyframe(track.before.features)
        if track.motion is not None:
            keyframe = _with_twist(keyframe, *track.motion)
        return replace(track, keyframe=keyframe, before=keyframe)

    def _rolling(self, scan: Scan, gap_s: float) -> ScanMotionModel | None:
        """Return how a pair came about, None where points are taken as they are: without times that tell."""
        if self._doppler_beta_s is None:
            return None
        if not (math.isfinite(gap_s) and gap_s != 0 and math.isfinite(scan.turn_s) and scan.turn_s > 0):
            _LOG.warning("times of a turn of %g s and a gap of %g s: points as they are", scan.turn_s, gap_s)
            return None
        return ScanMotionModel(turn_s=scan.turn_s, doppler_beta_s=self._doppler_beta_s, gap_s=gap_s)

    def _expected(self, track: OdometryState, gap_s: float) -> SE2 | None:
        """Return the motion of a car that goes on as it went, None where nothing is to be expected."""
        if track.motion is None:
            return None
        motion, took_s = track.motion
        ratio = gap_s / took_s if took_s > 0 and gap_s > 0 and math.isfinite(gap_s) else 1.0
        going_on = motion.scaled(ratio)
        likely = self.settings
        within = going_on.length_m <= likely.likely_m and abs(going_on.yaw_rad) <= likely.likely_rad
        return going_on if within else None

    def _is_surprise(self, off: SE2) -> bool:
        return off.length_m > self.settings.surprise_m or abs(off.yaw_rad) > self.settings.surprise_rad

    def _found(
        self, track: OdometryState, source: ScanFeatures, rolling: ScanMotionModel | None, *, expecting: bool
    ) -> PairEstimate:
        """Return the scan's pose in the keyframe's frame, and its matches with the scan before."""
        stops = [track.before] if track.keyframe is track.before else [track.keyframe, track.before]
        within_m = self.settings.within_m if expecting and math.isfinite(self.settings.within_m) else None
        parts = [
            Part(
                matches=self.estimator.matches(source, stop.searchable, within_m=within_m),
                stood_at=to_motion(stop.pose),
                twist=stop.twist if stop is not track.before else None,
                weight=self.settings.keyframe_weight if stop is not track.before else 1.0,
            )
            for stop in stops
        ]
        return self.estimator.solve(parts, rolling)


def _with_twist(keyframe: Keyframe, motion: SE2, took_s: float) -> Keyframe:
    """Return a keyframe with its velocities, unless they are known, by a motion next to it."""
    if keyframe.twist is not None or not (took_s != 0 and math.isfinite(took_s)):
        return keyframe
    return replace(keyframe, twist=twist_between(to_motion(motion), took_s))
