"""Rain: attenuation of echoes and backscatter of drops.

Attenuation is that of ITU-R P.838-3, k R^alpha [dB/km]. Backscatter is summed over the drops of Marshall &
Palmer (J. Meteorology 5, 1948) by Mie's series (Bohren & Huffman, 1983, ch. 4) for water of ITU-R P.840-8 at
10 degrees C: at 76.5 GHz drops are as large as the wavelength / pi, beyond Rayleigh scattering.
"""

import math
from collections.abc import Callable
from functools import lru_cache

import numpy as np
from numpy.typing import NDArray
from scipy.special import spherical_jn, spherical_yn

from echoscape.sim.numerics.constants import SPEED_OF_LIGHT
from echoscape.sim.numerics.decibels import power_ratio
from echoscape.sim.receiver.if_signal import BIN_CENTRE, CELL_BINS, grid_cells
from echoscape.sim.sensor.antenna import Antenna
from echoscape.sim.sensor.link_budget import link_w_m2
from echoscape.sim.sensor.sensor import Sensor

_Fit = tuple[tuple[tuple[float, float, float], ...], tuple[float, float]]

# ITU-R P.838-3, Tables 1-4: (a_j, b_j, c_j) and (m, c) of log10 k and of alpha, for vertical polarisation.
_LOG_K: _Fit = (
    (
        (-3.80595, 0.56934, 0.81061),
        (-3.44965, -0.22911, 0.51059),
        (-0.39902, 0.73042, 0.11899),
        (0.50167, 1.07319, 0.27195),
    ),
    (-0.16398, 0.63297),
)
_ALPHA: _Fit = (
    (
        (-0.07771, 2.33840, -0.76284),
        (0.56727, 0.95545, 0.54039),
        (-0.20238, 1.14520, 0.26809),
        (-48.2991, 0.791669, 0.116226),
        (48.5833, 0.791459, 0.116479),
    ),
    (-0.053739, 0.83433),
)

_NEAREST_M = 1.0
"""Drops nearer than this are on the radome, which is not modelled [m]."""
_TEMPERATURE_K = 283.15


def specific_attenuation_db_km(rate_mm_h: float, frequency_hz: float) -> float:
    """Return the attenuation of vertically polarised waves in rain, k R^alpha (ITU-R P.838-3 eq. (1)).

    Args:
        rate_mm_h: Rain rate R [mm/h].
        frequency_hz: Frequency [Hz].

    Returns:
        Attenuation [dB/km].
    """
    log_f = math.log10(frequency_hz / 1e9)

    def fitted(table: _Fit) -> float:
        terms, (slope, constant) = table
        return sum(a * math.exp(-(((log_f - b) / c) ** 2)) for a, b, c in terms) + slope * log_f + constant

    return 10 ** fitted(_LOG_K) * rate_mm_h ** fitted(_ALPHA)


def water_permittivity(frequency_hz: float) -> complex:
    """Return the complex relative permittivity of water at 10 degrees C (ITU-R P.840-8).

    Args:
        frequency_hz: Frequency [Hz].

    Returns:
        Permittivity; losses make its imaginary part negative.
    """
    theta, f_ghz = 300 / _TEMPERATURE_K, frequency_hz / 1e9
    eps0 = 77.66 + 103.3 * (theta - 1)
    eps1, eps2 = 0.0671 * eps0, 3.52
    principal = 20.20 - 146 * (theta - 1) + 316 * (theta - 1) ** 2
    secondary = 39.8 * principal
    real = (
        (eps0 - eps1) / (1 + (f_ghz / principal) ** 2) + (eps1 - eps2) / (1 + (f_ghz / secondary) ** 2) + eps2
    )
    imag = f_ghz * (eps0 - eps1) / (principal * (1 + (f_ghz / principal) ** 2))
    imag += f_ghz * (eps1 - eps2) / (secondary * (1 + (f_ghz / secondary) ** 2))
    return complex(real, -imag)


def mie_cross_sections(diameter_m: float, frequency_hz: float) -> tuple[float, float]:
    """Return radar and extinction cross-section of a drop of water (Bohren & Huffman 1983, ch. 4).

    sigma = lambda^2 / (4 pi) |sum (2n + 1) (-1)^n (a_n - b_n)|^2,
    extinction = lambda^2 / (2 pi) sum (2n + 1) Re(a_n + b_n).

    Args:
        diameter_m: Diameter of the drop [m].
        frequency_hz: Frequency [Hz].

    Returns:
        Radar cross-section and extinction cross-section [m^2].
    """
    wavelength_m = SPEED_OF_LIGHT / frequency_hz
    x = math.pi * diameter_m / wavelength_m
    index = complex(np.sqrt(water_permittivity(frequency_hz).conjugate()))  # Bohren: exp(-j w t)
    n = np.arange(1, int(x + 4 * x ** (1 / 3) + 10) + 1)
    psi, psi_slope = _riccati(n, x, spherical_jn)
    chi, chi_slope = _riccati(n, x, spherical_yn)
    xi, xi_slope = psi + 1j * chi, psi_slope + 1j * chi_slope
    inner, inner_slope = _riccati(n, index * x, spherical_jn)
    a = (index * inner * psi_slope - psi * inner_slope) / (index * inner * xi_slope - xi * inner_slope)
    b = (inner * psi_slope - index * psi * inner_slope) / (inner * xi_slope - index * xi * inner_slope)
    back = wavelength_m**2 / (4 * math.pi) * abs(np.sum((2 * n + 1) * (-1.0) ** n * (a - b))) ** 2
    return float(back), float(wavelength_m**2 / (2 * math.pi) * np.sum((2 * n + 1) * (a + b).real))


def _riccati(n: NDArray, x: complex, bessel: Callable[..., NDArray]) -> tuple[NDArray, NDArray]:
    """Return x z_n(x) and its derivative for a spherical Bessel function z."""
    return x * bessel(n, x), bessel(n, x) + x * bessel(n, x, derivative=True)


@lru_cache(maxsize=8)
def drops(rate_mm_h: float, frequency_hz: float) -> tuple[float, float]:
    """Return reflectivity and extinction of rain, summed over drop sizes (Marshall & Palmer 1948).

    Args:
        rate_mm_h: Rain rate, above 0 [mm/h].
        frequency_hz: Frequency [Hz].

    Returns:
        Reflectivity [m^2/m^3] and extinction [dB/km].
    """
    diameter_mm = (np.arange(700) + 0.5) * 0.01
    density = 8000 * np.exp(-4.1 * rate_mm_h**-0.21 * diameter_mm) * 0.01  # drops per cubic metre
    sections = np.array([mie_cross_sections(each * 1e-3, frequency_hz) for each in diameter_mm])
    back, extinction = density @ sections
    return float(back), float(extinction * 1e3 * 10 / math.log(10))


def rain_gain(range_m: NDArray, rate_mm_h: float, sensor: Sensor) -> NDArray[np.float64]:
    """Return the two-way amplitude gain of rain.

    Args:
        range_m: Ranges of echoes, of any shape [m].
        rate_mm_h: Rain rate [mm/h].
        sensor: The radar.

    Returns:
        Factors on the amplitude, of the same shape, at most 1.
    """
    lost_db = specific_attenuation_db_km(rate_mm_h, sensor.carrier_hz) * 2e-3 * np.asarray(range_m)
    return np.sqrt(power_ratio(-lost_db))


def rain_power_w(
    sensor: Sensor, antenna: Antenna, *, rate_mm_h: float, clear: NDArray[np.float32]
) -> NDArray[np.float32]:
    """Return the mean power of the echoes of rain in each cell of the grid.

    A shell of thickness dr returns link / (4 pi) eta dr / r^2 times the solid angle of the two-way pattern.
    Objects on the vehicle attenuate it as they do echoes.

    Args:
        sensor: The radar.
        antenna: Its patterns.
        rate_mm_h: Rain rate, above 0 [mm/h].
        clear: Share of the beam that reaches each cell, ended by neither road nor buildings (azimuths,
            fft_size / 4).

    Returns:
        Mean powers (azimuths, fft_size / 4) float32 [W].
    """
    cell_m = CELL_BINS * sensor.bin_m
    range_m = np.arange(grid_cells(sensor)) * cell_m + BIN_CENTRE * sensor.bin_m
    reflectivity, _ = drops(rate_mm_h, sensor.carrier_hz)
    shell = link_w_m2(sensor) / (4 * math.pi) * reflectivity * cell_m * antenna.two_way_energy_sr
    in_range = (range_m > _NEAREST_M) & (range_m < sensor.range_m)
    power = shell / range_m**2 * in_range * rain_gain(range_m, rate_mm_h, sensor) ** 2
    return clear * np.outer(power_ratio(-sensor.azimuth_loss_db), power).astype(np.float32)


def rain_grid(power_w: NDArray[np.float32], *, rng: np.random.Generator) -> NDArray[np.complex64]:
    """Draw the echoes of rain, circular complex Gaussian.

    Drops rearrange within a millisecond, so every azimuth and cell is drawn independently.

    Args:
        power_w: Mean powers (azimuths, cells) float32 [W].
        rng: Draws the amplitudes.

    Returns:
        Amplitudes (azimuths, cells) complex64 [sqrt(W)].
    """
    draws = rng.standard_normal((*power_w.shape, 2), dtype=np.float32).view(np.complex64)[..., 0]
    draws *= np.sqrt(power_w / 2)
    return draws
