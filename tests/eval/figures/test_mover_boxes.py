"""Boxes of moving objects at the azimuth that sees them, with motion distortion and without."""

import math
from dataclasses import replace

import numpy as np
import pytest

from echoscape.eval.figures.mover_boxes import ObservedBox, observed_boxes
from echoscape.sim.datasets.polar_scan import MoverBoxes, PolarScan, ScanTruth
from tests.sim.scans import drawn_scan

SPEED_M_S = 16.0


def _scan() -> tuple[PolarScan, ScanTruth]:
    """A car that drives north at 16 m/s, at the origin at mid-scan, and a box to its left that turns.

    Azimuth 300 sees the box, 1.5 m further on and 0.3 rad to the right of where it was at mid-scan.
    """
    scan = drawn_scan()
    assert scan.truth is not None
    times_s = (scan.timestamp_us - scan.truth.middle_us) / 1e6
    pose = np.column_stack([0 * times_s, SPEED_M_S * times_s, 0 * times_s, 0 * times_s + math.pi / 2])
    boxes = MoverBoxes(
        instance=np.array([1], np.uint32),
        class_id=np.array([9], np.uint8),
        centre=np.array([[-30.0, 0.0, 0.7]]),
        extent=np.array([[4.0, 2.0, 1.5]]),
        yaw=np.array([math.pi / 2]),
        velocity=np.array([[0.0, SPEED_M_S / 2, 0.0]]),
        row=np.array([300], np.int32),
        row_centre=np.array([[-28.0, 1.5, 0.7]]),
        row_yaw=np.array([math.pi / 2 - 0.3]),
    )
    return scan, replace(scan.truth, pose=pose, middle_pose=np.array([0, 0, 0, math.pi / 2]), boxes=boxes)


@pytest.mark.parametrize("share", [1.0, 0.5, 0.0])
def test_box_stands_where_the_truth_has_it_at_the_time_of_its_row(share: float) -> None:
    # In row 300 the car is 16 m/s times its time further on, of which the motion distortion leaves a share.
    scan, truth = _scan()
    (box,) = observed_boxes(truth, motion_distortion=share)
    late_s = share * float(scan.timestamp_us[300] - truth.middle_us) / 1e6
    assert (box.right_m, box.forward_m) == pytest.approx((-28.0, 1.5 - SPEED_M_S * late_s), abs=0.03)
    assert box.heading_rad == pytest.approx(0.3)
    # The world position stays that of mid-scan.
    assert (box.x_m, box.y_m, box.yaw_rad) == (-30.0, 0.0, round(math.pi / 2, 3))


def test_corners_follow_length_width_and_heading() -> None:
    box = ObservedBox(
        instance=1, class_id=1, forward_m=10.0, right_m=5.0, heading_rad=math.pi / 2, x_m=0.0, y_m=0.0,
        yaw_rad=0.0, length_m=4.0, width_m=2.0, height_m=1.5, speed_m_s=0.0,
    )  # fmt: skip
    corners = box.corners_m()
    np.testing.assert_allclose(corners.min(axis=0), [3, 9], atol=1e-9)  # 4 m across, 2 m ahead
    np.testing.assert_allclose(corners.max(axis=0), [7, 11], atol=1e-9)
