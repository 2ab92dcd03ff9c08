"""Matching of scans: motions, frames of matches and precisions, and models prepared for inference."""

import math
from dataclasses import replace

import numpy as np
import pytest
import torch
from numpy.testing import assert_allclose

from echoscape.learn.data.image import image_of_codes
from echoscape.learn.data.image_settings import ImageSettings
from echoscape.learn.geometry.matches import Matches
from echoscape.learn.geometry.motion_compensation import Part
from echoscape.learn.geometry.se2 import to_motion, transform
from echoscape.learn.model.device import fast_dtype
from echoscape.learn.model.fast_keypoint_model import FastKeypointModel
from echoscape.learn.model.keypoint_model import dense_descriptors
from echoscape.learn.model.model_settings import ModelSettings
from echoscape.learn.odometry.scan_matcher import MatcherConfig, ScanMatcher, fast_config, folded
from echoscape.learn.training.checkpoint import initial_model
from echoscape.sim.datasets.polar_scan import PolarScan
from echoscape.sim.datasets.se2 import IDENTITY, SE2
from tests.learn.folders import BIN_M
from tests.learn.maps import drawn_image

SIZE, PIXEL_M = 80, 1.5
# At T = 300 the ideal descriptors below make peaks of 1.5 px: wide enough for every second pixel.
SETTINGS = ModelSettings(image=ImageSettings(pixel_m=PIXEL_M, size=SIZE), temperature=300.0)


def test_the_fast_configuration_is_robust_with_one_sample_per_2_x_2_pixels() -> None:
    device = torch.device("cpu")
    found = fast_config(device)
    assert found.robust
    assert found.matching.stride == 2
    assert found.network_dtype == found.matching.dtype == fast_dtype(device)


def scan_of_codes(codes: np.ndarray) -> PolarScan:
    azimuths = len(codes)
    return PolarScan(
        codes=codes,
        timestamp_us=np.arange(azimuths, dtype=np.int64),
        encoder=np.arange(azimuths, dtype=np.uint16),
        valid=np.ones(azimuths, bool),
        bin_m=BIN_M,
    )


def _codes() -> np.ndarray:
    """Return drawn codes (400, 3768) in which no two places are alike."""
    blocks = np.random.default_rng(6).integers(0, 130, (80, 157), np.uint8)
    return blocks.repeat(5, 0).repeat(24, 1)


def _normalised_by(codes: np.ndarray, settings: ModelSettings) -> FastKeypointModel:
    """Return an untrained model whose normalisations have the statistics of a scan: all maps count."""
    model = initial_model(settings, seed=5)
    for part in model.modules():
        if isinstance(part, torch.nn.BatchNorm2d):
            part.momentum = 1.0
    with torch.no_grad():
        model.train().features(image_of_codes(codes, BIN_M, settings.image, first_rad=0.0)[None])
    return model


def test_folding_normalisation_into_convolutions_changes_rounding_alone() -> None:
    model = initial_model(SETTINGS, seed=3)
    with torch.no_grad():
        model.train().maps(drawn_image(SIZE, seed=4) * 3)  # statistics that are not 0 and 1
    plain = dense_descriptors(model.eval().encoder(drawn_image(SIZE)))
    assert_allclose(dense_descriptors(folded(model).encoder(drawn_image(SIZE))), plain.detach(), atol=2e-4)


def test_a_scan_matched_with_itself_has_not_moved() -> None:
    # Without location head: keypoints at the same places, each found at its own pixel by a sharp softmax.
    settings = ModelSettings(image=SETTINGS.image, temperature=5000.0, location_head=False)
    matcher = ScanMatcher(_normalised_by(_codes(), settings), MatcherConfig(robust=False))
    codes = _codes()
    scan = matcher.features(scan_of_codes(codes))
    same = matcher.estimate(scan, scan)
    # Descriptors of neighbouring pixels are much alike in an untrained network: 0.03 px.
    assert_allclose([same.motion.x_m, same.motion.y_m, same.motion.yaw_rad], 0, atol=0.03 * PIXEL_M)
    assert same.certain
    assert matcher.embedding(scan).shape == (248,)


def test_headings_find_a_source_that_was_turned() -> None:
    settings = ModelSettings(image=SETTINGS.image, temperature=3000.0, location_head=False, score_head=False)
    matcher = ScanMatcher(_normalised_by(_codes(), settings), MatcherConfig(robust=False))
    codes = _codes()
    source, destination = (matcher.features(scan_of_codes(each)) for each in (np.roll(codes, -100, 0), codes))
    found = matcher.estimate_any_heading(source, destination, headings=4).motion
    # What stood right (row 100) stands ahead: the car has turned right by a quarter.
    assert_allclose([found.x_m, found.y_m, found.yaw_rad], [0, 0, math.pi / 2], atol=0.03 * PIXEL_M)
    with pytest.raises(ValueError, match="headings must be 1 or more, got 0"):
        matcher.estimate_any_heading(source, destination, headings=0)


def test_precisions_are_in_the_frame_of_the_destination_scan(monkeypatch: pytest.MonkeyPatch) -> None:
    """The image has its scan turned by 30 deg: ahead in it is 30 deg to the scan's left."""
    settings = ModelSettings(image=SETTINGS.image, location_head=False, score_head=False)
    matcher = ScanMatcher(initial_model(settings, seed=0))
    there = SE2(x_m=1.0, y_m=0.0, yaw_rad=math.radians(30))
    source = matcher.features(scan_of_codes(_codes()))
    into = matcher.features(scan_of_codes(_codes()), rendered_at=there)
    ahead = Matches(
        source_m=torch.zeros(1, 1, 2),
        destination_m=torch.zeros(1, 1, 2),
        weights=torch.ones(1, 1),
        precision=torch.diag(torch.tensor([1.0, 0.0]))[None, None],
    )
    monkeypatch.setattr(FastKeypointModel, "match", lambda *_, **__: ahead)
    found = matcher.match(source, into, search_sigma_m=1.0).precision
    assert found is not None
    axis = torch.tensor([math.cos(math.radians(30)), -math.sin(math.radians(30))])
    assert_allclose(found[0, 0], axis[:, None] * axis, atol=1e-6)


def test_agreement_counts_parts_by_their_weight() -> None:
    matcher = ScanMatcher(initial_model(SETTINGS, seed=0), MatcherConfig(robust=True))
    points = torch.tensor([[[10.0, 0.0], [-8.0, 3.0], [0.0, 9.0]]])
    there = SE2(x_m=2.0, y_m=-1.0, yaw_rad=0.3)
    matches = Matches(
        source_m=points, destination_m=transform(there.inverse(), points), weights=torch.ones(1, 3)
    )
    parts = [
        Part(matches=replace(matches, destination_m=points), pose=to_motion(IDENTITY), weight=3.0),
        Part(matches=matches, pose=to_motion(there)),
    ]
    assert matcher._solve(parts).agreement == pytest.approx(12.0, rel=1e-4)


def test_matches_are_in_the_frames_of_the_scans_wherever_these_are_rendered() -> None:
    settings = ModelSettings(image=SETTINGS.image, temperature=3000.0, location_head=False, score_head=False)
    codes = _codes()
    matcher = ScanMatcher(_normalised_by(codes, settings), MatcherConfig(robust=False))
    there = SE2(x_m=6 * PIXEL_M, y_m=-3 * PIXEL_M, yaw_rad=math.pi / 2)
    source = matcher.features(scan_of_codes(np.roll(codes, -100, 0)))
    destination = matcher.features(scan_of_codes(codes), rendered_at=there)
    # Both images are alike once the source, a quarter turn on, is rendered a quarter turn further.
    quarter = SE2(x_m=0.0, y_m=0.0, yaw_rad=math.pi / 2)
    rendered = matcher.rendered(source, there @ quarter)
    found = matcher.estimate(rendered, destination).motion
    assert_allclose([found.x_m, found.y_m, found.yaw_rad], [0, 0, math.pi / 2], atol=0.1 * PIXEL_M)
    matches = matcher.match(rendered, destination, search_sigma_m=PIXEL_M)
    off = torch.linalg.vector_norm(matches.destination_m - transform(quarter, matches.source_m), dim=-1)
    assert float(off.median()) < PIXEL_M


@pytest.mark.parametrize("size", [150, 100, 20])
def test_scans_are_matched_by_images_of_any_size(size: int) -> None:
    settings = ModelSettings(image=ImageSettings(pixel_m=PIXEL_M, size=size))
    matcher = ScanMatcher(initial_model(settings, seed=1).eval())
    scan = matcher.features(scan_of_codes(_codes()))
    assert math.isfinite(matcher.estimate(scan, scan).motion.length_m)
