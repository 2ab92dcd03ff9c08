"""Descriptors depend on the distances of keypoints, and on nothing else."""

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from echoscape.eval.methods.ring_descriptor import RingSettings, ring_descriptors
from echoscape.sim.datasets.se2 import transform

GRID = np.random.default_rng(0).integers(-40, 40, size=(50, 2)) + 0.0


def test_others_are_counted_by_ring() -> None:
    points = np.array([[0, 0], [0, 1.2], [0, -1.4], [3.1, 0], [0, 99]])
    found = ring_descriptors(points, RingSettings(width_m=1, reach_m=4))
    np.testing.assert_allclose(found[0] ** 2, [0, 2 / 3, 0, 1 / 3])
    np.testing.assert_allclose(found[4] ** 2, 0)


@given(st.floats(-300, 300), st.floats(-300, 300), st.sampled_from([0.0, math.pi / 2, math.pi]))
def test_a_motion_changes_nothing(x: float, y: float, yaw: float) -> None:
    # Distances of a grid are square roots of integers: none is so near to a ring's edge that rounding counts.
    settings = RingSettings(width_m=0.7 / math.sqrt(3), reach_m=100)
    moved = transform([x, y, yaw], GRID)
    np.testing.assert_allclose(ring_descriptors(moved, settings), ring_descriptors(GRID, settings))


def test_descriptors_have_unit_length() -> None:
    np.testing.assert_allclose(np.linalg.norm(ring_descriptors(GRID), axis=1), 1)


def test_descriptors_follow_the_order_of_the_keypoints() -> None:
    order = np.random.default_rng(1).permutation(len(GRID))
    np.testing.assert_array_equal(ring_descriptors(GRID[order]), ring_descriptors(GRID)[order])


@pytest.mark.parametrize("count", [0, 1])
def test_few_keypoints_have_empty_surroundings(count: int) -> None:
    found = ring_descriptors(np.zeros((count, 2)))
    assert found.shape == (count, 330)
    assert not found.any()


@pytest.mark.parametrize(("width_m", "reach_m"), [(0.0, 10.0), (math.nan, 10.0), (2.0, 1.0), (1.0, math.inf)])
def test_bad_settings_are_refused(width_m: float, reach_m: float) -> None:
    with pytest.raises(ValueError, match=r"(width|reach)_m must be finite and"):
        RingSettings(width_m=width_m, reach_m=reach_m)
