"""The whole model: motions from ideal descriptors, heads that can be left out, inference as in training."""

import math
from dataclasses import replace
from functools import partial

import numpy as np
import pytest
import torch
from numpy.testing import assert_allclose
from torch import Tensor

from echoscape.learn.data.image import image_of_codes
from echoscape.learn.data.image_settings import ImageSettings
from echoscape.learn.geometry.matches import Matches
from echoscape.learn.geometry.motion_compensation import Part
from echoscape.learn.geometry.procrustes import Motion, moved, rotation_of_yaw
from echoscape.learn.geometry.se2 import to_motion, transform
from echoscape.learn.model.device import fast_dtype
from echoscape.learn.model.fast_keypoint_model import FastKeypointModel, Matching, destination_of
from echoscape.learn.model.keypoint_model import CHANNELS, Maps, dense_descriptors
from echoscape.learn.model.keypoints import keypoints_at
from echoscape.learn.model.model_settings import ModelSettings
from echoscape.learn.model.pixel_coords import pixels_of_metres
from echoscape.learn.odometry.scan_matcher import MatcherConfig, ScanMatcher, folded, fast_config
from echoscape.learn.training.checkpoint import initial_model
from echoscape.sim.datasets.polar_scan import PolarScan
from echoscape.sim.datasets.se2 import IDENTITY, SE2
from tests.learn.folders import BIN_M

SIZE, PIXEL_M = 80, 1.5
# At T = 300 the ideal descriptors below make peaks of 1.5 px: wide enough for every second pixel.
SETTINGS = ModelSettings(image=ImageSettings(pixel_m=PIXEL_M, size=SIZE), temperature=300.0)


def _ideal_maps(forward_m: float, right_m: float, yaw: float) -> Maps:
    """Maps whose descriptors tell each pixel's place in the world, seen from a pose, and nothing else."""
    offset = (torch.arange(SIZE) - (SIZE - 1) / 2) * PIXEL_M
    forward, right = -offset[:, None].expand(SIZE, SIZE), offset[None].expand(SIZE, SIZE)
    x = forward_m + math.cos(yaw) * forward - math.sin(yaw) * right
    y = right_m + math.sin(yaw) * forward + math.cos(yaw) * right
    waves = [(1.0, 0.0), (0.0, 1.0), (1.1, 1.3), (1.3, -1.1)]
    phases = [(u * x + v * y) * (2 * math.pi / 220) for u, v in waves]
    fine = torch.stack([each for phase in phases for each in (phase.cos(), phase.sin())])[None]
    coarse = [torch.zeros(1, count, SIZE >> level, SIZE >> level) for level, count in enumerate(CHANNELS)]
    return fine, *coarse[1:]


def _inner_points() -> Tensor:
    draws = np.random.default_rng(1).uniform(-25, 25, (1, 60, 2)).astype(np.float32)
    return pixels_of_metres(torch.from_numpy(draws), size=SIZE, pixel_m=PIXEL_M)


@pytest.mark.parametrize("yaw", [0.0, 0.4, math.pi / 2, -3.0])
@pytest.mark.parametrize("matching", [Matching(), Matching(stride=2)])
def test_ideal_descriptors_give_the_motion(yaw: float, matching: Matching) -> None:
    model = FastKeypointModel(SETTINGS)
    destination, source = (2.0, -3.0, 0.7), (2.0 + 5.3, -3.0 + 4.1, 0.7 + yaw)
    keypoints = keypoints_at(_inner_points(), _ideal_maps(*source), None)
    into = destination_of(_ideal_maps(*destination), None, matching)
    found = model.match(keypoints, into).motion()
    shift = complex(5.3, 4.1) * np.exp(-0.7j)  # forward + i right, in the destination's frame
    assert_allclose(found.translation_m[0], [shift.real, shift.imag], atol=0.02 * PIXEL_M)
    assert_allclose(math.remainder(float(found.yaw_rad) - yaw, 2 * math.pi), 0, atol=1e-3)


@pytest.mark.parametrize("stride", [1, 2])
def test_surprisal_is_the_cross_entropy_with_the_true_place(stride: int) -> None:
    """Least at the true motion, and what a softmax over all samples says there."""
    model, matching = FastKeypointModel(SETTINGS), Matching(stride=stride)
    destination, source = (2.0, -3.0, 0.7), (7.3, 1.1, 0.9)
    maps = _ideal_maps(*destination)
    keypoints = keypoints_at(_inner_points(), _ideal_maps(*source), None)
    into = destination_of(maps, None, matching)
    shift = complex(5.3, 4.1) * np.exp(-0.7j)
    truth = Motion(
        rotation=rotation_of_yaw(torch.tensor([0.2])),
        translation_m=torch.tensor([[shift.real, shift.imag]], dtype=torch.float32),
        certain=torch.ones(1, dtype=torch.bool),
    )
    back = Motion(rotation=truth.rotation.mT, translation_m=-truth.translation_m, certain=truth.certain)
    right, wrong = (
        model.match(keypoints, into, partial(moved, motion=each)).surprisal for each in (truth, back)
    )
    assert right is not None
    assert wrong is not None
    assert float(right.mean()) < 0.5 * float(wrong.mean())
    # One keypoint by hand: its true place, the four samples around it, and the plain softmax over all.
    place = pixels_of_metres(moved(model.metres(keypoints.points_px), truth), size=SIZE, pixel_m=PIXEL_M)[
        0, 0
    ]
    row, column = ((place + 0.5) / stride - 0.5).tolist()
    logits = 300 * (keypoints.descriptors[0, 0] @ into.pyramid.descriptors()[0].flatten(1))
    image = logits.view(into.pyramid.descriptors().shape[-2:])
    i, j = int(row), int(column)
    u, v = row - i, column - j
    around = (1 - u) * ((1 - v) * image[i, j] + v * image[i, j + 1])
    around = around + u * ((1 - v) * image[i + 1, j] + v * image[i + 1, j + 1])
    assert_allclose(right[0, 0], logits.logsumexp(0) - around, atol=2e-3)


def test_what_is_looked_for_near_its_place_is_found_as_if_it_were_not() -> None:
    """Ideal descriptors: places are where they truly are, and precisions are told."""
    model, matching = FastKeypointModel(SETTINGS), Matching()
    maps, off = _ideal_maps(0.0, 0.0, 0.0), torch.tensor([0.5, -0.4])
    points = _inner_points()
    keypoints = replace(keypoints_at(points, maps, None), points_px=points + off)  # expected a little off
    into = destination_of(maps, None, matching)
    found = model.match(keypoints, into, search_sigma_m=3 * PIXEL_M)
    assert model.match(keypoints, into).precision is None
    assert found.precision is not None
    assert float(found.precision.diagonal(dim1=-2, dim2=-1).min()) > 0.15
    far = torch.linalg.vector_norm(found.destination_m - model.metres(points), dim=-1)
    pulled = torch.linalg.vector_norm(model.metres(points + off) - model.metres(points), dim=-1)
    assert float(far.median()) < 0.1 * float(pulled.median())
    truth = SE2(x_m=float(off[0]) * PIXEL_M, y_m=-float(off[1]) * PIXEL_M, yaw_rad=0.0)
    assert float(found.errors_m(to_motion(truth)).median()) < 0.05 * PIXEL_M


def test_places_outside_the_destination_surprise_nobody() -> None:
    model, matching = FastKeypointModel(SETTINGS), Matching(stride=2)
    maps = _ideal_maps(0.0, 0.0, 0.0)
    away = Motion(
        rotation=rotation_of_yaw(torch.tensor([0.0])),
        translation_m=torch.tensor([[500.0, 0.0]]),
        certain=torch.ones(1, dtype=torch.bool),
    )
    keypoints = keypoints_at(_inner_points(), maps, None)
    found = model.match(keypoints, destination_of(maps, None, matching), partial(moved, motion=away))
    assert found.surprisal is not None
    assert bool((found.surprisal == 0).all())


def test_the_quick_way_is_robust_and_searches_between_pixels() -> None:
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
    """Drawn codes (400, 3768) with something everywhere, so that no two places look alike."""
    blocks = np.random.default_rng(6).integers(0, 130, (80, 157), np.uint8)
    return blocks.repeat(5, 0).repeat(24, 1)


def _used_to(codes: np.ndarray, settings: ModelSettings) -> FastKeypointModel:
    """Return an untrained model whose normalisations know a scan, so that all maps are of like strength."""
    model = initial_model(settings, seed=5)
    for part in model.modules():
        if isinstance(part, torch.nn.BatchNorm2d):
            part.momentum = 1.0
    with torch.no_grad():
        model.train().features(image_of_codes(codes, BIN_M, settings.image)[None])
    return model


def _picture(seed: int = 1) -> Tensor:
    return torch.rand((1, 1, SIZE, SIZE), generator=torch.Generator().manual_seed(seed))


@pytest.mark.parametrize("location_head", [True, False])
@pytest.mark.parametrize("score_head", [True, False])
def test_heads_can_be_left_out(location_head: bool, score_head: bool) -> None:
    settings = ModelSettings(image=SETTINGS.image, location_head=location_head, score_head=score_head)
    model = initial_model(settings, seed=1).eval()
    found = model.features(_picture())
    assert found.keypoints.points_px.shape == (1, 400, 2)
    centres = (found.keypoints.points_px[0, :20, 1] - (torch.arange(20) * 4 + 1.5)).abs().max()
    assert (centres == 0) == (not location_head)
    assert bool((found.keypoints.scores == 1).all()) == (not score_head)
    motion = model.train()(_picture(1), _picture(2), Matching(), torch.float32).motion()
    motion.translation_m.sum().backward()
    assert all(each.grad is not None and bool(each.grad.isfinite().all()) for each in model.parameters())


def test_keypoints_are_made_in_float32_of_a_bfloat16_network() -> None:
    model = initial_model(SETTINGS, seed=1).eval()
    found = model.features(_picture(), torch.bfloat16)
    points = found.keypoints.points_px
    assert points.dtype == torch.float32
    assert float((points - points.bfloat16()).detach().abs().max()) > 1e-4
    again = keypoints_at(points, found.maps, found.scores)
    assert torch.equal(found.keypoints.descriptors, again.descriptors)
    assert all(torch.equal(each, each.bfloat16().float()) for each in found.maps)


def test_training_sees_what_inference_sees() -> None:
    """Keypoints, scores and matches of a pair are those of two pictures by themselves."""
    model, matching = initial_model(SETTINGS, seed=1).eval(), Matching(stride=2)
    with torch.no_grad():
        found = model(_picture(1), _picture(2), matching, torch.float32)
        source, destination = model.features(_picture(1)), model.features(_picture(2))
        wanted = model.match(source.keypoints, destination_of(destination.maps, destination.scores, matching))
    for mine, theirs in (
        (found.source_m, wanted.source_m),
        (found.destination_m, wanted.destination_m),
        (found.weights, wanted.weights),
    ):
        assert_allclose(mine, theirs, rtol=1e-4, atol=1e-3)
    assert float((source.keypoints.scores - destination.keypoints.scores).abs().max()) > 1e-4


def test_a_network_that_has_come_to_no_number_says_so() -> None:
    """Not by an error of memory: training looks whether its loss is finite."""
    model = initial_model(SETTINGS, seed=1)
    with torch.no_grad():
        for name, value in model.named_parameters():
            if name == "locations.head.bias":
                value.fill_(math.nan)
    found = model(_picture(1), _picture(2), Matching(stride=2), torch.float32)
    assert bool(found.source_m.isnan().all())


def test_destinations_are_searched_as_they_are_told_to_be() -> None:
    matching = Matching(stride=2, dtype=torch.bfloat16)
    pyramid = destination_of(_ideal_maps(0, 0, 0), None, matching).pyramid
    assert (pyramid.stride, pyramid.dtype) == (matching.stride, matching.dtype)


def test_folding_normalisation_into_convolutions_changes_rounding_alone() -> None:
    model = initial_model(SETTINGS, seed=3)
    with torch.no_grad():
        model.train().maps(_picture(4) * 3)  # statistics that are not 0 and 1
    plain = dense_descriptors(model.eval().encoder(_picture()))
    assert_allclose(dense_descriptors(folded(model).encoder(_picture())), plain.detach(), atol=2e-4)


def test_a_scan_matched_with_itself_has_not_moved() -> None:
    # Without location head: keypoints at the same places, each found at its own pixel by a sharp softmax.
    settings = ModelSettings(image=SETTINGS.image, temperature=5000.0, location_head=False)
    matcher = ScanMatcher(_used_to(_codes(), settings), MatcherConfig(robust=False))
    codes = _codes()
    scan = matcher.features(scan_of_codes(codes))
    same = matcher.estimate(scan, scan)
    # Neighbouring pixels look alike to a network that has learned nothing: 0.03 px.
    assert_allclose([same.motion.x_m, same.motion.y_m, same.motion.yaw_rad], 0, atol=0.03 * PIXEL_M)
    assert same.certain
    assert matcher.embedding(scan).shape == (248,)


def test_headings_find_a_source_that_was_turned() -> None:
    settings = ModelSettings(image=SETTINGS.image, temperature=3000.0, location_head=False, score_head=False)
    matcher = ScanMatcher(_used_to(_codes(), settings), MatcherConfig(robust=False))
    codes = _codes()
    source, destination = (matcher.features(scan_of_codes(each)) for each in (np.roll(codes, -100, 0), codes))
    found = matcher.estimate_any_heading(source, destination, headings=4).motion
    # What stood right (row 100) stands ahead: the car has turned right by a quarter.
    assert_allclose([found.x_m, found.y_m, found.yaw_rad], [0, 0, math.pi / 2], atol=0.03 * PIXEL_M)
    with pytest.raises(ValueError, match="headings must be 1 or more, got 0"):
        matcher.estimate_any_heading(source, destination, headings=0)


def test_precisions_are_told_in_the_destinations_own_frame(monkeypatch: pytest.MonkeyPatch) -> None:
    """A picture shows its scan turned by 30 deg; what is said ahead in it is 30 deg to the scan's left."""
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


def test_precisions_by_row_are_told_forward(monkeypatch: pytest.MonkeyPatch) -> None:
    model = FastKeypointModel(SETTINGS)
    maps = _ideal_maps(0.0, 0.0, 0.0)
    keypoints = keypoints_at(_inner_points(), maps, None)
    down_right = torch.tensor([[0.5, 0.4], [0.4, 0.5]]).expand(1, 60, 2, 2)
    monkeypatch.setattr(
        "echoscape.learn.model.fast_keypoint_model.remove_prior",
        lambda *_: (keypoints.points_px, down_right),
    )
    found = model.match(keypoints, destination_of(maps, None, Matching()), search_sigma_m=1.0).precision
    assert found is not None
    assert_allclose(found[0, 0], [[0.5, -0.4], [-0.4, 0.5]])


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


def test_true_places_are_not_asked_for_with_an_expectation() -> None:
    model, maps = FastKeypointModel(SETTINGS), _ideal_maps(0.0, 0.0, 0.0)
    keypoints = keypoints_at(_inner_points(), maps, None)
    with pytest.raises(ValueError, match="true_places goes without search_sigma_m"):
        model.match(keypoints, destination_of(maps, None, Matching()), lambda x: x, search_sigma_m=1.0)


@pytest.mark.parametrize("size", [150, 100, 20])
def test_a_picture_of_any_size_has_its_cells_and_is_measured_alike(size: int) -> None:
    """What has no multiple of 16 and of the cells is seen with an empty margin about the same middle."""
    odd = ModelSettings(image=ImageSettings(pixel_m=PIXEL_M, size=size))
    wide = ModelSettings(image=ImageSettings(pixel_m=PIXEL_M, size=odd.side))
    assert odd.side == 80 * math.ceil(size / 80)
    models = [initial_model(each, seed=1).eval() for each in (odd, wide)]
    picture = torch.rand(1, 1, size, size, generator=torch.Generator().manual_seed(2))
    shown = torch.nn.functional.pad(picture, [(odd.side - size) // 2] * 4)
    with torch.no_grad():
        found, wanted = (model.features(each) for model, each in zip(models, (picture, shown), strict=True))
    assert found.keypoints.points_px.shape == (1, 400, 2)
    assert_allclose(models[0].metres(found.keypoints.points_px), models[1].metres(wanted.keypoints.points_px))
    codes = _codes()
    scan = ScanMatcher(models[0]).features(scan_of_codes(codes))
    motion = ScanMatcher(models[0]).estimate(scan, scan).motion
    assert math.isfinite(motion.length_m)


def test_matches_are_told_in_the_scans_own_frames_wherever_pictures_show_them() -> None:
    settings = ModelSettings(image=SETTINGS.image, temperature=3000.0, location_head=False, score_head=False)
    codes = _codes()
    matcher = ScanMatcher(_used_to(codes, settings), MatcherConfig(robust=False))
    there = SE2(x_m=6 * PIXEL_M, y_m=-3 * PIXEL_M, yaw_rad=math.pi / 2)
    source = matcher.features(scan_of_codes(np.roll(codes, -100, 0)))
    destination = matcher.features(scan_of_codes(codes), rendered_at=there)
    # Both show the world alike once the source, a quarter on, is shown a quarter further.
    quarter = SE2(x_m=0.0, y_m=0.0, yaw_rad=math.pi / 2)
    shown = matcher.rendered(source, there @ quarter)
    found = matcher.estimate(shown, destination).motion
    assert_allclose([found.x_m, found.y_m, found.yaw_rad], [0, 0, math.pi / 2], atol=0.1 * PIXEL_M)
    matches = matcher.match(shown, destination, search_sigma_m=PIXEL_M)
    off = torch.linalg.vector_norm(matches.destination_m - transform(quarter, matches.source_m), dim=-1)
    assert float(off.median()) < PIXEL_M


@pytest.mark.parametrize(
    ("wrong", "told"),
    [({"cells": 1}, "cells"), ({"cells": 400}, "cells"), ({"temperature": 0.0}, "temperature")],
)
def test_settings_that_make_no_model_are_refused(wrong: dict, told: str) -> None:
    with pytest.raises(ValueError, match=f"{told} must"):
        ModelSettings(**wrong)
