"""Texture: variation of the mean reflectivity of a material over its surface, fixed in the world.

Speckle times a gamma-distributed mean is the K-distribution, <I^2> / <I>^2 = 2 (1 + 1 / nu) (Jakeman & Pusey,
IEEE TAP 24(6), 1976; Ward, Tough & Watts, "Sea Clutter", 2013, ch. 4). The mean is a hash of the cell of a
world-fixed lattice, wider than the range resolution, as that of speckle is.
"""

import math

import numpy as np
from numpy.typing import NDArray
from scipy.special import gammainc, gammaincinv

from echoscape.scenes.core.materials import MATERIALS
from echoscape.sim.raytracing.mitsuba_backend import dr, mi
from echoscape.sim.raytracing.surface.speckle import lattice_key

_BITS = 10
"""The mean of a cell takes one of 2^10 equally likely values, which leaves <t^2> low by 0.001 at nu = 1."""
_STAGE = 0x7E87A9E5
"""Makes the hashes of texture independent of those of speckle."""


def quantile_means(shape: float) -> NDArray[np.float32]:
    """Return the means of a gamma variable of mean 1 between even quantiles.

    The mean of these is 1: t times the density of shape nu is the density of shape nu + 1.

    Args:
        shape: Shape nu of the gamma distribution; infinite for no texture.

    Returns:
        Means (2^10,) float32.
    """
    count = 1 << _BITS
    if math.isinf(shape):
        return np.ones(count, np.float32)
    edges = gammaincinv(shape, np.arange(count + 1) / count)
    return (np.diff(gammainc(shape + 1, edges)) * count).astype(np.float32)


class Texture:
    """The texture of all materials, in tables that kernels gather from by material id."""

    def __init__(self) -> None:
        """Tabulate the quantiles of all materials."""
        materials = list(MATERIALS.values())
        self._any = any(math.isfinite(each.texture_shape) for each in materials)
        means = np.concatenate([quantile_means(each.texture_shape) for each in materials])
        self._means = mi.Float(means)
        self._edge_m = mi.Float64(np.array([each.texture_m for each in materials]))

    def amplitude(
        self,
        material: "mi.UInt32",
        point: "mi.Point3d",
        owner: "mi.UInt32",
        seed: "mi.UInt32",
        active: "mi.Bool",
    ) -> "mi.Float":
        """Return the amplitude factor of the texture, whose square has mean 1.

        Args:
            material: Material ids (N).
            point: Points (N) [m].
            owner: Tells apart the lattices of moving objects (N).
            seed: Seed of the simulator.
            active: Which entries to look up (N).

        Returns:
            Factors (N).
        """
        if not self._any:
            return mi.Float(1)
        edge_m = dr.gather(mi.Float64, self._edge_m, material, active)
        key = lattice_key(point, edge_m, owner ^ seed ^ _STAGE)
        index = (material << _BITS) + (key >> (32 - _BITS))
        return dr.sqrt(dr.gather(mi.Float, self._means, index, active))
