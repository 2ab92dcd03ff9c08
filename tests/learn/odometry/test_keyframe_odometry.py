"""Odometry over a drive: what every image shows, keyframes, and what a bias does without them."""

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace
from itertools import pairwise
from typing import Any, cast

import numpy as np
import pytest
import torch
from numpy.testing import assert_allclose
from torch import Tensor

from echoscape.learn.data.image_settings import ImageSettings
from echoscape.learn.geometry.matches import Matches
from echoscape.learn.geometry.motion_compensation import Part, ScanMotionModel
from echoscape.learn.geometry.se2 import transform
from echoscape.learn.model.local_matching import Near
from echoscape.learn.model.model_settings import ModelSettings
from echoscape.learn.odometry.keyframe_odometry import ROBUST_PAIRS, KeyframeOdometry, OdometryConfig
from echoscape.learn.odometry.pair_estimate import PairEstimate
from echoscape.learn.odometry.scan_matcher import ScanFeatures, ScanMatcher
from echoscape.learn.training.checkpoint import initial_model
from echoscape.sim.datasets.polar_scan import PolarScan
from echoscape.sim.datasets.se2 import IDENTITY, SE2

GAP_S = 0.25
MODEL = initial_model(ModelSettings(image=ImageSettings(size=80)), seed=0)


def spots() -> Tensor:
    """Places (1, 40, 2) around the drive, forward, right [m] in the frame of its start."""
    return torch.from_numpy(np.random.default_rng(2).uniform(-60, 60, (1, 40, 2))).float()


class Seeing(ScanMatcher):
    """A matcher that knows where the spots are, by the number in a scan's codes.

    bias: by what part its matches are pulled to the keypoint's own place in the image; blind: scans whose
    matches have no weight; `renderings` has the number and the pose of every image that was made.
    """

    def __init__(self, poses: Sequence[SE2], *, bias: float = 0.0, blind: Sequence[int] = ()) -> None:
        super().__init__(MODEL)
        self.poses, self.bias, self.blind = poses, bias, blind
        self.renderings: list[tuple[int, SE2]] = []
        self.search_sigmas_m: list[float | None] = []
        self.scan_motions: list[ScanMotionModel | None] = []
        self.parts: list[Sequence[Part]] = []

    def _solve(self, parts: Sequence[Part], scan_motion: ScanMotionModel | None = None) -> PairEstimate:
        self.parts.append(parts)
        self.scan_motions.append(scan_motion)
        return super()._solve(parts, scan_motion)

    def features(self, scan: PolarScan, *, rendered_at: SE2 = IDENTITY) -> ScanFeatures:
        return self._features(scan.codes, scan.first_azimuth_rad, rendered_at)

    def _features(self, cells: np.ndarray, first_rad: float, rendered_at: SE2) -> ScanFeatures:
        number = int(cells[0, 0])
        self.renderings.append((number, rendered_at))
        nothing = cast(Any, None)
        return ScanFeatures(
            keypoints=nothing,
            destination=nothing,
            cells=cells,
            first_rad=first_rad,
            rendered_at=rendered_at,
        )

    def match(
        self, source: ScanFeatures, destination: ScanFeatures, *, search_sigma_m: float | None = None
    ) -> Matches:
        self.search_sigmas_m.append(search_sigma_m)
        first, second = number_of(source), number_of(destination)
        there = transform(self.poses[first].inverse(), spots())
        here = transform(self.poses[second].inverse(), spots())
        # In images: the match is pulled from the true place to the one at which the source shows the spot.
        true, rendered = transform(destination.rendered_at, here), transform(source.rendered_at, there)
        pulled = transform(destination.rendered_at.inverse(), true + self.bias * (rendered - true))
        weights = torch.full(there.shape[:2], 0.0 if first in self.blind else 1.0)
        return Matches(source_m=there, destination_m=pulled, weights=weights)


def number_of(features: ScanFeatures) -> int:
    return int(features.cells[0, 0])


def scan(number: int, *, middle_s: float | None = None, scan_s: float = 0.25) -> PolarScan:
    """Return a scan of 4 azimuths whose codes are its number, timed around mid-scan."""
    middle_us = 1e9 + 1e6 * (number * GAP_S if middle_s is None else middle_s)
    return PolarScan(
        codes=np.full((4, 4), number, np.uint8),
        timestamp_us=np.rint(middle_us + 1e6 * scan_s / 4 * (np.arange(4) - 1.5)).astype(np.int64),
        encoder=np.arange(4, dtype=np.uint16),
        valid=np.ones(4, bool),
        bin_m=0.1,
    )


def chained(motions: Sequence[SE2]) -> list[SE2]:
    poses = [IDENTITY]
    for motion in motions:
        poses.append(poses[-1] @ motion)
    return poses


def drive(count: int = 60) -> list[SE2]:
    """Poses of a drive that gathers speed, bends to the right, and slows down."""
    return chained(
        [
            SE2(
                x_m=2 * math.sin(math.pi * k / count) ** 2,
                y_m=0.0,
                yaw_rad=0.08 * math.sin(math.pi * k / count) ** 2,
            )
            for k in range(count)
        ]
    )


def followed(seeing: Seeing, config: OdometryConfig | None = None) -> list[SE2]:
    """Return the poses (N + 1) that the motions add up to."""
    odometry = KeyframeOdometry(seeing, config)
    state, found = odometry.start(scan(0)), [IDENTITY]
    for number in range(1, len(seeing.poses)):
        estimate, state = odometry.follow(state, scan(number))
        found.append(found[-1] @ estimate.motion)
    return found


@dataclass(frozen=True)
class End:
    """How far off the last pose is, [m] and [rad]."""

    metres: float
    radians: float


def end(found: list[SE2], true: list[SE2]) -> End:
    off = true[-1].inverse() @ found[-1]
    return End(off.length_m, abs(off.yaw_rad))


@pytest.mark.parametrize("config", [None, ROBUST_PAIRS])
def test_exact_matches_give_exact_motions(config: OdometryConfig | None) -> None:
    poses = drive()
    found = followed(Seeing(poses), config)
    for pose, true in zip(found, poses, strict=True):
        assert_allclose([pose.x_m, pose.y_m, pose.yaw_rad], [true.x_m, true.y_m, true.yaw_rad], atol=1e-4)


def test_a_lean_towards_where_things_have_been_shortens_pairs_but_hardly_what_is_followed() -> None:
    poses = drive()
    alone = end(followed(Seeing(poses, bias=0.1), ROBUST_PAIRS), poses)
    kept = end(followed(Seeing(poses, bias=0.1)), poses)
    steps = [pose.inverse() @ after for pose, after in pairwise(poses)]
    turned = sum(abs(step.yaw_rad) for step in steps)
    assert alone.radians == pytest.approx(0.1 * turned, rel=0.1)  # a tenth of every turn is lost
    assert kept.radians < alone.radians / 10
    assert alone.metres > 0.05 * sum(step.length_m for step in steps)
    assert kept.metres < alone.metres / 10


def test_a_scan_is_rendered_where_constant_velocity_leads() -> None:
    steady = SE2(x_m=1.5, y_m=0.1, yaw_rad=0.01)
    seeing = Seeing(chained([steady] * 5))
    followed(seeing)
    rendered = dict(seeing.renderings)
    for number in (2, 3, 4, 5):
        true = seeing.poses[number]
        at = rendered[number]
        assert_allclose([at.x_m, at.y_m, at.yaw_rad], [true.x_m, true.y_m, true.yaw_rad], atol=1e-3)


def test_scans_after_a_longer_gap_are_rendered_farther() -> None:
    seeing = Seeing(chained([SE2(x_m=1.0, y_m=0.0, yaw_rad=0.0)] * 3))
    odometry = KeyframeOdometry(seeing)
    _, state = odometry.follow(odometry.start(scan(0)), scan(1))
    odometry.follow(state, scan(3, middle_s=3 * GAP_S))
    assert seeing.renderings[-1][1].x_m == pytest.approx(3.0, abs=1e-3)
    odometry.follow(state, scan(2, middle_s=GAP_S))  # times that stand still: as long as before
    assert seeing.renderings[-1][1].x_m == pytest.approx(2.0, abs=1e-3)


def test_a_pair_beyond_the_innovation_gate_is_matched_again_at_the_motion_found() -> None:
    seeing = Seeing(chained([SE2(x_m=2.0, y_m=0.0, yaw_rad=0.0)] * 2), bias=0.2)
    odometry = KeyframeOdometry(seeing)
    first, _ = odometry.follow(odometry.start(scan(0)), scan(1))
    assert [number for number, _ in seeing.renderings] == [0, 1, 1]
    assert seeing.renderings[1][1] == IDENTITY
    assert seeing.renderings[2][1].x_m == pytest.approx(1.6, abs=1e-3)  # a fifth too short
    assert first.motion.x_m == pytest.approx(1.92, abs=1e-3)


def test_keyframes_come_where_the_last_is_out_of_reach() -> None:
    seeing = Seeing(chained([SE2(x_m=1.0, y_m=0.0, yaw_rad=0.0)] * 9))
    followed(seeing, OdometryConfig(keyframe_m=3.5, innovation_gate_m=math.inf))
    # Scans 0 to 4 are rendered in the frame of 0; 4, out of reach, upright again before 5; 8 before 9.
    assert [number for number, _ in seeing.renderings] == [0, 1, 2, 3, 4, 4, 5, 6, 7, 8, 8, 9]
    upright = [number for number, at in seeing.renderings if at == IDENTITY]
    assert upright == [0, 1, 4, 8]
    turning = Seeing(chained([SE2(x_m=0.0, y_m=0.0, yaw_rad=0.1)] * 4))
    followed(turning, OdometryConfig(keyframe_rad=0.15, innovation_gate_rad=math.inf))
    assert [number for number, _ in turning.renderings] == [0, 1, 2, 2, 3, 4]


@pytest.mark.parametrize("motion", [SE2(x_m=30.0, y_m=0.0, yaw_rad=0.0), SE2(x_m=0.0, y_m=0.0, yaw_rad=0.6)])
def test_a_motion_too_fast_for_a_car_is_not_expected_again(motion: SE2) -> None:
    seeing = Seeing(chained([motion, IDENTITY]))
    followed(seeing)
    assert seeing.renderings[-1][1] == IDENTITY
    assert seeing.search_sigmas_m[-1] is None


def test_a_turn_beyond_the_innovation_gate_is_matched_again_too() -> None:
    seeing = Seeing(chained([SE2(x_m=0.0, y_m=0.0, yaw_rad=0.1)]))
    followed(seeing)
    assert [number for number, _ in seeing.renderings] == [0, 1, 1]


def test_the_first_keyframe_has_the_velocity_of_the_first_motion() -> None:
    """From a stand: later scans are faster, but the keyframe is from a stand."""
    seeing = Seeing(chained([SE2(x_m=0.2 * k, y_m=0.0, yaw_rad=0.0) for k in range(8)]))
    followed(seeing, OdometryConfig(innovation_gate_m=math.inf))
    assert seeing.parts[-1][0].twist is not None
    assert_allclose(seeing.parts[-1][0].twist.velocity_mps, [[0, 0]], atol=1e-3)


@pytest.mark.parametrize("share", [0.0, 1.0])
def test_the_second_match_counts_only_with_precision(share: float) -> None:
    """Without precision in any direction the first match stands."""

    class Vague(Seeing):
        def match(
            self, source: ScanFeatures, destination: ScanFeatures, *, search_sigma_m: float | None = None
        ) -> Matches:
            found = super().match(source, destination, search_sigma_m=search_sigma_m)
            if search_sigma_m is None:
                return found
            off = found.destination_m + torch.tensor([4.0 * (1 - share), 0.0])
            precision = share * torch.eye(2).expand(*off.shape, 2)
            return replace(found, destination_m=off, precision=precision)

    seeing = Vague(chained([SE2(x_m=2.0, y_m=0.0, yaw_rad=0.0)]))
    odometry = KeyframeOdometry(seeing)
    found, _ = odometry.follow(odometry.start(scan(0)), scan(1))
    assert len(seeing.renderings) == 3
    assert found.certain
    assert found.motion.x_m == pytest.approx(2.0, abs=1e-3)


def test_a_second_match_that_disagrees_is_not_taken() -> None:
    class Dim(Seeing):
        """Half of the matches of the second time are wrong."""

        def match(
            self, source: ScanFeatures, destination: ScanFeatures, *, search_sigma_m: float | None = None
        ) -> Matches:
            found = super().match(source, destination, search_sigma_m=search_sigma_m)
            if source.rendered_at.x_m > 1:
                found.destination_m[:, ::2, 1] += 9
                found.destination_m[:, 1::2, 0] -= 1
            return found

    found = followed(Dim(chained([SE2(x_m=2.0, y_m=0.0, yaw_rad=0.0)])))
    assert found[-1].x_m == pytest.approx(2.0, abs=1e-3)


def test_the_timing_of_a_pair_is_that_of_its_scans() -> None:
    seeing = Seeing(drive(4))
    odometry = KeyframeOdometry(seeing, doppler_beta_s=0.05)
    odometry.follow(odometry.start(scan(0)), scan(1, scan_s=0.2))
    (found,) = seeing.scan_motions
    assert found is not None
    assert (found.scan_s, found.doppler_beta_s, found.gap_s) == pytest.approx((0.2, 0.05, GAP_S))
    assert found.seam_rad == pytest.approx(-math.pi / 4)  # half of the four azimuths' step before ahead


def test_a_keyframe_keeps_the_velocity_of_its_scan() -> None:
    motion = SE2(x_m=1.0, y_m=0.0, yaw_rad=0.0)
    seeing = Seeing(chained([motion] * 6))
    followed(seeing, OdometryConfig(keyframe_m=2.5, innovation_gate_m=math.inf))
    first, *_, last = (parts for parts in seeing.parts if len(parts) == 2)
    assert first[0].twist is not None  # that of the first motion, for nothing led to it
    assert_allclose(first[0].twist.velocity_mps, [[1 / GAP_S, 0]], atol=1e-3)
    assert last[0].twist is not None
    assert_allclose(last[0].twist.velocity_mps, [[1 / GAP_S, 0]], atol=1e-3)
    assert last[1].twist is None


def test_matches_with_the_keyframe_count_by_their_weight() -> None:
    """A bias of the matches with the scan before accumulates less, the more the keyframe counts."""

    class Leaning(Seeing):
        def match(
            self, source: ScanFeatures, destination: ScanFeatures, *, search_sigma_m: float | None = None
        ) -> Matches:
            found = super().match(source, destination, search_sigma_m=search_sigma_m)
            if number_of(destination) == number_of(source) - 1:
                found.destination_m[..., 1] += 0.02
            return found

    straight = chained([SE2(x_m=1.0, y_m=0.0, yaw_rad=0.0)] * 12)
    off = []
    for weight in (1.0, 3.0, 10.0):
        seeing = Leaning(straight)
        config = OdometryConfig(keyframe_weight=weight, keyframe_m=50.0)
        off.append(end(followed(seeing, config), straight).metres)
        assert [part.weight for part in seeing.parts[-1]] == [weight, 1.0]
    assert off[0] > 1.8 * off[1] > 4 * off[2] > 0


def test_matches_are_searched_locally_once_a_motion_is_expected() -> None:
    # The first pair is matched twice, as nothing was expected; then there is an expectation.
    seeing = Seeing(chained([SE2(x_m=2.0, y_m=0.0, yaw_rad=0.0)] * 2))
    followed(seeing, OdometryConfig(search_sigma_m=1.25))
    assert seeing.search_sigmas_m == [None, 1.25, 1.25, 1.25]
    alone = Seeing(chained([SE2(x_m=2.0, y_m=0.0, yaw_rad=0.0)] * 2))
    followed(alone, ROBUST_PAIRS)
    assert alone.search_sigmas_m == [None, None]


def test_pairs_alone_have_the_estimates_of_the_matcher() -> None:
    poses = drive(10)
    seeing = Seeing(poses, bias=0.3)
    odometry = KeyframeOdometry(seeing, ROBUST_PAIRS)
    state = odometry.start(scan(0))
    for number in range(1, len(poses)):
        found, state = odometry.follow(state, scan(number))
        source, destination = (seeing.features(scan(each)) for each in (number, number - 1))
        assert found.motion == seeing.estimate(source, destination).motion


def test_matches_are_those_with_the_scan_before() -> None:
    poses = drive()
    odometry = KeyframeOdometry(Seeing(poses))
    state = odometry.start(scan(0))
    for number in range(1, 29):
        _, state = odometry.follow(state, scan(number))
    found, _ = odometry.follow(state, scan(29))
    assert_allclose(found.destination_m, transform(poses[28].inverse(), spots())[0], atol=1e-4)
    assert_allclose(found.source_m, transform(poses[29].inverse(), spots())[0], atol=1e-4)


def test_a_scan_without_matches_leaves_the_motion_open() -> None:
    odometry = KeyframeOdometry(Seeing(drive(), blind=[1]))
    found, _ = odometry.follow(odometry.start(scan(0)), scan(1))
    assert not found.certain


@pytest.mark.parametrize("times", [{"middle_s": 0.0}, {"scan_s": 0.0}])
def test_times_without_a_velocity_leave_points_as_measured_with_a_warning(
    times: dict[str, float], caplog: pytest.LogCaptureFixture
) -> None:
    seeing = Seeing(drive(4))
    odometry = KeyframeOdometry(seeing, doppler_beta_s=0.05)
    found, state = odometry.follow(odometry.start(scan(0)), scan(1, **times))
    assert seeing.scan_motions == [None]
    assert "points as measured" in caplog.text
    assert found.certain
    odometry.follow(state, scan(2))  # and the drive goes on


@pytest.mark.parametrize("name", list(vars(OdometryConfig())))
def test_config_out_of_its_range_is_refused(name: str) -> None:
    with pytest.raises(ValueError, match=f"{name} must be 0 or more, got nan"):
        replace(OdometryConfig(), **{name: math.nan})


def test_no_place_at_all_to_look_at_is_refused() -> None:
    with pytest.raises(ValueError, match="keyframe_weight must be above 0"):
        OdometryConfig(keyframe_weight=0.0)
    with pytest.raises(ValueError, match="search_sigma_m must be above 0"):
        OdometryConfig(search_sigma_m=0.0)
    with pytest.raises(ValueError, match="deviation_px must be finite and above 0"):
        Near(places_px=torch.zeros(1, 1, 2), deviation_px=0.0)
