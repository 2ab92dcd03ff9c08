import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from echoscape.sim.datasets.deskew import deskewed
from echoscape.sim.sensor.cts350x import CTS350X

STILL = np.zeros((400, 4))


def test_frame_has_x_forward_and_y_right() -> None:
    found = deskewed([0, 100, 200], [5.0, 6.0, 7.0], pose=STILL, middle_pose=STILL[0])
    np.testing.assert_allclose(found, [[5, 0], [0, 6], [-7, 0]], atol=1e-12)


@given(
    x=st.floats(-50, 50),
    y=st.floats(-50, 50),
    yaw=st.floats(-4, 4),
    speed=st.floats(-20, 20),
    turn=st.floats(-1, 1),
    row=st.integers(0, 399),
)
def test_standing_point_comes_back_to_where_it_is(
    x: float, y: float, yaw: float, speed: float, turn: float, row: int
) -> None:
    # A car that drives and turns; the point lies in the beam of one row, Doppler shift included.
    times = (np.arange(400) - 199.5) / 1600
    heading = yaw + turn * times
    velocity = speed * np.stack([np.cos(heading), np.sin(heading)], -1)
    pose = np.column_stack([x + velocity[:, 0] * times, y + velocity[:, 1] * times, 0 * times, heading])
    angle = heading[row] - 2 * math.pi * row / 400
    point = pose[row, :2] + 40.0 * np.array([math.cos(angle), math.sin(angle)])
    closing = velocity[row] @ [math.cos(angle), math.sin(angle)]
    apparent = 40.0 - 0.049 * closing  # a rising sweep shows what comes nearer nearer
    middle = np.array([x, y, 0.0, yaw])
    found = deskewed([row], [apparent], pose=pose, middle_pose=middle, velocity=velocity, sensor=CTS350X)[0]
    back = np.array([x, y]) + found[0] * np.array([math.cos(yaw), math.sin(yaw)])
    back += found[1] * np.array([math.sin(yaw), -math.cos(yaw)])
    np.testing.assert_allclose(back, point, atol=1e-9)


def test_refuses_what_does_not_fit() -> None:
    with pytest.raises(ValueError, match="row must be whole numbers of 0 to 399"):
        deskewed([400], [1.0], pose=STILL, middle_pose=STILL[0])
    with pytest.raises(ValueError, match="row and range_m"):
        deskewed([1, 2], [1.0], pose=STILL, middle_pose=STILL[0])
    with pytest.raises(ValueError, match="pose must be finite"):
        deskewed([1], [1.0], pose=STILL[:, :3], middle_pose=STILL[0])
    with pytest.raises(ValueError, match="middle_pose"):
        deskewed([1], [1.0], pose=STILL, middle_pose=STILL)
    with pytest.raises(ValueError, match="together"):
        deskewed([1], [1.0], pose=STILL, middle_pose=STILL[0], sensor=CTS350X)
    with pytest.raises(ValueError, match="velocity"):
        deskewed([1], [1.0], pose=STILL, middle_pose=STILL[0], sensor=CTS350X, velocity=np.zeros((3, 2)))
