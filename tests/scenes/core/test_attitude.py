"""Pitch and roll: the axes that they give a body, directions in its frame, and their course over time."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from numpy.testing import assert_allclose
from numpy.typing import NDArray
from scipy.spatial.transform import Rotation

from echoscape.scenes.core.attitude import Attitude, bearing_and_elevation, body_axes

YAWS = st.floats(-7.0, 7.0)
TILTS = st.floats(-0.5, 0.5)


@given(yaw=YAWS, pitch=TILTS, roll=TILTS)
def test_axes_are_the_rotation_by_yaw_pitch_and_roll_in_this_order(
    yaw: float, pitch: float, roll: float
) -> None:
    # Turned by pi about x, the world has y to the right of x and z down, as the vehicle's frame.
    rotation = Rotation.from_euler("ZYX", [-yaw, pitch, roll]).as_matrix()
    forward, right, down = (rotation * [[1], [-1], [-1]]).T
    assert_allclose(body_axes(yaw, np.array([pitch, roll])), [forward, right, -down], atol=1e-14)


def test_pitch_raises_the_nose_and_roll_lowers_the_right_side() -> None:
    forward, right, up = body_axes(0.3, np.array([0.1, 0.0]))
    assert forward[2] == pytest.approx(np.sin(0.1))
    assert right[2] == 0
    assert up @ [np.cos(0.3), np.sin(0.3), 0] < 0
    forward, right, up = body_axes(0.3, np.array([0.0, 0.1]))
    assert right[2] == pytest.approx(-np.sin(0.1))
    assert forward[2] == 0
    assert up @ [np.sin(0.3), -np.cos(0.3), 0] > 0


@given(yaw=YAWS, pitch=TILTS, roll=TILTS, bearing=st.floats(-3.1, 3.1), elevation=st.floats(-1.5, 1.5))
def test_bearing_and_elevation_are_those_in_the_frame_of_the_body(
    yaw: float, pitch: float, roll: float, bearing: float, elevation: float
) -> None:
    axes = body_axes(yaw, np.array([pitch, roll]))
    level = np.cos(elevation)
    seen = 40.0 * np.array([level * np.cos(bearing), level * np.sin(bearing), np.sin(elevation)]) @ axes
    assert_allclose(bearing_and_elevation(axes, seen), [bearing, elevation], atol=1e-12)


def swinging() -> Attitude:
    time_s = np.linspace(0.0, 2.0, 101)
    angle = np.stack([0.02 * np.sin(8 * time_s), 0.03 * np.cos(5 * time_s)], axis=1)
    rate = np.stack([0.16 * np.cos(8 * time_s), -0.15 * np.sin(5 * time_s)], axis=1)
    return Attitude(time_s=time_s, angle_rad=angle, rate_rps=rate)


def test_rates_are_the_derivative_of_the_angles() -> None:
    times, step = np.linspace(0.01, 1.99, 357), 1e-5
    change = swinging().angles(times + step) - swinging().angles(times - step)
    assert_allclose(swinging().rates(times), change / (2 * step), atol=1e-6)


def test_ends_are_kept() -> None:
    known = swinging()
    assert_allclose(known.angles([-5.0, 7.0]), known.angle_rad[[0, -1]])
    assert not known.rates([-5.0, 7.0]).any()


@pytest.mark.parametrize(
    ("time_s", "angle_rad", "message"),
    [
        (np.array([0.0, 1.0]), np.zeros((3, 2)), r"angle_rad and rate_rps must be \(2, 2\)"),
        (np.array([0.0, 0.0]), np.zeros((2, 2)), "increasing"),
        (np.array([0.0]), np.zeros((1, 2)), "two or more"),
        (np.array([0.0, 1.0]), np.full((2, 2), 0.51), r"between -0\.5 and 0\.5"),
        (np.array([0.0, 1.0]), np.full((2, 2), np.nan), r"between -0\.5 and 0\.5"),
    ],
)
def test_what_is_no_attitude_is_refused(
    time_s: NDArray[np.float64], angle_rad: NDArray[np.float64], message: str
) -> None:
    with pytest.raises(ValueError, match=message):
        Attitude(time_s=time_s, angle_rad=angle_rad, rate_rps=np.zeros_like(angle_rad))


def test_rates_that_are_not_finite_are_refused() -> None:
    with pytest.raises(ValueError, match="rate_rps must be finite"):
        Attitude(time_s=np.arange(2.0), angle_rad=np.zeros((2, 2)), rate_rps=np.full((2, 2), np.inf))
