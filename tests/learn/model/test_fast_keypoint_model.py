"""The whole model: motions from ideal descriptors, heads that can be left out, inference as in training."""

import math
from dataclasses import replace
from functools import partial

import numpy as np
import pytest
import torch
from numpy.testing import assert_allclose

from echoscape.learn.data.image_settings import ImageSettings
from echoscape.learn.geometry.procrustes import Motion, moved, rotation_of_yaw
from echoscape.learn.geometry.se2 import to_motion
from echoscape.learn.model.fast_keypoint_model import FastKeypointModel, Matching, destination_of
from echoscape.learn.model.keypoint_model import Maps
from echoscape.learn.model.keypoints import keypoints_at
from echoscape.learn.model.model_settings import ModelSettings
from echoscape.learn.model.pixel_coords import pixels_of_metres
from echoscape.learn.training.checkpoint import initial_model
from echoscape.sim.datasets.se2 import SE2
from tests.learn.maps import drawn_image, ideal_maps, inner_points

SIZE, PIXEL_M = 80, 1.5
# At T = 300 the ideal descriptors below make peaks of 1.5 px: wide enough for every second pixel.
SETTINGS = ModelSettings(image=ImageSettings(pixel_m=PIXEL_M, size=SIZE), temperature=300.0)


def _ideal(forward_m: float, right_m: float, yaw: float) -> Maps:
    return ideal_maps(forward_m, right_m, yaw, size=SIZE, pixel_m=PIXEL_M)


@pytest.mark.parametrize("yaw", [0.0, 0.4, math.pi / 2, -3.0])
@pytest.mark.parametrize("matching", [Matching(), Matching(stride=2)])
def test_ideal_descriptors_give_the_motion(yaw: float, matching: Matching) -> None:
    model = FastKeypointModel(SETTINGS)
    destination, source = (2.0, -3.0, 0.7), (2.0 + 5.3, -3.0 + 4.1, 0.7 + yaw)
    keypoints = keypoints_at(inner_points(SIZE, pixel_m=PIXEL_M), _ideal(*source), None)
    into = destination_of(_ideal(*destination), None, matching)
    found = model.match(keypoints, into).motion()
    shift = complex(5.3, 4.1) * np.exp(-0.7j)  # forward + i right, in the destination's frame
    assert_allclose(found.translation_m[0], [shift.real, shift.imag], atol=0.02 * PIXEL_M)
    assert_allclose(math.remainder(float(found.yaw_rad) - yaw, 2 * math.pi), 0, atol=1e-3)


@pytest.mark.parametrize("stride", [1, 2])
def test_surprisal_is_the_cross_entropy_with_the_true_place(stride: int) -> None:
    """Least at the true motion, and there that of the softmax over all samples."""
    model, matching = FastKeypointModel(SETTINGS), Matching(stride=stride)
    destination, source = (2.0, -3.0, 0.7), (7.3, 1.1, 0.9)
    maps = _ideal(*destination)
    keypoints = keypoints_at(inner_points(SIZE, pixel_m=PIXEL_M), _ideal(*source), None)
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


def test_a_local_search_finds_true_places_although_others_are_expected() -> None:
    """With ideal descriptors, and each match has a precision."""
    model, matching = FastKeypointModel(SETTINGS), Matching()
    maps, off = _ideal(0.0, 0.0, 0.0), torch.tensor([0.5, -0.4])
    points = inner_points(SIZE, pixel_m=PIXEL_M)
    keypoints = replace(
        keypoints_at(points, maps, None), points_px=points + off
    )  # expected off by half a pixel
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


def test_places_outside_the_destination_have_no_surprisal() -> None:
    model, matching = FastKeypointModel(SETTINGS), Matching(stride=2)
    maps = _ideal(0.0, 0.0, 0.0)
    away = Motion(
        rotation=rotation_of_yaw(torch.tensor([0.0])),
        translation_m=torch.tensor([[500.0, 0.0]]),
        certain=torch.ones(1, dtype=torch.bool),
    )
    keypoints = keypoints_at(inner_points(SIZE, pixel_m=PIXEL_M), maps, None)
    found = model.match(keypoints, destination_of(maps, None, matching), partial(moved, motion=away))
    assert found.surprisal is not None
    assert bool((found.surprisal == 0).all())


@pytest.mark.parametrize("location_head", [True, False])
@pytest.mark.parametrize("score_head", [True, False])
def test_heads_can_be_left_out(location_head: bool, score_head: bool) -> None:
    settings = ModelSettings(image=SETTINGS.image, location_head=location_head, score_head=score_head)
    model = initial_model(settings, seed=1).eval()
    found = model.features(drawn_image(SIZE))
    assert found.keypoints.points_px.shape == (1, 400, 2)
    centres = (found.keypoints.points_px[0, :20, 1] - (torch.arange(20) * 4 + 1.5)).abs().max()
    assert (centres == 0) == (not location_head)
    assert bool((found.keypoints.scores == 1).all()) == (not score_head)
    motion = model.train()(
        drawn_image(SIZE, seed=1), drawn_image(SIZE, seed=2), Matching(), torch.float32
    ).motion()
    motion.translation_m.sum().backward()
    assert all(each.grad is not None and bool(each.grad.isfinite().all()) for each in model.parameters())


def test_keypoints_are_made_in_float32_of_a_bfloat16_network() -> None:
    model = initial_model(SETTINGS, seed=1).eval()
    found = model.features(drawn_image(SIZE), torch.bfloat16)
    points = found.keypoints.points_px
    assert points.dtype == torch.float32
    assert float((points - points.bfloat16()).detach().abs().max()) > 1e-4
    again = keypoints_at(points, found.maps, found.scores)
    assert torch.equal(found.keypoints.descriptors, again.descriptors)
    assert all(torch.equal(each, each.bfloat16().float()) for each in found.maps)


def test_training_and_inference_have_the_same_keypoints_scores_and_matches() -> None:
    """Those of a pair are those of its images by themselves."""
    model, matching = initial_model(SETTINGS, seed=1).eval(), Matching(stride=2)
    with torch.no_grad():
        found = model(drawn_image(SIZE, seed=1), drawn_image(SIZE, seed=2), matching, torch.float32)
        source, destination = (
            model.features(drawn_image(SIZE, seed=1)),
            model.features(drawn_image(SIZE, seed=2)),
        )
        wanted = model.match(source.keypoints, destination_of(destination.maps, destination.scores, matching))
    for mine, theirs in (
        (found.source_m, wanted.source_m),
        (found.destination_m, wanted.destination_m),
        (found.weights, wanted.weights),
    ):
        assert_allclose(mine, theirs, rtol=1e-4, atol=1e-3)
    assert float((source.keypoints.scores - destination.keypoints.scores).abs().max()) > 1e-4


def test_a_network_with_weights_that_are_not_numbers_gives_nan() -> None:
    """Without an error: training checks whether its loss is finite."""
    model = initial_model(SETTINGS, seed=1)
    with torch.no_grad():
        for name, value in model.named_parameters():
            if name == "locations.head.bias":
                value.fill_(math.nan)
    found = model(drawn_image(SIZE, seed=1), drawn_image(SIZE, seed=2), Matching(stride=2), torch.float32)
    assert bool(found.source_m.isnan().all())


def test_destinations_have_the_stride_and_number_format_of_the_matching() -> None:
    matching = Matching(stride=2, dtype=torch.bfloat16)
    pyramid = destination_of(_ideal(0, 0, 0), None, matching).pyramid
    assert (pyramid.stride, pyramid.dtype) == (matching.stride, matching.dtype)


def test_precisions_by_row_become_precisions_forward(monkeypatch: pytest.MonkeyPatch) -> None:
    model = FastKeypointModel(SETTINGS)
    maps = _ideal(0.0, 0.0, 0.0)
    keypoints = keypoints_at(inner_points(SIZE, pixel_m=PIXEL_M), maps, None)
    down_right = torch.tensor([[0.5, 0.4], [0.4, 0.5]]).expand(1, 60, 2, 2)
    monkeypatch.setattr(
        "echoscape.learn.model.fast_keypoint_model.remove_prior",
        lambda *_: (keypoints.points_px, down_right),
    )
    found = model.match(keypoints, destination_of(maps, None, Matching()), search_sigma_m=1.0).precision
    assert found is not None
    assert_allclose(found[0, 0], [[0.5, -0.4], [-0.4, 0.5]])


def test_true_places_with_an_expectation_are_refused() -> None:
    model, maps = FastKeypointModel(SETTINGS), _ideal(0.0, 0.0, 0.0)
    keypoints = keypoints_at(inner_points(SIZE, pixel_m=PIXEL_M), maps, None)
    with pytest.raises(ValueError, match="true_places goes without search_sigma_m"):
        model.match(keypoints, destination_of(maps, None, Matching()), lambda x: x, search_sigma_m=1.0)


@pytest.mark.parametrize("size", [150, 100, 20])
def test_an_image_of_any_size_has_its_cells_and_is_measured_alike(size: int) -> None:
    """A size that is no multiple of 16 and of the cells gets an empty margin about the same middle."""
    odd = ModelSettings(image=ImageSettings(pixel_m=PIXEL_M, size=size))
    wide = ModelSettings(image=ImageSettings(pixel_m=PIXEL_M, size=odd.side))
    assert odd.side == 80 * math.ceil(size / 80)
    models = [initial_model(each, seed=1).eval() for each in (odd, wide)]
    image = drawn_image(size, seed=2)
    padded = torch.nn.functional.pad(image, [(odd.side - size) // 2] * 4)
    with torch.no_grad():
        found, wanted = (model.features(each) for model, each in zip(models, (image, padded), strict=True))
    assert found.keypoints.points_px.shape == (1, 400, 2)
    assert_allclose(models[0].metres(found.keypoints.points_px), models[1].metres(wanted.keypoints.points_px))
