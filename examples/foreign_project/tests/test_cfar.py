"""Detections against what is known of simulated scans."""

import pytest
from quayside.cfar import detections

DIRECT, GHOST = 2, 3  # components in echoscape's truth


def test_a_reflector_is_detected_where_it_stands(radar_target):
    found = detections(radar_target.scan.codes)
    assert found[radar_target.azimuth, radar_target.bin]


def test_most_detections_are_of_objects_in_their_place(radar_scan):
    cells, found = radar_scan.truth.cells, detections(radar_scan.codes)
    in_place = (cells.component == DIRECT) | ((cells.component == GHOST) & ~cells.displaced)
    assert found.sum() > 100
    assert in_place[found].mean() > 0.6


def test_ghosts_add_false_alarms(radar_clean, radar_full):
    counts = [
        (scan.truth.cells.component[detections(scan.codes)] == GHOST).sum()
        for scan in (radar_clean, radar_full)
    ]
    assert counts[0] < counts[1]


@pytest.mark.parametrize("range_m", [15, 60])
def test_rain_does_not_hide_a_reflector(make_radar_target, range_m):
    target = make_radar_target(range_m, bearing_rad=-0.4, artefacts={"rain": 20})
    found = detections(target.scan.codes)
    assert found[target.azimuth, target.bin - 1 : target.bin + 2].any()


def test_detections_are_those_of_the_golden_scan(radar_clean, radar_golden):
    radar_golden.check(detections(radar_clean.codes), "detections", max_share=1e-3)
