"""Headings of successive vectors go on without jumps."""

import numpy as np
import pytest
from numpy.testing import assert_allclose

from echoscape.scenes.core.headings import unwrapped_headings


@pytest.mark.parametrize("turn_rad", [0.3, -0.3, 3.0, -3.0])
def test_headings_count_full_turns_whatever_the_lengths(turn_rad: float) -> None:
    heading = 0.5 + turn_rad * np.arange(40)
    length = np.random.default_rng(1).uniform(0.1, 20.0, 40)
    vectors = length[:, None] * np.stack([np.cos(heading), np.sin(heading)], axis=-1)
    assert_allclose(unwrapped_headings(vectors), heading, atol=1e-9)


def test_no_vectors_have_no_headings() -> None:
    assert unwrapped_headings(np.zeros((0, 2))).shape == (0,)
