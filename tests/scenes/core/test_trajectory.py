"""A trajectory is a C1 motion whose velocity is the exact derivative of its pose."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from numpy.testing import assert_allclose

from echoscape.scenes.core.trajectory import Trajectory


def _random(seed: int, knots: int) -> Trajectory:
    rng = np.random.default_rng(seed)
    return Trajectory(
        time_s=np.cumsum(rng.uniform(0.05, 0.5, knots)),
        state=rng.normal(size=(knots, 4)),
        rate=rng.normal(size=(knots, 4)),
    )


@settings(max_examples=30, deadline=None)
@given(seed=st.integers(0, 2**32 - 1), knots=st.integers(2, 12))
def test_velocity_is_the_derivative_of_pose(seed: int, knots: int) -> None:
    track = _random(seed, knots)
    time = np.linspace(track.time_s[0] + 1e-3, track.time_s[-1] - 1e-3, 50)
    clear = np.abs(time[:, None] - track.time_s).min(axis=1) > 2e-5
    slope = (track.pose(time + 1e-5) - track.pose(time - 1e-5)) / 2e-5
    # Central difference over 1e-5 s of a cubic: error h^2 / 6 times a third derivative below 12 x 6 / 0.05^3.
    assert_allclose(slope[clear], track.velocity(time)[clear], atol=2e-5)


@settings(max_examples=30, deadline=None)
@given(seed=st.integers(0, 2**32 - 1), knots=st.integers(3, 12))
def test_pose_and_velocity_are_continuous_at_knots(seed: int, knots: int) -> None:
    track = _random(seed, knots)
    inner = track.time_s[1:-1]
    for curve in (track.pose, track.velocity):
        assert_allclose(curve(inner - 1e-9), curve(inner + 1e-9), atol=1e-4)


def test_knots_are_interpolated() -> None:
    track = _random(1, 6)
    assert_allclose(track.pose(track.time_s), track.state, atol=1e-12)
    assert_allclose(track.velocity(track.time_s), track.rate, atol=1e-12)


def test_cubic_motion_is_reproduced() -> None:
    time = np.array([0.0, 0.7, 1.0, 2.5])
    cubic = np.polynomial.Polynomial([1.0, -2.0, 0.5, 0.3])
    track = Trajectory(
        time_s=time,
        state=np.repeat(cubic(time)[:, None], 4, axis=1),
        rate=np.repeat(cubic.deriv()(time)[:, None], 4, axis=1),
    )
    between = np.linspace(0, 2.5, 40)
    assert_allclose(track.pose(between)[:, 2], cubic(between), atol=1e-12)


def test_stands_still_outside_its_span() -> None:
    track = _random(2, 5)
    outside = np.array([track.time_s[0] - 3.0, track.time_s[-1] + 3.0])
    assert_allclose(track.pose(outside), track.state[[0, -1]], atol=1e-12)
    assert_allclose(track.velocity(outside), 0.0)


@pytest.mark.parametrize("broken", ["order", "shape", "single", "nan"])
def test_invalid_knots_are_refused(broken: str) -> None:
    time = np.array([0.0, 1.0]) if broken != "order" else np.array([1.0, 1.0])
    state = np.zeros((2, 3 if broken == "shape" else 4))
    if broken == "nan":
        state[0, 0] = np.nan
    if broken == "single":
        time, state = time[:1], state[:1]
    with pytest.raises(ValueError, match=r"time_s|state"):
        Trajectory(time_s=time, state=state, rate=np.zeros((len(time), 4)))
