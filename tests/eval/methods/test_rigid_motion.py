"""Rigid motions come out exactly from exact points, among wrong matches as well."""

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from echoscape.eval.methods.rigid_motion import RansacSettings, distances, fit_motions, ransac_motion
from echoscape.sim.datasets.se2 import transform, wrapped

MOTIONS = st.tuples(st.floats(-50, 50), st.floats(-50, 50), st.floats(-3.1, 3.1))


def points(count: int, *, seed: int = 0) -> np.ndarray:
    return np.random.default_rng(seed).uniform(-100, 100, size=(count, 2))


def assert_motion(found: np.ndarray, expected: tuple[float, float, float], *, atol: float) -> None:
    np.testing.assert_allclose(found[:2], expected[:2], atol=atol)
    assert abs(wrapped(found[2] - expected[2])) < atol


@given(MOTIONS, st.integers(2, 40))
def test_a_motion_of_exact_points_comes_out(motion: tuple[float, float, float], count: int) -> None:
    later = points(count)
    assert_motion(fit_motions(transform(motion, later), later), motion, atol=1e-9)


@given(MOTIONS, st.integers(3, 20), st.integers(0, 2**32 - 1))
def test_least_squares_is_the_solution_by_singular_values(
    motion: tuple[float, float, float], count: int, seed: int
) -> None:
    rng = np.random.default_rng(seed)
    later = rng.uniform(-100, 100, size=(count, 2))
    earlier = transform(motion, later) + rng.normal(0, 2, size=later.shape)
    # Umeyama's equations (40) and (41), with the reflection excluded.
    covariance = (earlier - earlier.mean(axis=0)).T @ (later - later.mean(axis=0))
    u, _, vt = np.linalg.svd(covariance)
    rotation = u @ np.diag([1, np.linalg.det(u @ vt)]) @ vt
    translation = earlier.mean(axis=0) - rotation @ later.mean(axis=0)
    yaw = math.atan2(rotation[1, 0], rotation[0, 0])
    assert_motion(fit_motions(earlier, later), (*translation, yaw), atol=1e-6)


def test_many_sets_are_fitted_at_once() -> None:
    later = points(24).reshape(2, 3, 4, 2)
    earlier = later + np.arange(6.0).reshape(2, 3, 1, 1)
    found = fit_motions(earlier, later)
    np.testing.assert_allclose(found[..., 0], [[0, 1, 2], [3, 4, 5]], atol=1e-9)
    np.testing.assert_allclose(found[..., 2], 0, atol=1e-9)


def test_distances_are_those_of_the_moved_points() -> None:
    found = distances(np.array([[1.0, 0.0, math.pi / 2]]), np.array([[1.0, 3.0]]), np.array([[2.0, 0.0]]))
    np.testing.assert_allclose(found, [[1.0]])  # (2, 0) goes to (1, 2)


@given(MOTIONS, st.integers(0, 2**32 - 1))
def test_a_motion_comes_out_exactly_among_as_many_wrong_matches(
    motion: tuple[float, float, float], seed: int
) -> None:
    later = points(80, seed=1)
    earlier = transform(motion, later)
    earlier[40:] += 500 + points(40, seed=2)  # far off: no motion brings them close
    # No sample of 100 is right with a probability of (3/4)^100 < 1e-12.
    found, inliers = ransac_motion(earlier, later, rng=np.random.default_rng(seed))
    assert inliers.tolist() == [True] * 40 + [False] * 40
    assert_motion(found.array, motion, atol=1e-9)


def test_matches_count_up_to_the_given_distance() -> None:
    later = points(40)
    earlier = later.copy()
    earlier[0] += [0.3, 0]
    for inlier_m, expected in ((0.35, 40), (0.25, 39)):
        settings = RansacSettings(inlier_m=inlier_m)
        # 2 of 40 points are drawn 100 times: pairs without the first one are among them.
        _, inliers = ransac_motion(earlier, later, settings, rng=np.random.default_rng(0))
        assert inliers.sum() == expected


def test_no_inliers_where_no_two_matches_agree() -> None:
    later = points(12)
    _, inliers = ransac_motion(3 * later, later, rng=np.random.default_rng(0))
    assert not inliers.any()


def test_one_match_is_refused() -> None:
    with pytest.raises(ValueError, match="a motion needs two matches or more, got 1"):
        ransac_motion(points(1), points(1), rng=np.random.default_rng(0))


@pytest.mark.parametrize(("name", "value"), [("inlier_m", 0.0), ("inlier_m", math.inf), ("samples", 0)])
def test_bad_settings_are_refused(name: str, value: float) -> None:
    with pytest.raises(ValueError, match=f"{name} must be"):
        RansacSettings(**{name: value})  # pyright: ignore[reportArgumentType]
