"""What a surface sends back: a mirror part widened by waviness, and a diffuse part.

The reflected power |Gamma|^2 (Fresnel) is split by effective roughness, R^2 + S^2 = 1 (Degli-Esposti et al.,
IEEE TAP 55(1), 2007); small-scale roughness moves a further share exp(-(4 pi s cos / lambda)^2) from the
mirror part to the diffuse one (Ament 1953). The mirror part has the width of the surface's slopes
(geometrical optics, Beckmann distribution: Ulaby & Long 2014, ch. 10), which gives a flat wall exactly its
image's power (lambda / (8 pi R))^2 |Gamma|^2; the diffuse part is Lambert's.
"""

import math

import numpy as np

from echoscape.scenes.materials import MATERIALS
from echoscape.sim.backend import dr, mi
from echoscape.sim.fresnel import reflected_power_table

_STEPS = 256


class Surfaces:
    """Scattering of all materials at one carrier, as tables that kernels gather from by material id."""

    def __init__(self, carrier_hz: float, wavelength_m: float) -> None:
        rows = list(MATERIALS.values())
        table = reflected_power_table(rows, carrier_hz, _STEPS)
        self._te_power = mi.Float(np.ascontiguousarray(table[..., 0]).ravel())
        self._tm_power = mi.Float(np.ascontiguousarray(table[..., 1]).ravel())
        self._diffuse_share = mi.Float(np.array([row.scattering**2 for row in rows], np.float32))
        roughness = [(4 * math.pi * row.rms_height_m / wavelength_m) ** 2 for row in rows]
        self._roughness = mi.Float(np.array(roughness, np.float32))
        self._slope_variance = mi.Float(np.array([row.rms_slope_rad**2 for row in rows], np.float32))

    def reflected_power(
        self, material: "mi.UInt32", cosine: "mi.Float", te_share: "mi.Float", active: "mi.Bool"
    ) -> "mi.Float":
        """Return |Gamma|^2 for a wave whose power is TE by the share `te_share` and TM by the rest."""
        place = dr.clip(cosine, 0, 1) * _STEPS
        step = dr.minimum(mi.UInt32(place), _STEPS - 1)
        fraction = place - mi.Float(step)
        index = material * (_STEPS + 1) + step
        powers = [
            dr.lerp(
                dr.gather(mi.Float, table, index, active),
                dr.gather(mi.Float, table, index + 1, active),
                fraction,
            )
            for table in (self._te_power, self._tm_power)
        ]
        return dr.lerp(powers[1], powers[0], te_share)

    def mirror_share(self, material: "mi.UInt32", cosine: "mi.Float", active: "mi.Bool") -> "mi.Float":
        """Return the share of the reflected power that leaves as from a mirror, (1 - S^2) exp(-g)."""
        diffuse = dr.gather(mi.Float, self._diffuse_share, material, active)
        roughness = dr.gather(mi.Float, self._roughness, material, active)
        return (1 - diffuse) * dr.exp(-roughness * cosine * cosine)

    def mirror_lobe(
        self,
        material: "mi.UInt32",
        cos_half: "mi.Float",
        cos_in: "mi.Float",
        cos_out: "mi.Float",
        active: "mi.Bool",
    ) -> "mi.Float":
        """Return the mirror part's BRDF per unit reflected power, D(h) / (4 cos_in cos_out) [1/sr].

        `cos_half` is the cosine between the normal and the half vector of the two directions.
        """
        variance = dr.gather(mi.Float, self._slope_variance, material, active)
        cos2 = dr.maximum(cos_half * cos_half, 1e-6)
        slopes = dr.exp((1 - 1 / cos2) / (2 * variance)) / (2 * math.pi * variance * cos2 * cos2)
        return slopes / (4 * dr.maximum(cos_in, 1e-3) * dr.maximum(cos_out, 1e-3))
