"""Points that stand still come back to where they are, whatever the car did while it scanned them."""

import math

import numpy as np
from hypothesis import given
from hypothesis import strategies as st
from numpy.testing import assert_allclose
from scipy.linalg import expm

from echoscape.sim.datasets.motion_compensation import to_mid_scan

REVOLUTION_S, BETA_S = 0.25, 0.049


def beam(azimuth_rad: float) -> np.ndarray:
    return np.array([math.cos(azimuth_rad), math.sin(azimuth_rad)])


def test_nothing_changes_for_a_car_at_rest() -> None:
    points = np.array([[5.0, 0.0], [0.0, 6.0], [-7.0, 1.0], [0.0, 0.0]])
    found = to_mid_scan(points, np.zeros(3), revolution_s=REVOLUTION_S, seam_rad=0.0, doppler_beta_s=BETA_S)
    assert_allclose(found, points, atol=1e-12)


def test_what_is_seen_straight_ahead_is_half_a_revolution_older_than_mid_scan() -> None:
    # At 10 m/s the car is 1.25 m nearer at mid-scan; behind, at mid-scan itself, nothing changes.
    twist = np.array([10.0, 0.0, 0.0])
    found = to_mid_scan(np.array([[40.0, 0.0], [-40.0, 0.0]]), twist, revolution_s=REVOLUTION_S, seam_rad=0.0)
    assert_allclose(found, [[38.75, 0.0], [-40.0, 0.0]], atol=1e-9)


def test_an_approaching_point_is_farther_than_it_appears() -> None:
    twist = np.array([10.0, 0.0, 0.0])
    points = np.array([[-40.0, 0.0]])  # behind: the car leaves it at 10 m/s, so it appears 0.49 m too far
    found = to_mid_scan(points, twist, revolution_s=REVOLUTION_S, seam_rad=0.0, doppler_beta_s=BETA_S)
    assert_allclose(found, [[-39.51, 0.0]], atol=1e-9)


@given(
    forward=st.floats(-30, 30),
    right=st.floats(-3, 3),
    yaw_rate=st.floats(-2, 2),
    turned=st.floats(1e-6, 6.28),
    seam_rad=st.floats(-0.1, 0.1),
    range_m=st.floats(3, 160),
)
def test_a_standing_point_comes_back_to_where_it_is(
    forward: float, right: float, yaw_rate: float, turned: float, seam_rad: float, range_m: float
) -> None:
    azimuth = seam_rad + turned
    time_s = (turned / (2 * math.pi) - 0.5) * REVOLUTION_S
    # The car's pose at that time in its frame at mid-scan, by the exponential of a 3 x 3 matrix.
    generator = np.array([[0, -yaw_rate, forward], [yaw_rate, 0, right], [0, 0, 0]])
    pose = expm(generator * time_s)
    place = pose[:2, :2] @ (range_m * beam(azimuth)) + pose[:2, 2]
    apparent_m = range_m - BETA_S * (np.array([forward, right]) @ beam(azimuth))
    found = to_mid_scan(
        (apparent_m * beam(azimuth))[None],
        np.array([forward, right, yaw_rate]),
        revolution_s=REVOLUTION_S,
        seam_rad=seam_rad,
        doppler_beta_s=BETA_S,
    )
    assert_allclose(found[0], place, atol=1e-6)  # series below a yaw of 1e-4 rad


def test_points_on_either_side_of_the_seam_are_a_revolution_apart() -> None:
    # The CTS350-X's first azimuth is centred 0.84 deg right of ahead, so its revolutions begin at 0.39 deg.
    seam_rad = math.radians(0.9 * (13 / 14 - 0.5))
    points = np.array([40 * beam(seam_rad - 0.001), 40 * beam(seam_rad + 0.001)])
    found = to_mid_scan(points, np.array([10.0, 0.0, 0.0]), revolution_s=REVOLUTION_S, seam_rad=seam_rad)
    assert_allclose(found - points, [[1.25, 0.0], [-1.25, 0.0]], atol=1e-3)


def test_batches_have_twists_and_revolutions_of_their_own() -> None:
    rng = np.random.default_rng(1)
    points, twists = rng.normal(0, 30, (2, 5, 2)), rng.normal(0, 3, (2, 3))
    durations, betas = np.array([[0.25], [0.2]]), np.array([[0.049], [-0.03]])
    found = to_mid_scan(points, twists, revolution_s=durations, seam_rad=0.0, doppler_beta_s=betas)
    for k in range(2):
        alone = to_mid_scan(
            points[k], twists[k], revolution_s=durations[k, 0], seam_rad=0.0, doppler_beta_s=betas[k, 0]
        )
        assert_allclose(found[k], alone)
