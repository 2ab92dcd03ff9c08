"""Gaussian smoothing is that of SciPy."""

import numpy as np
import pytest
from scipy import ndimage

from echoscape.scenes.core.gaussian import gaussian_filter1d


@pytest.mark.parametrize("mode", ["reflect", "nearest", "wrap"])
@pytest.mark.parametrize("sigma", [0.7, 5.0])
def test_smoothing_is_that_of_scipy(mode: str, sigma: float) -> None:
    values = np.random.default_rng(2).normal(size=(80, 2))
    found = gaussian_filter1d(values, sigma, axis=0, mode=mode, truncate=3.0)
    expected = ndimage.gaussian_filter1d(values, sigma, axis=0, mode=mode, truncate=3.0)  # type: ignore[arg-type]
    np.testing.assert_allclose(found, expected, rtol=0, atol=1e-14)
