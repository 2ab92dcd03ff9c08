"""Keypoints in metres: known places, rotations, motion compensation, and the model of the paper's form."""

import cmath
import math
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
import torch
from numpy.testing import assert_allclose
from numpy.typing import NDArray
from scipy.ndimage import map_coordinates

from echoscape.learn.data.image import image_of_codes
from echoscape.learn.data.image_settings import ImageSettings
from echoscape.learn.model.keypoint_model import KeypointModel, dense_descriptors, unit
from echoscape.learn.model.model_settings import ModelSettings
from echoscape.learn.model.pixel_coords import sampled
from echoscape.learn.model.weights import load_weights, shipped_weights
from echoscape.learn.odometry.keypoint_detector import KeypointDetector, ScanKeypoints
from echoscape.learn.training.checkpoint import initial_model
from echoscape.sim.datasets.files.atomic_write import DatasetError
from echoscape.sim.datasets.polar_scan import PolarScan
from tests.learn.folders import AZIMUTHS, BIN_M, BINS, codes_from, world

PIXEL_M, SIZE = 0.4, 160
SETTINGS = ModelSettings(image=ImageSettings(pixel_m=PIXEL_M, size=SIZE), cells=10)
CELL_M = SIZE / 10 * PIXEL_M
BLOB_M = 1.5
REVOLUTION_S = 0.25
SEAM_RAD = (13 - 7) / 5600 * 2 * math.pi
AT_REST = (0.0, 0.0, 0.0)


def scan_of(codes: NDArray[np.uint8]) -> PolarScan:
    """Return a scan of codes, with the times and the encoder of the CTS350-X."""
    return PolarScan(
        codes=codes,
        timestamp_us=625 * np.arange(AZIMUTHS),
        encoder=(13 + 14 * np.arange(AZIMUTHS)).astype(np.uint16),
        valid=np.ones(AZIMUTHS, bool),
        bin_m=BIN_M,
    )


def town_scan() -> PolarScan:
    """Return a scan of many points."""
    return scan_of(codes_from(world(5), AT_REST))


def point_scan(at: complex) -> PolarScan:
    """Return a scan with one round blob, forward + i right [m], wider than azimuths and pixels are apart."""
    azimuth_rad = (13 + 14 * np.arange(AZIMUTHS)) * (2 * math.pi / 5600)
    range_m = (np.arange(BINS) + 0.5) * BIN_M
    across_m = abs(at) * np.angle(np.exp(1j * azimuth_rad) / at)
    blob = np.exp(-0.5 * (across_m / BLOB_M) ** 2)[:, None] * np.exp(
        -0.5 * ((range_m - abs(at)) / BLOB_M) ** 2
    )
    return scan_of(np.rint(110 * blob).astype(np.uint8))


def brightness_model(settings: ModelSettings = SETTINGS) -> KeypointModel:
    """Return a model whose location logits and scores grow with the brightness of the image alone.

    The mean of a symmetric blob by its softmax is its centre.
    """
    model = KeypointModel(settings).eval()
    for parameter in model.parameters():
        torch.nn.init.zeros_(parameter)
    for part in model.modules():
        if isinstance(part, torch.nn.BatchNorm2d):
            torch.nn.init.ones_(part.weight)
    assert model.locations is not None
    assert model.scores is not None
    for layers, channel in (
        (model.encoder.blocks[0], 0),
        (model.locations.blocks[0], 16),
        (model.scores.blocks[0], 16),
    ):
        layers[0].weight.data[0, channel, 1, 1] = 1.0  # pyright: ignore
        layers[3].weight.data[0, 0, 1, 1] = 1.0  # pyright: ignore
    model.locations.head.weight.data[0, 0] = 20.0
    model.scores.head.weight.data[0, 0] = 4.0
    return model


@pytest.fixture(scope="module")
def detector() -> KeypointDetector:
    return KeypointDetector(brightness_model(), device="cpu")


def brightest(found: ScanKeypoints) -> complex:
    """Return the place of the highest score, forward + i right [m]."""
    best = int(found.score.argmax())
    return complex(found.x_m[best], found.y_m[best])


def place(row: int, column: int, offset: complex = 0.0) -> complex:
    """Return a place near the centre of a cell of the image, forward + i right [m]."""
    return complex((4.5 - row) * CELL_M, (column - 4.5) * CELL_M) + offset


@pytest.mark.parametrize(
    ("row", "column", "offset"), [(1, 5, 0.3 + 0.5j), (4, 8, -0.7 + 0.2j), (8, 2, 0.9 - 0.4j), (6, 0, 0.1j)]
)
def test_a_point_is_found_where_it_is_to_a_tenth_of_a_pixel(
    detector: KeypointDetector, row: int, column: int, offset: complex
) -> None:
    at = place(row, column, offset)
    found = detector.detect(point_scan(at))
    best = int(found.score.argmax())
    assert best == 10 * row + column
    assert abs(brightest(found) - at) < 0.1 * PIXEL_M
    assert_allclose(found.range_m[best], abs(at), atol=0.1 * PIXEL_M)
    assert_allclose(found.azimuth_rad[best], cmath.phase(at) % (2 * math.pi), atol=0.1 * PIXEL_M / abs(at))


@pytest.mark.parametrize("quarters", [1, 2, 3])
def test_a_scan_rotated_by_quarters_has_rotated_keypoints(detector: KeypointDetector, quarters: int) -> None:
    """Rotated by 100 azimuths, the image is rotated by its own pixels, and so are all cells."""
    scan = scan_of(codes_from(world(3, reach_m=30), AT_REST))
    turned = replace(scan, codes=np.roll(scan.codes, quarters * AZIMUTHS // 4, axis=0))
    before, after = detector.detect(scan), detector.detect(turned)
    expected = (before.x_m + 1j * before.y_m) * 1j**quarters
    found = after.x_m + 1j * after.y_m
    nearest = abs(found[:, None] - expected[None]).argmin(0)
    assert sorted(nearest) == list(range(100))
    assert_allclose(found[nearest], expected, atol=0.01)
    assert_allclose(after.score[nearest], before.score, atol=1e-4)


def test_a_point_rotated_by_whole_azimuths_is_found_rotated(detector: KeypointDetector) -> None:
    at = place(1, 5, 0.2 - 1.0j)
    scan = point_scan(at)
    for steps in (-3, 2, 5):
        turned = replace(scan, codes=np.roll(scan.codes, steps, axis=0))
        expected = brightest(detector.detect(scan)) * cmath.exp(2j * math.pi * steps / AZIMUTHS)
        assert abs(brightest(detector.detect(turned)) - expected) < 0.1 * PIXEL_M


def test_keypoints_are_those_of_the_paper_form_model() -> None:
    model, _ = load_weights(shipped_weights()[0.6912])
    scan = town_scan()
    found = KeypointDetector(device="cpu").detect(scan)
    image = image_of_codes(scan.codes, BIN_M, model.settings.image, first_rad=scan.first_azimuth_rad)[None]
    with torch.no_grad():
        _, matches = model(image, image)
        maps = model.maps(image)
        assert model.scores is not None
        scores = model.scores(maps).sigmoid()
        points_px = _pixels(found, model.settings.side)
        descriptors = unit(sampled(dense_descriptors(maps), points_px))[0]
        expected = sampled(scores, points_px)[0, :, 0]
    assert len(found) == 400
    assert_allclose(np.stack([found.x_m, found.y_m], -1), matches.source_m[0], atol=2e-3)
    assert_allclose(found.score, expected, atol=1e-3)
    assert_allclose(found.descriptor, descriptors, atol=1e-3)
    assert_allclose(np.linalg.norm(found.descriptor, axis=1), 1, atol=1e-5)


def _pixels(found: ScanKeypoints, side: int) -> torch.Tensor:
    """Return rows and columns (1, N, 2) of keypoints, by the formula of docs/conventions.md."""
    rows = (side - 1) / 2 - found.x_m / found.pixel_m
    columns = (side - 1) / 2 + found.y_m / found.pixel_m
    return torch.from_numpy(np.stack([rows, columns], -1).astype(np.float32))[None]


def test_scores_are_those_of_the_map_at_the_keypoints_without_its_margin() -> None:
    """An image of 152 pixels is padded to 160; the map has the pixels of the image."""
    settings = replace(SETTINGS, image=ImageSettings(pixel_m=PIXEL_M, size=152))
    detector = KeypointDetector(initial_model(settings, seed=2), device="cpu")
    found = detector.detect(scan_of(codes_from(world(3, reach_m=30), AT_REST)), score_map=True)
    assert found.score_map is not None
    assert found.score_map.shape == (152, 152)
    places = _pixels(found, 152)[0].numpy().T
    inside = ((places > 0) & (places < 151)).all(0)
    assert inside.sum() > 60
    expected = map_coordinates(found.score_map, places[:, inside], order=1)
    assert np.ptp(found.score[inside]) > 0.001
    assert_allclose(found.score[inside], expected, atol=1e-4)


def measured(true: complex, twist: tuple[float, float, float], beta_s: float) -> complex:
    """Where a moving car measures a static point that is at `true` at mid-scan, by fixed-point iteration."""
    velocity, rate = complex(*twist[:2]), twist[2]
    seen = true
    for _ in range(50):
        after = (cmath.phase(seen) - SEAM_RAD) / (2 * math.pi) % 1
        time_s = (after - 0.5) * REVOLUTION_S
        turn = rate * time_s
        moved = velocity * time_s if rate == 0 else velocity * (cmath.exp(1j * turn) - 1) / (1j * rate)
        true_now = (true - moved) * cmath.exp(-1j * turn)
        beam = true_now / abs(true_now)
        closing = (velocity * beam.conjugate()).real
        seen = true_now - beta_s * closing * beam
    return seen


@pytest.mark.parametrize("twist", [(20.0, 0.0, 0.0), (12.0, -1.0, 0.5)])
@pytest.mark.parametrize("at", [place(1, 5), place(5, 9, -0.6), place(5, 0, 1.2), place(9, 4)])
def test_a_twist_moves_keypoints_to_mid_scan(
    detector: KeypointDetector, twist: tuple[float, float, float], at: complex
) -> None:
    beta_s = 0.049
    seen = measured(at, twist, beta_s)
    scan = point_scan(seen)
    found = detector.detect(scan, twist=twist, doppler_beta_s=beta_s)
    best = int(found.score.argmax())
    assert abs(brightest(found) - at) < 0.1 * PIXEL_M
    assert_allclose(found.range_m[best], abs(seen), atol=0.1 * PIXEL_M)
    assert abs(brightest(detector.detect(scan)) - seen) < 0.1 * PIXEL_M


def test_the_range_offset_moves_keypoints_outwards() -> None:
    at = place(1, 5)
    scan = point_scan(at)
    moved = KeypointDetector(brightness_model(), device="cpu", range_offset_m=1.2).detect(scan)
    assert abs(brightest(moved) - at * (1 + 1.2 / abs(at))) < 0.1 * PIXEL_M


def test_detection_repeats_to_the_bit_and_a_file_of_weights_is_taken_as_its_model(tmp_path: Path) -> None:
    path, scan = shipped_weights()[0.6912], town_scan()
    one = KeypointDetector(device="cpu").detect(scan)
    assert one == KeypointDetector(str(path), device="cpu").detect(scan)
    assert one == KeypointDetector(load_weights(path)[0], device="cpu").detect(scan)
    assert one.x_m.dtype == one.azimuth_rad.dtype == one.score.dtype == one.descriptor.dtype == np.float32
    assert one.azimuth_rad.min() >= 0
    assert one.azimuth_rad.max() < 2 * math.pi
    with pytest.raises(DatasetError, match=r"none\.safetensors"):
        KeypointDetector(tmp_path / "none.safetensors")


def test_bad_input_is_refused(detector: KeypointDetector) -> None:
    scan = town_scan()
    for twist in ((1.0, 2.0), (1.0, math.nan, 0.0), [[1.0, 0.0, 0.0]]):
        with pytest.raises(ValueError, match="twist must be three finite numbers"):
            detector.detect(scan, twist=twist)
    still = replace(scan, timestamp_us=np.zeros(AZIMUTHS, np.int64))
    with pytest.raises(ValueError, match="timestamp_us must increase"):
        detector.detect(still, twist=(1.0, 0.0, 0.0))
    with pytest.raises(ValueError, match=r"resolution_m must be None beside weights, got 0\.6912"):
        KeypointDetector(brightness_model(), resolution_m=0.6912)
    with pytest.raises(DatasetError, match="resolution must be one of"):
        KeypointDetector(resolution_m=1.0)
