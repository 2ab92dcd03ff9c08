"""Plane mirrors in which coherent targets are seen: the method of images.

A mirror images the antenna. A leg of a path by way of it is as long as from the image, and carries the
complex Fresnel coefficient of a vertically polarised wave times the root of the mirror part of the reflected
power (`sim.raytracing.surface.scattering`).
"""

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from echoscape.scenes.core.materials import MATERIALS
from echoscape.sim.raytracing.surface.fresnel import permittivity, vertical_reflection
from echoscape.sim.raytracing.surface.scattering import roughened
from echoscape.sim.settings.surfaces import SurfaceSettings

SAME_NORMAL, SAME_PLANE_M = 1 - 1e-6, 2e-3
"""Faces of one mirror: cosine between their normals, and distance from its plane [m]."""
NEAREST_M = 1e-2
"""Antenna and target lie at least this far in front of a mirror [m]."""

Vectors = NDArray[np.float64]


@dataclass(frozen=True, kw_only=True)
class Mirror:
    """One plane mirror.

    Attributes:
        normal: Unit normal (3,) float64, on the side of antenna and target.
        offset_m: Distance of the plane from the origin along the normal [m].
        material: Material id.
        instance: Instance id of the face nearest to the specular point.
    """

    normal: NDArray[np.float64]
    offset_m: float
    material: int
    instance: int

    def image(self, points: Vectors) -> Vectors:
        """Return the mirror images of points.

        Args:
            points: Points (..., 3) [m].

        Returns:
            Their images (..., 3) [m].
        """
        return points - 2 * (points @ self.normal - self.offset_m)[..., None] * self.normal


class MirrorMaterials:
    """What mirrors of each material do to the amplitude of a wave."""

    def __init__(
        self, *, carrier_hz: float, wavelength_m: float, surfaces: SurfaceSettings | None = None
    ) -> None:
        """Tabulate the materials.

        Args:
            carrier_hz: Carrier frequency [Hz].
            wavelength_m: Its wavelength [m].
            surfaces: Changes to the roughness of the materials; None is none.
        """
        self._wavelength_m = wavelength_m
        self._materials = [roughened(each, surfaces or SurfaceSettings()) for each in MATERIALS.values()]
        self._epsilon = [permittivity(each, carrier_hz) for each in self._materials]

    def coefficient(self, mirror: Mirror, image: Vectors, points: Vectors) -> NDArray[np.complex128]:
        """Return the amplitude factor of legs by way of a mirror.

        Args:
            mirror: The mirror.
            image: Image of the antenna in it (3,) [m].
            points: Where the legs meet the target (S, 3) [m].

        Returns:
            Fresnel coefficient times the root of the mirror's share of the reflected power (S,).
        """
        away = points - image
        direction = away / np.linalg.norm(away, axis=1)[:, None]
        cosine = direction @ mirror.normal
        incident = direction - 2 * cosine[:, None] * mirror.normal
        material = self._materials[mirror.material]
        gamma = vertical_reflection(self._epsilon[mirror.material], incident, mirror.normal)
        rough = 4 * math.pi * material.rms_height_m * cosine / self._wavelength_m
        return gamma * np.sqrt(1 - material.scattering**2) * np.exp(-np.square(rough) / 2)


def specular_points(normal: Vectors, offset_m: NDArray[np.float64], a: Vectors, b: Vectors) -> Vectors:
    """Return the points of planes at which they mirror a point into another.

    Args:
        normal: Unit normals (N, 3).
        offset_m: Distances of the planes from the origin along them (N,) [m].
        a: Points in front of the planes (N, 3) [m].
        b: Other points in front of them (N, 3) [m].

    Returns:
        Specular points (N, 3) [m].
    """
    height_a = np.einsum("nk,nk->n", normal, a) - offset_m
    height_b = np.einsum("nk,nk->n", normal, b) - offset_m
    share = (height_a / (height_a + height_b))[:, None]
    return a + share * (b - 2 * height_b[:, None] * normal - a)
