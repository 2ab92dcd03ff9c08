"""Reflection of a plane wave from a half space: Fresnel coefficients by material, incidence and polarisation.

ITU-R P.2040-3, eqs. (9b), (31a), (31b). Time dependence exp(+j w t), so losses make the imaginary part of the
permittivity negative.
"""

import math

import numpy as np
from numpy.typing import ArrayLike, NDArray

from echoscape.scenes.core.materials import Material
from echoscape.sim.numerics.constants import VACUUM_PERMITTIVITY


def permittivity(material: Material, frequency_hz: float) -> complex:
    """Return the complex relative permittivity a f^b - j sigma / (2 pi f eps0) of a material.

    Its conductivity is sigma = c f^d, with f in GHz in both powers (ITU-R P.2040-3).

    Args:
        material: The material, which gives a, b, c and d.
        frequency_hz: Frequency [Hz].

    Returns:
        The permittivity; losses make its imaginary part negative.
    """
    f_ghz = frequency_hz / 1e9
    conductivity = material.c * f_ghz**material.d
    loss = conductivity / (2 * math.pi * frequency_hz * VACUUM_PERMITTIVITY)
    return complex(material.a * f_ghz**material.b, -loss)


def reflection(epsilon: complex, cos_incidence: ArrayLike) -> tuple[NDArray, NDArray]:
    """Return the reflection coefficients of a half space (ITU-R P.2040-3, eqs. (31a), (31b)).

    At normal incidence both have the same magnitude and opposite signs (the convention of P.2040 for TM).

    Args:
        epsilon: Complex relative permittivity.
        cos_incidence: Cosine of the angle between ray and normal, of any shape.

    Returns:
        Complex amplitude coefficients for TE and TM, of the same shape.
    """
    cos_i = np.asarray(cos_incidence, dtype=np.complex128)
    root = np.sqrt(epsilon - (1 - cos_i**2))
    te = (cos_i - root) / (cos_i + root)
    tm = (epsilon * cos_i - root) / (epsilon * cos_i + root)
    return te, tm


def vertical_reflection(
    epsilon: complex, direction: NDArray[np.float64], normal: NDArray[np.float64]
) -> NDArray[np.complex128]:
    """Return the amplitude of a vertically polarised wave after a mirror, as a vertical antenna receives it.

    The wave is split into TE and TM by the plane of incidence, and both are projected on the vertical of the
    reflected direction: TE alone at an upright wall, TM alone at level ground.

    Args:
        epsilon: Complex relative permittivity of the mirror.
        direction: Unit directions of incidence (N, 3), none of them vertical.
        normal: Unit normals on the side of the wave (3,) or (N, 3).

    Returns:
        Complex amplitude coefficients (N,).
    """
    normal = np.broadcast_to(normal, direction.shape)
    cosine = -np.einsum("nk,nk->n", direction, normal)
    reflected = direction + 2 * cosine[:, None] * normal
    te, tm = reflection(epsilon, np.clip(cosine, 0, 1))
    across = np.cross(direction, normal)
    square = np.linalg.norm(across, axis=1) < 1e-6  # no plane of incidence: both waves are reflected alike
    across[square] = np.cross(direction[square], [0.0, 0.0, 1.0])
    across /= np.maximum(np.linalg.norm(across, axis=1), 1e-12)[:, None]
    verticals = [_vertical(each) for each in (direction, reflected)]
    te_part, tm_part = (
        np.prod([np.einsum("nk,nk->n", up, axis) for up, axis in zip(verticals, axes, strict=True)], axis=0)
        for axes in ((across, across), (np.cross(direction, across), np.cross(reflected, across)))
    )
    return te * te_part + tm * tm_part


def _vertical(direction: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return the unit vectors (N, 3) across directions (N, 3) that are nearest to the vertical."""
    up = np.array([0.0, 0.0, 1.0]) - direction * direction[:, 2:]
    return up / np.maximum(np.linalg.norm(up, axis=1), 1e-12)[:, None]


def reflected_power_table(materials: list[Material], frequency_hz: float, steps: int) -> NDArray[np.float32]:
    """Tabulate the reflected power over the cosine of incidence.

    Args:
        materials: The materials.
        frequency_hz: Frequency [Hz].
        steps: Number of even steps of the cosine from 0 to 1.

    Returns:
        |TE|^2 and |TM|^2 (materials, steps + 1, 2) float32.
    """
    cosines = np.linspace(0.0, 1.0, steps + 1)
    pairs = [reflection(permittivity(material, frequency_hz), cosines) for material in materials]
    return np.array([[np.abs(te) ** 2, np.abs(tm) ** 2] for te, tm in pairs], np.float32).transpose(0, 2, 1)
