"""Fresnel's coefficients for any half space; tests/physics holds those of the materials."""

import math

import pytest
from hypothesis import given
from hypothesis import strategies as st

from echoscape.sim.raytracing.surface.fresnel import reflection


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
