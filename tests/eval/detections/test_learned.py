import numpy as np
import pytest
from numpy.testing import assert_allclose, assert_array_equal

torch = pytest.importorskip("torch")

from echoscape.eval.detections.learned import LearnedKeypoints, pixel_detections  # noqa: E402
from echoscape.learn.data.image_settings import ImageSettings  # noqa: E402
from echoscape.learn.model.keypoint_model import KeypointModel  # noqa: E402
from echoscape.learn.model.model_settings import ModelSettings  # noqa: E402
from echoscape.learn.odometry.keypoint_detector import KeypointDetector  # noqa: E402
from tests.eval.detections.made_scans import made_scan, map_of  # noqa: E402


@pytest.fixture(scope="module")
def detector() -> KeypointDetector:
    torch.manual_seed(1)
    return KeypointDetector(KeypointModel(ModelSettings(image=ImageSettings(pixel_m=1.0, size=64), cells=4)))


@pytest.fixture(scope="module")
def scan():
    return made_scan(np.random.default_rng(1).integers(0, 120, (400, 400)))


def test_keypoints_are_where_the_network_has_them(detector: KeypointDetector, scan) -> None:
    expected = detector.detect(scan)
    found = LearnedKeypoints(detector).detect(scan)
    assert len(found.detections) == 16
    assert len(map_of(found)) == 64**2
    assert_allclose(found.detections.range_m, expected.range_m, rtol=1e-6)
    steps = (expected.azimuth_rad - scan.first_azimuth_rad) / (2 * np.pi / 400)
    assert_array_equal(found.detections.azimuth, np.rint(steps).astype(int) % 400)
    assert_allclose(found.detections.score, expected.score)


def test_scores_below_the_floor_are_left_out(detector: KeypointDetector, scan) -> None:
    floor = float(np.median(detector.detect(scan).score))
    found = LearnedKeypoints(detector, least_score=floor).detect(scan)
    assert 0 < len(found.detections) < 16
    assert found.detections.score.min() >= floor
    assert len(map_of(found)) == 64**2


def test_pixels_lie_where_the_image_shows_them(scan) -> None:
    score = np.zeros((4, 4))
    score[0, 3] = 1.0  # ahead and to the right, 1.5 pixels each
    found = pixel_detections(score, 2.0, scan)
    (place,) = np.flatnonzero(found.score)
    assert found.range_m[place] == pytest.approx(3.0 * np.sqrt(2))
    assert found.azimuth[place] == 50  # an eighth of a turn of 400


def test_the_same_scan_gives_the_same_keypoints(detector: KeypointDetector, scan) -> None:
    first, second = (LearnedKeypoints(detector).detect(scan) for _ in range(2))
    assert_array_equal(first.detections.score, second.detections.score)
    assert_array_equal(map_of(first).score, map_of(second).score)
