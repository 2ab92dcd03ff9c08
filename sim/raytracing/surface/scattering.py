"""Scattering of surfaces: a mirror part widened by waviness, and a diffuse part.

The reflected power |Gamma|^2 (Fresnel) is split by effective roughness, R^2 + S^2 = 1 (Degli-Esposti et al.,
IEEE TAP 55(1), 2007); small-scale roughness moves a further share exp(-(4 pi s cos / lambda)^2) from the
mirror part to the diffuse one (Ament 1953). The mirror part has the width of the slopes of the surface
(geometrical optics, Beckmann distribution: Ulaby & Long 2014, ch. 10), which gives a flat wall exactly the
power of its image, (lambda / (8 pi R))^2 |Gamma|^2. The diffuse part is Lambertian, or a lobe
((1 + cos psi) / 2)^n about the specular direction or back to the source, scaled to hold just its share.
"""

import math
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from echoscape.scenes.core.materials import MATERIALS, Material
from echoscape.sim.raytracing.mitsuba_backend import dr, mi
from echoscape.sim.raytracing.surface.curvature import SlopeSpread
from echoscape.sim.raytracing.surface.fresnel import reflected_power_table
from echoscape.sim.settings.surfaces import SurfaceSettings

_STEPS = 256
_MOST_SCATTERING = 0.98
_LOBES = ("lambert", "directive", "backscatter")


def lobe_integral(order: int, cos_in: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return the integral of ((1 + cos psi) / 2)^order over the hemisphere above a surface.

    psi is the angle from the axis of the lobe: Degli-Esposti et al. 2007, eqs. (14), (19), summed over the
    powers of cos psi.

    Args:
        order: Order of the lobe.
        cos_in: Cosine between the axis and the normal (N,).

    Returns:
        Integrals (N,) [sr].
    """
    sine2 = 1 - cos_in**2
    total = np.zeros_like(cos_in)
    for power in range(order + 1):
        part = np.full_like(cos_in, 2 * math.pi / (power + 1))
        if power % 2:
            terms = [math.comb(2 * k, k) / 4**k * sine2**k for k in range((power + 1) // 2)]
            part *= cos_in * np.sum(terms, axis=0)
        total += math.comb(order, power) * part
    return total / 2.0**order


def roughened(material: Material, settings: SurfaceSettings) -> Material:
    """Return a material with changed roughness.

    Args:
        material: The material.
        settings: Factors on its roughness.

    Returns:
        The changed material; its scattering stays below 1.
    """
    return replace(
        material,
        rms_height_m=material.rms_height_m * settings.rms_height,
        scattering=min(material.scattering * settings.scattering, _MOST_SCATTERING),
        rms_slope_rad=material.rms_slope_rad * settings.rms_slope,
    )


class Surfaces:
    """Scattering of all materials at one carrier, in tables that kernels gather from by material id."""

    def __init__(
        self, carrier_hz: float, wavelength_m: float, settings: SurfaceSettings | None = None
    ) -> None:
        """Tabulate the scattering.

        Args:
            carrier_hz: Carrier frequency [Hz].
            wavelength_m: Its wavelength [m].
            settings: Changes to the roughness of all materials; None is none.
        """
        materials = [roughened(each, settings or SurfaceSettings()) for each in MATERIALS.values()]
        table = reflected_power_table(materials, carrier_hz, _STEPS)
        self._te_power = mi.Float(np.ascontiguousarray(table[..., 0]).ravel())
        self._tm_power = mi.Float(np.ascontiguousarray(table[..., 1]).ravel())
        self._diffuse_share = mi.Float(np.array([each.scattering**2 for each in materials], np.float32))
        roughness = [(4 * math.pi * each.rms_height_m / wavelength_m) ** 2 for each in materials]
        self._roughness = mi.Float(np.array(roughness, np.float32))
        self._slope_variance = mi.Float(np.array([each.rms_slope_rad**2 for each in materials], np.float32))
        self._any_lobe = any(each.lobe != "lambert" for each in materials)
        self._lobe = mi.UInt32(np.array([_LOBES.index(each.lobe) for each in materials], np.uint32))
        self._lobe_order = mi.Float(np.array([each.lobe_order for each in materials], np.float32))
        cosines = np.linspace(0.0, 1.0, _STEPS + 1)
        integrals = [lobe_integral(int(each.lobe_order), cosines) for each in materials]
        self._lobe_peak = mi.Float((1 / np.concatenate(integrals)).astype(np.float32))

    def reflected_power(
        self, material: "mi.UInt32", cosine: "mi.Float", te_share: "mi.Float", active: "mi.Bool"
    ) -> "mi.Float":
        """Return the reflected share of the power, |Gamma|^2.

        Args:
            material: Material ids (N).
            cosine: Cosines of incidence (N).
            te_share: Share of the power that is TE polarised (N); the rest is TM.
            active: Which entries to look up (N).

        Returns:
            Power reflectivities (N).
        """
        te, tm = (_looked_up(table, material, cosine, active) for table in (self._te_power, self._tm_power))
        return dr.lerp(tm, te, te_share)

    def mirror_share(self, material: "mi.UInt32", cosine: "mi.Float", active: "mi.Bool") -> "mi.Float":
        """Return the share of the reflected power in the mirror part, (1 - S^2) exp(-g).

        Args:
            material: Material ids (N).
            cosine: Cosines of incidence (N).
            active: Which entries to look up (N).

        Returns:
            Shares (N).
        """
        diffuse = dr.gather(mi.Float, self._diffuse_share, material, active)
        roughness = dr.gather(mi.Float, self._roughness, material, active)
        return (1 - diffuse) * dr.exp(-roughness * cosine * cosine)

    def diffuse_lobe(
        self,
        amount: "mi.Float",
        material: "mi.UInt32",
        cosines: "tuple[mi.Float, mi.Float, mi.Float]",
        active: "mi.Bool",
    ) -> "mi.Float":
        """Return the BRDF of the diffuse part of the reflected power.

        Args:
            amount: Share of the reflected power that is diffuse (N).
            material: Material ids (N).
            cosines: Cosines of incidence, of exit, and of the angle between the exit direction and the
                direction back to the source (N).
            active: Which entries to look up (N).

        Returns:
            BRDF per unit reflected power (N) [1/sr].
        """
        lambert = amount / math.pi
        if not self._any_lobe:
            return lambert
        cos_in, cos_out, cos_back = cosines
        kind = dr.gather(mi.UInt32, self._lobe, material, active)
        # The specular direction is d - 2 (d n) n: its cosine with the exit is 2 cos_in cos_out - cos_back.
        cos_axis = dr.select(kind == 1, 2 * cos_in * cos_out - cos_back, cos_back)
        order = dr.gather(mi.Float, self._lobe_order, material, active)
        shape = dr.power(dr.clip(0.5 + 0.5 * cos_axis, 1e-6, 1), order)
        peak = _looked_up(self._lobe_peak, material, cos_in, active)
        lobe = amount * shape * peak / dr.maximum(cos_out, 1e-3)
        return dr.select(kind == 0, lambert, lobe)

    def slope_variance(self, material: "mi.UInt32", active: "mi.Bool") -> "mi.Float":
        """Return the variance of the slopes of surfaces.

        Args:
            material: Material ids (N).
            active: Which entries to look up (N).

        Returns:
            Variances (N) [rad^2].
        """
        return dr.gather(mi.Float, self._slope_variance, material, active)

    def mirror_lobe(
        self,
        material: "mi.UInt32",
        cos_half: "mi.Float",
        cos_in: "mi.Float",
        cos_out: "mi.Float",
        active: "mi.Bool",
        spread: SlopeSpread | None = None,
        tilt: "mi.Float | float" = 0.0,
    ) -> "mi.Float":
        """Return the BRDF of the mirror part, D(h) / (4 cos_in cos_out).

        Args:
            material: Material ids (N).
            cos_half: Cosines between the normal and the half vector of both directions (N).
            cos_in: Cosines of incidence (N).
            cos_out: Cosines of exit (N).
            active: Which entries to look up (N).
            spread: Slopes of the half vector, and those of a curved surface in the footprint of the ray; None
                for flat surfaces.
            tilt: Variance of the half vectors by the slopes of the mirrors on the way (N) [rad^2].

        Returns:
            BRDF per unit reflected power (N) [1/sr].
        """
        variance = self.slope_variance(material, active) + tilt
        cos2 = dr.maximum(cos_half * cos_half, 1e-6)
        if spread is None:
            slopes = dr.exp((1 - 1 / cos2) / (2 * variance)) / (2 * math.pi * variance * cos2 * cos2)
        else:
            slopes = _slope_density(variance, spread) / (cos2 * cos2)
        return slopes / (4 * dr.maximum(cos_in, 1e-3) * dr.maximum(cos_out, 1e-3))


def _slope_density(variance: "mi.Float", spread: SlopeSpread) -> "mi.Float":
    """Return the density of the slopes of half vectors, Gaussian with the sum of both covariances."""
    uu, vv, uv = variance + spread.variance_u, variance + spread.variance_v, spread.covariance
    determinant = uu * vv - uv * uv
    x, y = spread.along_u, spread.along_v
    distance2 = (vv * x * x - 2 * uv * x * y + uu * y * y) / determinant
    return dr.exp(-0.5 * distance2) / (2 * math.pi * dr.sqrt(determinant))


def _looked_up(table: "mi.Float", material: "mi.UInt32", cosine: "mi.Float", active: "mi.Bool") -> "mi.Float":
    """Return the table of a material over even cosines from 0 to 1, linear between its steps."""
    position = dr.clip(cosine, 0, 1) * _STEPS
    step = dr.minimum(mi.UInt32(position), _STEPS - 1)
    index = material * (_STEPS + 1) + step
    low, high = (dr.gather(mi.Float, table, index + k, active) for k in (0, 1))
    return dr.lerp(low, high, position - mi.Float(step))
