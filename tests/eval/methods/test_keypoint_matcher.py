"""Motions between scans come out of their keypoints, at any heading, and do not where there is nothing."""

import math
from dataclasses import replace
from functools import cache

import numpy as np
import pytest

from echoscape.eval.methods.graph_matching import most_alike
from echoscape.eval.methods.keypoint_matcher import KeypointMatcher, MatcherSettings, ScanMatch
from echoscape.eval.methods.registry import EXTRACTORS
from echoscape.sim.datasets.polar_scan import PolarScan
from echoscape.sim.datasets.scan_folder import open_folder
from echoscape.sim.datasets.se2 import transform
from tests.eval.drives import landmarks, scan_of
from tests.paths import SHARED


@cache
def seen_after(*motion: float) -> PolarScan:
    x, y, yaw = motion
    return scan_of(landmarks(count=100), (x, y, yaw))


START = seen_after(0.0, 0.0, 0.0)
LATER = seen_after(2.5, -0.3, 0.0)
NAMES = pytest.mark.parametrize("name", ["cen2018", "cen2019"])


def matched(name: str, earlier: PolarScan, later: PolarScan) -> ScanMatch:
    matcher = KeypointMatcher(EXTRACTORS[name]())
    return matcher.match(matcher.describe(earlier), matcher.describe(later))


@NAMES
@pytest.mark.parametrize("motion", [(0.0, 0.0, 0.0), (2.5, -0.3, 0.0), (6.0, 0.4, math.radians(-5))])
def test_known_motions_come_out(name: str, motion: tuple[float, float, float]) -> None:
    found = matched(name, START, seen_after(*motion))
    # An azimuth is 0.9 deg wide, 0.9 m at 60 m; some hundred matches average over it.
    np.testing.assert_allclose(found.motion.array[:2], motion[:2], atol=0.1)
    assert abs(found.motion.yaw_rad - motion[2]) < math.radians(0.2)
    assert found.inliers.mean() > 0.6


@NAMES
@pytest.mark.parametrize("azimuths", [90, 200])
def test_a_rotated_scan_gives_the_same_motion_at_another_heading(name: str, azimuths: int) -> None:
    plain = matched(name, START, LATER)
    rotated = matched(name, START, replace(LATER, codes=np.roll(LATER.codes, azimuths, axis=0)))
    expected_rad = plain.motion.yaw_rad - azimuths * 2 * math.pi / 400
    difference = math.remainder(rotated.motion.yaw_rad - expected_rad, 2 * math.pi)
    assert difference == pytest.approx(0, abs=1e-3)
    np.testing.assert_allclose(rotated.motion.array[:2], plain.motion.array[:2], atol=0.05)


@NAMES
def test_the_same_scans_give_the_same_motion(name: str) -> None:
    first, second = matched(name, START, LATER), matched(name, START, LATER)
    assert first.motion == second.motion
    np.testing.assert_array_equal(first.inliers, second.inliers)


@NAMES
def test_matches_lead_from_scan_to_scan_once_each(name: str) -> None:
    matcher = KeypointMatcher(EXTRACTORS[name]())
    earlier, later = matcher.describe(START), matcher.describe(LATER)
    found = matcher.match(earlier, later)
    assert len(set(found.later.tolist())) == len(found.later) == len(found.earlier)
    a = earlier.keypoints.points_m[found.earlier[found.inliers]]
    b = later.keypoints.points_m[found.later[found.inliers]]
    # Inliers are within 0.35 m of the sample's motion, which the fit improves on.
    assert np.abs(a - b - [2.5, -0.3]).max() < 1.5


def test_the_range_offset_moves_all_keypoints() -> None:
    plain, offset = (KeypointMatcher(EXTRACTORS["cen2018"](), range_offset_m=m) for m in (0.0, -0.31))
    ranges = [matcher.describe(START).keypoints.range_m for matcher in (plain, offset)]
    np.testing.assert_allclose(ranges[1], ranges[0] - 0.31)


def test_at_most_so_many_keypoints_are_matched() -> None:
    matcher = KeypointMatcher(EXTRACTORS["cen2018"](), MatcherSettings(most_keypoints=100))
    few, many = (matcher.describe(START), KeypointMatcher(EXTRACTORS["cen2018"]()).describe(START))
    assert len(few.keypoints) == len(few.descriptors) == 100 < len(many.keypoints)
    assert few.keypoints.score.min() >= np.sort(many.keypoints.score)[-100]


@NAMES
def test_scans_without_keypoints_are_refused(name: str) -> None:
    empty = replace(START, codes=np.zeros_like(START.codes))
    for pair in ((START, empty), (empty, START)):
        with pytest.raises(ValueError, match="a scan has no keypoints"):
            matched(name, *pair)


@pytest.mark.parametrize(("name", "value"), [("tolerance_m", 0.0), ("most_keypoints", 1)])
def test_bad_settings_are_refused(name: str, value: float) -> None:
    with pytest.raises(ValueError, match=f"{name} must be"):
        MatcherSettings(**{name: value})  # pyright: ignore[reportArgumentType]


@NAMES
def test_a_real_pair(name: str) -> None:
    pair = SHARED / "real" / "oxford-pair"
    if not pair.is_dir():
        pytest.skip("needs real scans in shared/real/oxford-pair beside the checkout")
    folder = open_folder(pair)
    truth = folder.motion()
    assert truth is not None
    found = matched(name, folder.read(0), folder.read(1))
    # The reference itself is off by some 0.03 m; the public implementation by 0.07 m and 0.09 deg a pair.
    assert math.hypot(*(found.motion.array[:2] - truth[0, :2])) < 0.1
    assert abs(found.motion.yaw_rad - truth[0, 3]) < math.radians(0.15)
    assert found.inliers.sum() > 300
    assert found.inliers.mean() > 0.7


@pytest.mark.parametrize(("name", "share"), [("cen2018", 0.43), ("cen2019", 0.53)])
def test_descriptors_lead_to_the_right_place_in_a_real_pair(name: str, share: float) -> None:
    pair = SHARED / "real" / "oxford-pair"
    if not pair.is_dir():
        pytest.skip("needs real scans in shared/real/oxford-pair beside the checkout")
    matcher = KeypointMatcher(EXTRACTORS[name]())
    earlier, later = (matcher.describe(scan) for scan in open_folder(pair))
    target = most_alike(earlier.descriptors, later.descriptors)
    motion = matcher.match(earlier, later).motion
    moved = transform(motion.array, later.keypoints.points_m[target])
    off_m = np.linalg.norm(moved - earlier.keypoints.points_m, axis=1)
    assert (off_m < 0.5).mean() == pytest.approx(share, abs=0.015)
