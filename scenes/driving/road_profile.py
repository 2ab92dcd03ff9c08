"""The unevenness of a road along both wheel tracks, as ISO 8608 classes it.

The displacement spectrum of one track is Gd(n0) (n / n0)^-2 with n0 = 0.1 cycles/m (ISO 8608:2016), flat
below 0.01 cycles/m. Both tracks belong to one isotropic surface (Dodds & Robson, J. Sound Vib. 31(2), 1973):
at a distance b their coherence is x K1(x), x = 2 pi n b, which c^2 / (x^2 + c^2) with c^2 = 1.3 meets within
0.05. Mean and difference of the tracks are then independent, and each is white noise through first-order
filters.

Here and there real roads are far less even than their mean spectrum: patches, covers, ramps. Their local
roughness is drawn from a gamma distribution, stretch by stretch, so that heights are Laplacian rather than
Gaussian (Bogsjo, Podgorski & Rychlik, Vehicle System Dynamics 50(5), 2012).
"""

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

ROUGHNESS_M3 = {"A": 16e-6, "B": 64e-6, "C": 256e-6, "D": 1024e-6, "E": 4096e-6}
"""Degree of roughness Gd(n0) of the classes of ISO 8608, geometric mean [m^3]."""
STEP_M = 0.1
"""Distance between samples: the length of a tyre's footprint, which averages what is shorter [m]."""

STRETCH_M = 10.0
"""Length of a stretch of equal roughness [m]."""
EVENNESS = 0.4
"""Shape of the gamma distribution of the roughness of stretches; calibrated to the 99 % quantile of the pitch
of real cars, which is four times its standard deviation."""

_REFERENCE = 0.1
_LOWEST = 0.01
_CORNER = math.sqrt(1.3)


@dataclass(frozen=True, kw_only=True)
class RoadProfile:
    """Heights along a road, every `STEP_M` from its start, before which it is flat.

    Attributes:
        mean_m: Mean of both wheel tracks (S,) [m].
        difference_m: Left less right track (S,) [m].
    """

    mean_m: NDArray[np.float64]
    difference_m: NDArray[np.float64]


def road_profile(
    roughness_m3: NDArray[np.float64], *, track_m: float, rng: np.random.Generator
) -> RoadProfile:
    """Draw the unevenness of a road.

    The first samples do not depend on how many follow.

    Args:
        roughness_m3: Degree of roughness Gd(n0) at every sample (S,) [m^3].
        track_m: Distance of the two wheel tracks [m].
        rng: Draws the unevenness.

    Returns:
        The heights.
    """
    rough_rng, height_rng = rng.spawn(2)
    stretch = np.arange(len(roughness_m3)) // round(STRETCH_M / STEP_M)
    local = rough_rng.standard_gamma(EVENNESS, stretch[-1] + 1)[stretch] / EVENNESS
    # Slopes of a spectrum of waviness 2 are white, one-sided (2 pi n0)^2 Gd(n0) [m].
    slope = 2 * math.pi * _REFERENCE * np.sqrt(roughness_m3 * local / (2 * STEP_M))
    common, opposite = height_rng.standard_normal((len(slope), 2)).T * slope
    common[0] = opposite[0] = 0.0
    corner, lowest = _CORNER / track_m, 2 * math.pi * _LOWEST
    # Half the power of a track where the tracks are independent, all of it where they are alike.
    together = _filtered(common, (math.sqrt(0.5), corner), corner)
    return RoadProfile(
        mean_m=_filtered(together, (0.0, 1.0), lowest),
        difference_m=_filtered(opposite, (0.0, math.sqrt(2)), corner),
    )


def _filtered(
    signal: NDArray[np.float64], above: tuple[float, float], pole_per_m: float
) -> NDArray[np.float64]:
    """Return a signal (S,) after (above[0] s + above[1]) / (s + pole_per_m), by the bilinear transform."""
    from scipy.signal import lfilter  # slow to import; a drive that is known needs none

    k = 2 / STEP_M
    numerator = [above[0] * k + above[1], above[1] - above[0] * k]
    return np.asarray(lfilter(numerator, [k + pole_per_m, pole_per_m - k], signal))
