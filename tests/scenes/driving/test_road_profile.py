"""Both wheel tracks of a road have the spectrum of its class, and they belong to one isotropic surface."""

import numpy as np
import pytest
from numpy.testing import assert_allclose, assert_array_equal
from numpy.typing import NDArray
from scipy.signal import csd, welch
from scipy.special import k1

from echoscape.scenes.driving.road_profile import ROUGHNESS_M3, STEP_M, RoadProfile, road_profile

TRACK_M = 1.6


def road(samples: int, seed: int = 0, roughness_m3: float = ROUGHNESS_M3["B"]) -> RoadProfile:
    rng = np.random.default_rng(seed)
    return road_profile(np.full(samples, roughness_m3), track_m=TRACK_M, rng=rng)


@pytest.fixture(scope="module")
def tracks() -> NDArray[np.float64]:
    """Heights of the left and the right track over 200 km (2, S) [m]."""
    long = road(2_000_000)
    return np.stack([long.mean_m + long.difference_m / 2, long.mean_m - long.difference_m / 2])


@pytest.mark.parametrize("side", [0, 1])
def test_spectrum_of_a_track_is_that_of_its_class(tracks: NDArray[np.float64], side: int) -> None:
    n, density = welch(tracks[side], fs=1 / STEP_M, nperseg=4096, detrend="linear")
    for low, high in ((0.03, 0.1), (0.1, 0.3), (0.3, 1.0)):
        band = (n >= low) & (n < high)
        # ISO 8608, class B: 64e-6 m^3 at 0.1 cycles/m, falling with the square of the spatial frequency.
        expected = 64e-6 * (n[band] / 0.1) ** -2
        # Gamma-distributed roughness of 20,000 stretches: 1.1 %; a window that leaks: some 3 %.
        assert np.mean(density[band] / expected) == pytest.approx(1.0, abs=0.08)


def test_tracks_are_as_coherent_as_those_of_an_isotropic_surface(tracks: NDArray[np.float64]) -> None:
    n, cross = csd(*tracks, fs=1 / STEP_M, nperseg=1024, detrend="linear")
    _, left = welch(tracks[0], fs=1 / STEP_M, nperseg=1024, detrend="linear")
    at = np.searchsorted(n, [0.05, 0.1, 0.2, 0.4, 0.8])
    x = 2 * np.pi * n[at] * TRACK_M
    # Cross spectrum over spectrum is x K1(x) for a waviness of 2. The rational form is off by up to 0.05.
    assert_allclose(np.real(cross)[at] / left[at], x * k1(x), atol=0.07)


def test_heights_grow_with_the_root_of_the_roughness() -> None:
    smooth, rough = road(500, roughness_m3=64e-6), road(500, roughness_m3=256e-6)
    assert_allclose(rough.mean_m, 2 * smooth.mean_m, rtol=1e-12)
    assert_allclose(rough.difference_m, 2 * smooth.difference_m, rtol=1e-12)
    assert not road(500, roughness_m3=0.0).mean_m.any()


def test_first_metres_do_not_depend_on_how_many_follow() -> None:
    short, long = road(700), road(5000)
    assert_array_equal(long.mean_m[:700], short.mean_m)
    assert_array_equal(long.difference_m[:700], short.difference_m)
    assert short.mean_m[0] == short.difference_m[0] == 0
