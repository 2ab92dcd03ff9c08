"""Fresnel's coefficients for any half space; tests/physics holds those of the materials."""

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from echoscape.sim.raytracing.surface.fresnel import reflection, vertical_reflection


@given(epsilon=st.floats(1.01, 40.0), cosine=st.floats(0.01, 1.0))
def test_lossless_half_space_reflects_and_transmits_all_power(epsilon: float, cosine: float) -> None:
    root = math.sqrt(epsilon - 1 + cosine**2)  # normal wave number inside, over that of free space
    te, tm = reflection(complex(epsilon), cosine)
    transmitted_te = 2 * cosine / (cosine + root)
    transmitted_tm = 2 * math.sqrt(epsilon) * cosine / (epsilon * cosine + root)
    assert abs(te) ** 2 + transmitted_te**2 * root / cosine == pytest.approx(1.0, abs=1e-9)
    assert abs(tm) ** 2 + transmitted_tm**2 * root / cosine == pytest.approx(1.0, abs=1e-9)


@given(real=st.floats(1.5, 40.0), loss=st.floats(0.0, 10.0))
def test_polarisations_agree_at_normal_incidence(real: float, loss: float) -> None:
    te, tm = reflection(complex(real, -loss), 1.0)
    assert abs(te) == pytest.approx(abs(tm), rel=1e-12)


@given(cosine=st.floats(0.02, 0.999), real=st.floats(1.2, 20.0), loss=st.floats(0.0, 5.0))
def test_vertical_wave_is_tm_at_level_ground_and_te_at_an_upright_wall(
    cosine: float, real: float, loss: float
) -> None:
    epsilon, sine = complex(real, -loss), math.sqrt(1 - cosine**2)
    te, tm = reflection(epsilon, cosine)
    down = np.array([[sine, 0.0, -cosine]])
    assert vertical_reflection(epsilon, down, np.array([0.0, 0.0, 1.0]))[0] == pytest.approx(complex(tm))
    level = np.array([[cosine, sine, 0.0]])
    assert vertical_reflection(epsilon, level, np.array([-1.0, 0.0, 0.0]))[0] == pytest.approx(complex(te))


def test_perfect_conductor_turns_the_phase_of_a_vertical_wave_at_walls_alone() -> None:
    conductor = 1 - 1e12j
    square = vertical_reflection(conductor, np.array([[1.0, 0.0, 0.0]]), np.array([-1.0, 0.0, 0.0]))
    assert square[0] == pytest.approx(-1.0, abs=1e-5)
    ground = vertical_reflection(conductor, np.array([[0.8, 0.0, -0.6]]), np.array([0.0, 0.0, 1.0]))
    assert ground[0] == pytest.approx(1.0, abs=1e-5)


@given(tilt=st.floats(-0.5, 0.5), bearing=st.floats(-1.2, 1.2), fall=st.floats(-0.5, 0.5))
def test_vertical_reflection_is_the_same_both_ways(tilt: float, bearing: float, fall: float) -> None:
    normal = np.array([-math.cos(tilt), 0.0, math.sin(tilt)])
    direction = np.array(
        [math.cos(bearing) * math.cos(fall), math.sin(bearing) * math.cos(fall), math.sin(fall)]
    )
    if direction @ normal > -0.05:
        return
    reflected = direction - 2 * (direction @ normal) * normal
    there = vertical_reflection(4 - 0.5j, direction[None], normal)[0]
    back = vertical_reflection(4 - 0.5j, -reflected[None], normal)[0]
    assert there == pytest.approx(back, abs=1e-12)
