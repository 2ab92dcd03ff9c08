import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from echoscape.scenes.materials import MATERIALS
from echoscape.sim.fresnel import permittivity, reflection

CARRIER_HZ = 76.5e9


@pytest.mark.parametrize(
    ("name", "epsilon", "reflection_db"),
    [
        ("concrete", 5.24 - 0.32j, -8.12),
        ("glass", 6.31 - 0.28j, -7.31),
        ("wood", 1.99 - 0.12j, -15.3),
        ("brick", None, -9.7),
        ("asphalt", None, -8.3),
        ("metal", None, -0.01),
    ],
)
def test_materials_reflect_as_the_recommendation_says(
    name: str, epsilon: complex | None, reflection_db: float
) -> None:
    found = permittivity(MATERIALS[name], CARRIER_HZ)
    if epsilon is not None:
        assert abs(found - epsilon) < 0.01  # the table gives two decimals
    te, _ = reflection(found, 1.0)
    assert 20 * math.log10(abs(te)) == pytest.approx(reflection_db, abs=0.05)


def test_rows_used_beyond_their_band_say_so() -> None:
    for material in MATERIALS.values():
        if not material.band_ghz[0] <= CARRIER_HZ / 1e9 <= material.band_ghz[1]:
            assert "beyond its band" in material.roughness_source, material.name


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


def test_concrete_has_its_brewster_angle() -> None:
    angles = np.radians(np.linspace(50.0, 80.0, 3001))
    _, tm = reflection(permittivity(MATERIALS["concrete"], CARRIER_HZ), np.cos(angles))
    assert math.degrees(angles[np.argmin(np.abs(tm))]) == pytest.approx(66.4, abs=0.1)
