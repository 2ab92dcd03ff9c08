"""Reflection of a plane wave from a half space: Fresnel coefficients by material, incidence and polarisation.

ITU-R P.2040-3, eqs. (9b), (31a), (31b). Time dependence exp(+j w t), so losses make the permittivity's
imaginary part negative.
"""

import math

import numpy as np
from numpy.typing import ArrayLike, NDArray

from echoscape.scenes.core.materials import Material
from echoscape.sim.numerics.constants import VACUUM_PERMITTIVITY


def permittivity(material: Material, frequency_hz: float) -> complex:
    """Return the complex relative permittivity a f^b - j sigma / (2 pi f eps0), sigma = c f^d, f in GHz."""
    f_ghz = frequency_hz / 1e9
    conductivity = material.c * f_ghz**material.d
    loss = conductivity / (2 * math.pi * frequency_hz * VACUUM_PERMITTIVITY)
    return complex(material.a * f_ghz**material.b, -loss)


def reflection(epsilon: complex, cos_incidence: ArrayLike) -> tuple[NDArray, NDArray]:
    """Return the complex amplitude coefficients (TE, TM) of a half space of relative permittivity `epsilon`.

    `cos_incidence` is the cosine of the angle between ray and normal. Both agree in magnitude at normal
    incidence, with opposite sign (P.2040's convention for TM).
    """
    cos_i = np.asarray(cos_incidence, dtype=np.complex128)
    root = np.sqrt(epsilon - (1 - cos_i**2))
    te = (cos_i - root) / (cos_i + root)
    tm = (epsilon * cos_i - root) / (epsilon * cos_i + root)
    return te, tm


def reflected_power_table(materials: list[Material], frequency_hz: float, steps: int) -> NDArray[np.float32]:
    """Return |TE|^2 and |TM|^2 as (materials, steps + 1, 2) over even cosines of incidence from 0 to 1."""
    cosines = np.linspace(0.0, 1.0, steps + 1)
    rows = [reflection(permittivity(material, frequency_hz), cosines) for material in materials]
    return np.array([[np.abs(te) ** 2, np.abs(tm) ** 2] for te, tm in rows], np.float32).transpose(0, 2, 1)
