"""Keypoints lie at the centres of their cells, in the axes of the car."""

from dataclasses import replace

import numpy as np
import pytest

from echoscape.eval.methods.keypoints import first_bin, keypoints_at
from tests.eval.methods.polar_scans import BIN_M, scan_of_codes

SCAN = scan_of_codes(np.zeros((400, 100)))


def test_a_quarter_of_a_revolution_is_to_the_right() -> None:
    azimuth = np.array([0, 100, 200, 300])
    found = keypoints_at(SCAN, azimuth, np.full(4, 39), np.ones(4))
    range_m = 39.5 * BIN_M
    right_angles = [[range_m, 0], [0, range_m], [-range_m, 0], [0, -range_m]]
    np.testing.assert_allclose(found.points_m, right_angles, atol=1e-12)


def test_an_encoder_that_starts_elsewhere_and_an_offset_move_the_keypoints() -> None:
    # 1400 of 5600 counts are 90 deg.
    turned = replace(SCAN, encoder=((SCAN.encoder.astype(int) + 1400) % 5600).astype(np.uint16))
    found = keypoints_at(turned, np.array([300]), np.array([9]), np.ones(1), range_offset_m=-0.31)
    assert found.azimuth_rad[0] == pytest.approx(0, abs=1e-12) or found.azimuth_rad[0] == pytest.approx(
        2 * np.pi
    )
    assert found.x_m[0] == pytest.approx(9.5 * BIN_M - 0.31)
    assert found.y_m[0] == pytest.approx(0, abs=1e-12)


def test_the_strongest_keep_their_order() -> None:
    found = keypoints_at(SCAN, np.arange(5), np.arange(5), np.array([3.0, 1.0, 4.0, 1.0, 5.0]))
    kept = found.strongest(3)
    assert kept.azimuth.tolist() == [0, 2, 4]
    assert kept.score.tolist() == [3.0, 4.0, 5.0]
    assert found.strongest(4).azimuth.tolist() == [0, 1, 2, 4]
    assert found.strongest(9) == found


@pytest.mark.parametrize(("near_m", "bin_number"), [(0, 0), (0.01, 0), (0.025, 0), (0.03, 1), (2.5, 50)])
def test_the_first_bin_is_the_nearest_with_its_centre_beyond(near_m: float, bin_number: int) -> None:
    assert first_bin(near_m, BIN_M) == bin_number
