"""Angles are reduced to one turn about zero."""

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from numpy.testing import assert_allclose

from echoscape.sim.numerics.angles import principal_angle


@given(st.floats(-1e3, 1e3))
def test_the_direction_is_kept_and_lies_within_half_a_turn(angle_rad: float) -> None:
    found = float(principal_angle(angle_rad))
    assert -math.pi <= found <= math.pi  # just below pi may be rounded up to it
    assert math.cos(found) == pytest.approx(math.cos(angle_rad), abs=1e-9)
    assert math.sin(found) == pytest.approx(math.sin(angle_rad), abs=1e-9)


def test_half_a_turn_becomes_minus_pi() -> None:
    assert_allclose(principal_angle([math.pi, -math.pi, 3 * math.pi]), -math.pi)


@pytest.mark.parametrize("kind", [np.float32, np.float64])
def test_shape_and_type_are_kept(kind: type) -> None:
    found = principal_angle(np.ones((2, 3), kind))
    assert (found.shape, found.dtype) == ((2, 3), kind)
