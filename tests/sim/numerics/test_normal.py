"""Draws have the normal distribution's law, and are independent."""

import math

import numpy as np
import pytest
from scipy import stats

from echoscape.sim.numerics.normal import standard_normal


def test_draws_have_the_normal_law() -> None:
    drawn = standard_normal((1000, 1000), rng=np.random.default_rng(3)).ravel().astype(np.float64)
    # Standard errors of a million draws: 1e-3, 1.4e-3 / 2, 4.9e-3; four of each. The cut tail takes 5e-4.
    assert abs(drawn.mean()) < 4e-3
    assert drawn.var() == pytest.approx(1, abs=4 * math.sqrt(2e-6))
    assert (drawn**4).mean() == pytest.approx(3, abs=4 * math.sqrt(96e-6))
    assert stats.kstest(drawn, "norm").pvalue > 1e-3


def test_every_bit_of_a_word_is_a_draw_of_its_own() -> None:
    drawn = standard_normal((250_000, 4), rng=np.random.default_rng(5)).astype(np.float64)
    correlation = np.corrcoef(drawn.T) - np.eye(4)
    assert np.abs(correlation).max() < 4 / math.sqrt(250_000)
    neighbours = np.corrcoef(drawn.ravel()[:-1], drawn.ravel()[1:])[0, 1]
    assert abs(neighbours) < 4 / 1000


@pytest.mark.parametrize("shape", [(0,), (1,), (3, 5), (2, 0), (7,)])
def test_draws_have_the_shape_asked_for(shape: tuple[int, ...]) -> None:
    drawn = standard_normal(shape, rng=np.random.default_rng(0))
    assert drawn.shape == shape
    assert drawn.dtype == np.float32
