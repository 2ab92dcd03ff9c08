"""The plain model: the paper's equations by hand, and the fast model against it in values and gradients."""

import math

import numpy as np
import pytest
import torch
from numpy.testing import assert_allclose
from torch import Tensor

from echoscape.learn.data.image_settings import ImageSettings
from echoscape.learn.geometry.procrustes import Motion, motion_of_matches, moved, rotation_of_yaw
from echoscape.learn.model.fast_keypoint_model import FastKeypointModel, Matching
from echoscape.learn.model.keypoint_model import (
    KeypointModel,
    dense_descriptors,
    keypoint_locations,
    match_weights,
    matched_locations,
    pose_loss,
    unit,
    weighted_pose,
)
from echoscape.learn.model.model_settings import ModelSettings, Pooling
from echoscape.learn.model.pixel_coords import sampled
from echoscape.learn.model.weights import load_weights, shipped_weights
from echoscape.learn.odometry.paper_odometry import PaperOdometry
from tests.eval.drives import landmarks, scan_of

SIZE = 80
DEVICES = ["cpu", pytest.param("cuda", marks=pytest.mark.gpu)]


def _device(name: str) -> torch.device:
    if name == "cuda" and not torch.cuda.is_available():
        pytest.skip("needs a CUDA device")
    return torch.device(name)


def _images(seed: int, count: int = 1, dtype: torch.dtype = torch.float32) -> Tensor:
    draws = torch.Generator().manual_seed(seed)
    return torch.rand((count, 1, SIZE, SIZE), generator=draws, dtype=dtype)


def _models(
    dtype: torch.dtype = torch.float32, *, pooling: Pooling = "max", size: int = SIZE, heads: bool = True
) -> tuple[KeypointModel, FastKeypointModel]:
    image = ImageSettings(size=size, pixel_m=1.0)
    settings = ModelSettings(
        image=image, pooling=pooling, temperature=30.0, location_head=heads, score_head=heads
    )
    torch.manual_seed(1)
    plain = KeypointModel(settings).to(dtype)
    return plain, FastKeypointModel.from_plain(plain).to(dtype)


def _points(count: int = 30, seed: int = 1) -> Tensor:
    return torch.from_numpy(np.random.default_rng(seed).uniform(-50, 50, (2, count, 2)))


def _motion(yaw: float, forward: float, right: float) -> Motion:
    return Motion(
        rotation=rotation_of_yaw(torch.tensor([yaw, -yaw], dtype=torch.float64)),
        translation_m=torch.tensor([[forward, right], [right, forward]], dtype=torch.float64),
        certain=torch.ones(2, dtype=torch.bool),
    )


def _flat(model: torch.nn.Module) -> dict[str, Tensor]:
    return {name: each.grad for name, each in model.named_parameters() if each.grad is not None}


# ------------------------------------------------------------------ the fast model against the plain one


@pytest.mark.parametrize("training", [True, False])
@pytest.mark.parametrize("pooling", ["max", "blurred"])
def test_the_fast_model_is_the_plain_one_in_values_and_gradients(pooling: Pooling, *, training: bool) -> None:
    """Float32 has logits of 30 to some 1e-5, and a place that is spread over 80 px to some 1e-3 of one."""
    plain, fast = _models(pooling=pooling)
    plain.train(training)
    fast.train(training)
    source, destination = _images(1, 2), _images(2, 2)
    motion, matches = plain(source, destination)
    found = fast(source, destination, Matching(), torch.float32)
    assert_allclose(found.source_m.detach(), matches.source_m.detach(), atol=1e-3)
    assert_allclose(found.destination_m.detach(), matches.destination_m.detach(), atol=5e-3)
    assert_allclose(found.weights.detach(), matches.weights.detach(), atol=1e-4)
    fast_motion = found.motion()
    assert_allclose(fast_motion.translation_m.detach(), motion.translation_m.detach(), atol=1e-2)
    assert_allclose(fast_motion.yaw_rad.detach(), motion.yaw_rad.detach(), atol=1e-3)
    # A sum of the matches with fixed factors, whose gradient goes through all outputs of the network.
    factors = torch.linspace(-1, 2, matches.weights.numel()).view(matches.weights.shape)
    for each in (matches, found):
        ((each.destination_m + each.source_m).sum(-1) * factors * each.weights).sum().backward()
    theirs, mine = _flat(plain), _flat(fast)
    assert theirs.keys() == mine.keys()
    largest = max(float(each.norm()) for each in theirs.values())
    assert largest > 0
    for name, slope in theirs.items():
        assert float((mine[name] - slope).norm()) <= 2e-2 * float(slope.norm()) + 1e-4 * largest, name


def test_inference_by_the_fast_model_is_that_of_the_plain_one() -> None:
    """The path without gradients, with bundled weights, by least squares on every pixel in float32.

    Logits near 100 are exact to 1e-5 x 100, so matches spread over 100 m are to some 0.1 m.
    """
    model, _ = load_weights(shipped_weights()[0.6912])
    fast = FastKeypointModel.from_plain(model)
    scan = scan_of(landmarks(count=150), (0.0, 0.0, 0.0))
    later = scan_of(landmarks(count=150), (1.0, 0.3, 0.02), number=1)
    paper = PaperOdometry(model)
    images = [paper.image(each) for each in (scan, later)]
    with torch.inference_mode():
        motion, matches = model(images[1], images[0])
        found = fast(images[1], images[0], Matching(), torch.float32)
    assert_allclose(found.source_m, matches.source_m, atol=2e-3)
    assert_allclose(found.destination_m, matches.destination_m, atol=0.1)
    assert_allclose(found.weights, matches.weights, atol=1e-3)
    assert_allclose(found.motion().translation_m, motion.translation_m, atol=2e-3)


def test_both_models_share_their_weights_and_first_draws() -> None:
    plain, fast = _models()
    assert list(plain.state_dict()) == list(fast.state_dict())
    torch.manual_seed(1)
    drawn = FastKeypointModel(plain.settings)
    assert all(torch.equal(*pair) for pair in zip(plain.parameters(), drawn.parameters(), strict=True))


@pytest.mark.parametrize("heads", [True, False])
def test_an_image_without_multiple_of_16_pixels_is_padded_alike(*, heads: bool) -> None:
    plain, fast = (each.eval() for each in _models(size=70, heads=heads))
    source, destination = (each[..., 5:-5, 5:-5] for each in (_images(1), _images(2)))
    with torch.no_grad():
        _, matches = plain(source, destination)
        found = fast(source, destination, Matching(), torch.float32)
    assert_allclose(found.source_m, matches.source_m, atol=1e-3)
    assert_allclose(found.destination_m, matches.destination_m, atol=5e-3)
    assert_allclose(found.weights, matches.weights, atol=1e-4)


# ------------------------------------------------------------------ the paper's steps


@pytest.mark.parametrize("device", DEVICES)
def test_a_match_and_a_pose_on_any_device(device: str) -> None:
    """An image matched with itself has not moved; where matches are sharp, to a tenth of a pixel."""
    where = _device(device)
    image = ImageSettings(size=SIZE, pixel_m=1.0)
    settings = ModelSettings(image=image, temperature=3000.0, location_head=False)
    torch.manual_seed(2)
    model = KeypointModel(settings).to(where).eval()
    for part in model.modules():
        if isinstance(part, torch.nn.BatchNorm2d):
            part.momentum = 1.0
    with torch.no_grad():
        model.train()(_images(3).to(where), _images(3).to(where))
        motion, matches = model.eval()(_images(3).to(where), _images(3).to(where))
    assert matches.weights.device.type == where.type
    assert motion.rotation.device.type == where.type
    assert_allclose(motion.translation_m.cpu(), 0, atol=0.1)
    assert_allclose(motion.yaw_rad.cpu(), 0, atol=0.01)


def test_a_descriptor_is_matched_to_the_mean_of_equal_pixels() -> None:
    dense = torch.zeros(1, 4, 5, 7)
    dense[0, 0, 1, 2] = dense[0, 0, 3, 6] = 1.0
    query = torch.tensor([[[1.0, 0, 0, 0]]])
    assert_allclose(matched_locations(query, dense, temperature=500.0), [[[2.0, 4.0]]], atol=1e-5)


def test_a_weight_is_the_product_of_both_scores_and_the_similarity() -> None:
    """(cos + 1) / 2 s_s s_d, computed here by hand with three unlike factors."""
    found = match_weights(torch.tensor([[0.5, -1.0]]), torch.tensor([[0.8, 0.8]]), torch.tensor([[0.3, 0.9]]))
    assert_allclose(found, [[0.75 * 0.8 * 0.3, 0.0]], atol=1e-7)


def test_maps_are_sampled_bilinearly_with_their_edges_repeated() -> None:
    """Of a plane 10 row + column, bilinear interpolation is exact; beyond the edge the last pixel counts."""
    rows, columns = torch.meshgrid(torch.arange(4.0), torch.arange(6.0), indexing="ij")
    plane = torch.stack([10 * rows + columns, -rows])[None]
    points = torch.tensor([[[1.25, 3.5], [0.0, 0.0], [3.9, 7.0]]])
    assert_allclose(sampled(plane, points), [[[16.0, -1.25], [0.0, 0.0], [35.0, -3.0]]], atol=1e-5)


def test_a_keypoint_lies_at_the_mean_of_its_cell_by_the_softmax() -> None:
    """Two pixels of a cell share it three to one; a cell of equal logits has its keypoint at the centre."""
    logits = torch.zeros(1, 1, 8, 8)
    logits[0, 0, :4, :4] = -100.0
    logits[0, 0, 0, 1], logits[0, 0, 2, 3] = math.log(3.0), 0.0
    found = keypoint_locations(logits, 2)
    assert_allclose(found, [[[0.5, 1.5], [1.5, 5.5], [5.5, 1.5], [5.5, 5.5]]], atol=1e-5)


class _Given(torch.nn.Module):
    """A network part whose output is given."""

    def __init__(self, output: Tensor) -> None:
        super().__init__()
        self.output = output

    def forward(self, maps: tuple[Tensor, ...]) -> Tensor:
        return self.output[: len(maps[0])]


def test_a_match_weighs_by_both_scores(monkeypatch: pytest.MonkeyPatch) -> None:
    """Distinct pixels of the source lie two rows up in the destination; scores are unlike everywhere.

    Each weight is (1 + 1) / 2 s_source(keypoint) s_destination(match); the motion is two metres forward.
    """
    settings = ModelSettings(image=ImageSettings(size=16, pixel_m=1.0), cells=2, temperature=500.0)
    model = KeypointModel(settings).eval()
    draws = torch.Generator().manual_seed(7)
    fine = torch.nn.functional.normalize(torch.randn(1, 8, 16, 16, generator=draws), dim=1)
    coarse = [torch.zeros(2, channels, 16, 16) for channels in (16, 32, 64, 128)]
    maps = (torch.cat([fine, fine.roll(-2, 2)]), *coarse)
    scores = torch.rand(2, 1, 16, 16, generator=draws)
    logits = torch.full((1, 1, 16, 16), -100.0)
    rows, columns = torch.tensor([4, 5, 12, 13]), torch.tensor([3, 10, 5, 12])
    logits[0, 0, rows, columns] = 0.0
    monkeypatch.setattr(model, "locations", _Given(logits))
    monkeypatch.setattr(model, "scores", _Given(scores.logit()))
    monkeypatch.setattr(model, "maps", lambda images: maps)
    motion, matches = model(torch.zeros(1, 1, 16, 16), torch.zeros(1, 1, 16, 16))
    wanted = scores[0, 0, rows, columns] * scores[1, 0, rows - 2, columns]
    assert_allclose(matches.weights, wanted[None], rtol=1e-3)
    assert_allclose(motion.translation_m, [[2.0, 0.0]], atol=1e-2)


def test_the_embedding_is_the_largest_of_each_dense_descriptor() -> None:
    plain, fast = _models()
    plain.eval()
    images = _images(1, 2)
    with torch.no_grad():
        maps = plain.maps(images)
        found = plain.embedding(images)
        assert_allclose(found, dense_descriptors(maps).flatten(2).max(2).values)
        assert_allclose(fast.embedding(maps), found, atol=1e-6)
    assert found.shape == (2, 248)


@pytest.mark.parametrize("yaw", [0.0, 0.3, math.pi / 2, -3.0])
def test_the_pose_of_exact_matches_is_exact(yaw: float) -> None:
    truth, source = _motion(yaw, 3.0, -1.5), _points()
    weights = torch.rand(2, 30, generator=torch.Generator().manual_seed(4), dtype=torch.float64)
    found = weighted_pose(source, moved(source, truth), weights)
    assert_allclose(found.rotation, truth.rotation, atol=1e-12)
    assert_allclose(found.translation_m, truth.translation_m, atol=1e-10)
    assert bool(found.certain.all())


def test_the_singular_values_and_the_angle_in_closed_form_give_one_pose_and_gradient() -> None:
    source, weights = _points(), torch.rand(2, 30, dtype=torch.float64)
    destination = moved(source, _motion(0.4, 2.0, 1.0)) + 3 * torch.randn(2, 30, 2, dtype=torch.float64)
    inputs = [each.clone().requires_grad_() for each in (source, destination, weights)]
    slopes = []
    for solve in (weighted_pose, motion_of_matches):
        motion = solve(*inputs)
        total = (motion.rotation * torch.arange(4.0).view(2, 2)).sum() + motion.translation_m.sum()
        slopes.append((motion, torch.autograd.grad(total, inputs)))
    (one, by_svd), (other, by_angle) = slopes
    assert_allclose(one.rotation.detach(), other.rotation.detach(), atol=1e-12)
    assert_allclose(one.translation_m.detach(), other.translation_m.detach(), atol=1e-10)
    for mine, theirs in zip(by_svd, by_angle, strict=True):
        assert_allclose(mine, theirs, atol=1e-9 * float(theirs.abs().max()))


def test_mirrored_points_give_a_rotation_not_a_reflection() -> None:
    source = _points()
    found = weighted_pose(source, source * torch.tensor([1.0, -1.0]), torch.ones(2, 30, dtype=torch.float64))
    assert_allclose(torch.linalg.det(found.rotation), 1.0, atol=1e-12)


@pytest.mark.parametrize("what", ["weight", "spread"])
def test_a_pose_that_is_not_determined_is_none_with_finite_gradients(what: str) -> None:
    source = _points().requires_grad_()
    points = source if what == "weight" else source[:, :1].expand(-1, 30, -1)
    weights = torch.full((2, 30), 0.0 if what == "weight" else 1.0, dtype=torch.float64, requires_grad=True)
    found = weighted_pose(points, points + 2.0, weights)
    assert not bool(found.certain.any())
    assert_allclose(found.rotation.detach(), torch.eye(2).expand(2, 2, 2), atol=1e-12)
    (found.rotation.sum() + found.translation_m.sum()).backward()
    assert weights.grad is not None
    assert bool(weights.grad.isfinite().all())


def test_the_loss_of_a_rotation_is_twice_the_sine_of_half_the_angle() -> None:
    found = pose_loss(_motion(0.2, 3.0, 4.0), _motion(0.0, 0.0, 0.0), alpha_m=10.0)
    assert_allclose(found, 5 + 10 * 2 * math.sin(0.1), atol=1e-12)


def test_descriptors_that_are_too_short_stay_short() -> None:
    assert float(unit(torch.full((1, 248), 1e-9)).norm()) < 0.1
