"""Hand-made keypoints keep their cells as detections, and every cell its score."""

import numpy as np
import pytest

from echoscape.eval.detections.hand_made import HandMadeKeypoints
from echoscape.eval.detections.registry import MethodSettings, build_detectors
from echoscape.eval.methods.cen2018 import Cen2018Settings
from echoscape.eval.methods.registry import EXTRACTORS
from echoscape.sim.sensor.cts350x import CTS350X
from tests.eval.detections.made_scans import map_of
from tests.eval.methods.polar_scans import BIN_M, receiver_noise, scan_of_codes, with_echo

SCAN = scan_of_codes(with_echo(receiver_noise(60, 800), 20, 500))


@pytest.mark.parametrize("name", sorted(EXTRACTORS))
def test_detections_are_the_keypoints_and_their_cells(name: str) -> None:
    extractor = EXTRACTORS[name]()
    (detector,) = build_detectors([name], MethodSettings(), CTS350X)
    assert (detector.name, detector.score_limits) == (name, extractor.score_limits)
    found, keypoints = detector.detect(SCAN), extractor.extract(SCAN)
    bins = np.floor(found.detections.range_m / BIN_M)
    np.testing.assert_array_equal(found.detections.azimuth, keypoints.azimuth)
    np.testing.assert_array_equal(bins, keypoints.bin)
    assert (20, 500) in set(zip(found.detections.azimuth, bins, strict=True))
    assert len(map_of(found)) == 60 * 800
    low, high = detector.score_limits
    assert low <= map_of(found).score.min() <= map_of(found).score.max() <= high
    assert map_of(found).score.reshape(60, 800)[20, 500] == pytest.approx(
        found.detections.score.max(), rel=0.1
    )


def test_settings_reach_the_extractor() -> None:
    strict = MethodSettings(cen2018=Cen2018Settings(threshold=30))
    (detector,) = build_detectors(["cen2018"], strict, CTS350X)
    assert len(detector.detect(SCAN).detections) == 0
    assert len(HandMadeKeypoints(EXTRACTORS["cen2018"]()).detect(SCAN).detections) > 0
