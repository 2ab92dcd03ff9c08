"""Motion between scans against the true one."""

import itertools

import pytest
from quayside.motion import PIXEL_M, translation_m


def test_motion_between_two_scans_is_the_true_one(radar_pair):
    first, second, motion = radar_pair
    forward, right = translation_m(
        first.codes, second.codes, azimuth_rad=first.azimuth_rad, bin_m=first.bin_m
    )
    assert forward == pytest.approx(motion.x_m, abs=1.5 * PIXEL_M)
    assert right == pytest.approx(motion.y_m, abs=1.5 * PIXEL_M)


def test_a_scan_has_not_moved_against_itself(radar_scan):
    found = translation_m(
        radar_scan.codes, radar_scan.codes, azimuth_rad=radar_scan.azimuth_rad, bin_m=radar_scan.bin_m
    )
    assert found == (0, 0)


def test_motion_over_a_drive_has_no_large_errors(radar_drive):
    lengths = [
        translation_m(a.codes, b.codes, azimuth_rad=a.azimuth_rad, bin_m=a.bin_m)[0]
        for a, b in itertools.pairwise(radar_drive)
    ]
    driven = radar_drive[-1].truth.middle_pose[:2] - radar_drive[0].truth.middle_pose[:2]
    assert sum(lengths) == pytest.approx((driven**2).sum() ** 0.5, rel=0.1)
