"""Matches that one rigid motion explains agree, and are found among others."""

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from echoscape.eval.methods.graph_matching import (
    compatibility,
    compatible_set,
    most_alike,
    principal_eigenvector,
)
from echoscape.sim.datasets.se2 import transform


def points(count: int, *, seed: int = 0) -> np.ndarray:
    return np.random.default_rng(seed).uniform(-100, 100, size=(count, 2))


def test_the_most_alike_is_that_of_the_largest_inner_product() -> None:
    earlier = np.array([[1.0, 0.0], [0.6, 0.8]])
    later = np.array([[0.0, 1.0], [0.8, 0.6], [1.0, 0.0]])
    assert most_alike(earlier, later).tolist() == [2, 1]


@given(st.floats(-50, 50), st.floats(-50, 50), st.floats(-math.pi, math.pi))
def test_matches_of_one_motion_agree_wholly(x: float, y: float, yaw: float) -> None:
    later = points(20)
    agreement = compatibility(transform([x, y, yaw], later), later, 0.5)
    np.testing.assert_allclose(agreement, 1 - np.eye(20), atol=1e-9)


def test_agreement_falls_with_the_square_of_the_difference() -> None:
    earlier = np.array([[0.0, 0.0], [10.0, 0.0]])
    for difference, expected in ((0.0, 1.0), (0.25, 0.75), (-0.25, 0.75), (0.5, 0.0), (3.0, 0.0)):
        later = np.array([[0.0, 0.0], [10.0 + difference, 0.0]])
        found = compatibility(earlier, later, 0.5)
        np.testing.assert_allclose(found, [[0, expected], [expected, 0]], atol=1e-12)


@pytest.mark.parametrize("outliers", [0, 20, 120])
def test_wrong_matches_are_left_out(outliers: int) -> None:
    # 120 of 180 matches are random: two of them agree by chance about once in 300.
    later = points(60 + outliers)
    earlier = transform([2.5, -0.4, 0.7], later)
    wrong = np.arange(60, 60 + outliers)
    earlier[wrong] = points(outliers, seed=5)
    found = compatible_set(compatibility(earlier, later, 0.5), np.arange(len(later)))
    assert set(range(60)) <= set(found.tolist())
    assert len(set(found.tolist()) - set(range(60))) <= 0.05 * outliers


def test_each_target_is_taken_once() -> None:
    later = points(30)
    target = np.concatenate([np.arange(30), np.arange(30)])
    right = transform([2.0, 1.0, 0.3], later)
    earlier = np.concatenate([right + np.random.default_rng(1).normal(0, 0.2, right.shape), right])
    found = compatible_set(compatibility(earlier, later[target], 0.5), target)
    assert len(found) == len(set(target[found].tolist()))
    assert sorted(found.tolist()) == list(range(30, 60))  # those that agree best


def test_nothing_is_taken_where_nothing_agrees() -> None:
    earlier = np.array([[0.0, 0.0], [1.0, 0.0], [5.0, 0.0]])
    assert len(compatible_set(compatibility(earlier, 3 * earlier, 0.5), np.arange(3))) == 0
    assert len(compatible_set(np.zeros((0, 0)), np.zeros(0, int))) == 0


@given(st.integers(2, 30), st.integers(0, 2**32 - 1))
def test_the_eigenvector_is_that_of_the_eigensolver(size: int, seed: int) -> None:
    matrix = np.random.default_rng(seed).uniform(0.2, 1, size=(size, size))
    matrix = np.triu(matrix, 1) + np.triu(matrix, 1).T
    expected = np.abs(np.linalg.eigh(matrix).eigenvectors[:, -1])
    np.testing.assert_allclose(principal_eigenvector(matrix), expected, atol=1e-6)


def test_the_eigenvector_of_a_star_is_found_too() -> None:
    # Its eigenvalues are of two signs and alike: plain power iteration alternates between two vectors.
    star = np.array([[0.0, 1.0, 1.0], [1.0, 0.0, 0.0], [1.0, 0.0, 0.0]])
    np.testing.assert_allclose(principal_eigenvector(star), [math.sqrt(0.5), 0.5, 0.5], atol=1e-9)
