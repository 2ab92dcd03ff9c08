"""Decibels: ten are a factor of ten, sums are products, shapes stay."""

import numpy as np
import pytest

from echoscape.sim.numerics.decibels import power_ratio

SINGLE = 1.2e-7
"""Rounding to single precision."""


@pytest.mark.parametrize(("level_db", "ratio"), [(0, 1), (10, 10), (-20, 0.01), (3, 1.9952623)])
def test_levels_are_ratios_of_power(level_db: float, ratio: float) -> None:
    assert power_ratio(level_db) == pytest.approx(ratio, rel=SINGLE)


def test_sums_of_levels_are_products_of_ratios() -> None:
    levels = np.linspace(-120, 60, 181).reshape(-1, 1)
    found = power_ratio(levels + 7.0)
    assert found.shape == levels.shape
    np.testing.assert_allclose(found, power_ratio(levels) * power_ratio(7.0), rtol=3 * SINGLE)


def test_ratios_are_numbers_of_single_precision() -> None:
    found = power_ratio(np.linspace(-100, 100, 999))
    assert (found == found.astype(np.float32)).all()
