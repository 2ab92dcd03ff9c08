"""Odometry by hand-made keypoints: motions of drawn landmarks chain, and scans without them fail."""

import math
from dataclasses import replace

import numpy as np
import pytest

from echoscape.eval.methods.keypoint_matcher import KeypointMatcher
from echoscape.eval.methods.registry import EXTRACTORS
from echoscape.eval.odometry.interface import PairFailed
from echoscape.eval.odometry.keypoint_odometry import KeypointOdometry, KeypointOdometrySettings
from echoscape.sim.datasets.se2 import SE2
from tests.eval.drives import landmarks, scan_of

POSES = [(0.0, 0.0, 0.0), (2.0, 0.1, math.radians(2)), (4.2, 0.3, math.radians(5))]
SCANS = [scan_of(landmarks(count=100), pose) for pose in POSES]
NAMES = pytest.mark.parametrize("name", ["cen2018", "cen2019"])


def odometry(name: str, settings: KeypointOdometrySettings | None = None) -> KeypointOdometry:
    return KeypointOdometry(KeypointMatcher(EXTRACTORS[name]()), settings)


@NAMES
def test_motions_chain_to_the_poses(name: str) -> None:
    method = odometry(name)
    assert method.name == name
    state, pose = method.start(SCANS[0]), SE2(x_m=0, y_m=0, yaw_rad=0)
    for scan, expected in zip(SCANS[1:], POSES[1:], strict=True):
        motion, state = method.follow(state, scan)
        pose = pose @ SE2(x_m=motion.x_m, y_m=motion.y_m, yaw_rad=motion.yaw_rad)
        np.testing.assert_allclose(pose.array[:2], expected[:2], atol=0.15)
        assert abs(pose.yaw_rad - expected[2]) < math.radians(0.3)


def test_matches_that_disagree_have_no_weight() -> None:
    method = odometry("cen2019")
    motion, _ = method.follow(method.start(SCANS[0]), SCANS[1])
    matches = motion.matches
    assert matches is not None
    assert set(matches.weights.tolist()) == {0.0, 1.0}
    agreeing = matches.weights == 1
    cosine, sine = math.cos(motion.yaw_rad), math.sin(motion.yaw_rad)
    moved = matches.later_m @ np.array([[cosine, sine], [-sine, cosine]]) + [motion.x_m, motion.y_m]
    off_m = np.linalg.norm(moved - matches.earlier_m, axis=1)
    # The fit to the inliers moves them by less than their distance of 0.35 m from the best sample.
    assert off_m[agreeing].max() < 0.7
    assert off_m[~agreeing].mean() > off_m[agreeing].mean()


@NAMES
def test_scans_without_keypoints_fail(name: str) -> None:
    method = odometry(name)
    empty = replace(SCANS[1], codes=np.zeros_like(SCANS[1].codes))
    with pytest.raises(PairFailed, match="0 keypoints in the scan, fewer than 20"):
        method.follow(method.start(SCANS[0]), empty)


@NAMES
def test_shuffled_azimuths_fail(name: str) -> None:
    method = odometry(name)
    order = np.random.default_rng(0).permutation(len(SCANS[1].codes))
    with pytest.raises(PairFailed, match=r"matches agree, fewer than 20|keypoints in the scan"):
        method.follow(method.start(SCANS[0]), replace(SCANS[1], codes=SCANS[1].codes[order]))


def test_too_few_agreeing_matches_fail() -> None:
    plain = odometry("cen2018")
    motion, state = plain.follow(plain.start(SCANS[0]), SCANS[1])
    assert motion.matches is not None
    agreeing = int(motion.matches.weights.sum())
    method = odometry("cen2018", KeypointOdometrySettings(least_inliers=agreeing + 1))
    assert len(state.keypoints) > agreeing
    with pytest.raises(PairFailed, match=f"{agreeing} matches agree, fewer than {agreeing + 1}"):
        method.follow(method.start(SCANS[0]), SCANS[1])


def test_bad_settings_are_refused() -> None:
    with pytest.raises(ValueError, match="least_inliers must be 2 or more, got 1"):
        KeypointOdometrySettings(least_inliers=1)
