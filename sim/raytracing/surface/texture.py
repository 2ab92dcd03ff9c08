"""Texture: how far a material's mean reflectivity differs from place to place, fixed in the world.

Speckle times a gamma-distributed mean is the K-distribution, <I^2> / <I>^2 = 2 (1 + 1 / nu) (Jakeman & Pusey,
IEEE TAP 24(6), 1976; Ward, Tough & Watts, "Sea Clutter", 2013, ch. 4). Cells of a world-fixed lattice, wider
than the range resolution, each draw their mean by a hash of where they are, as speckle does.
"""

import math

import numpy as np
from numpy.typing import NDArray
from scipy.stats import gamma

from echoscape.scenes.core.materials import MATERIALS
from echoscape.sim.raytracing.mitsuba_backend import dr, mi
from echoscape.sim.raytracing.surface.speckle import lattice_key

_BITS = 10
"""A cell's mean takes one of 2^10 equally likely values: those beyond leave <t^2> low by 0.001 at nu = 1."""
_STAGE = 0x7E87A9E5
"""Tells the texture's hashes from those of speckle."""


def quantile_means(shape: float) -> NDArray[np.float32]:
    """Return the means (2^10,) of a gamma variable of mean 1 and shape `shape` between even quantiles.

    Their own mean is 1: t times the density of shape nu is the density of shape nu + 1.
    """
    count = 1 << _BITS
    if math.isinf(shape):
        return np.ones(count, np.float32)
    edges = gamma.ppf(np.arange(count + 1) / count, shape)
    return (np.diff(gamma.cdf(edges, shape + 1)) * count).astype(np.float32)


class Texture:
    """The texture of all materials, as tables that kernels gather from by material id."""

    def __init__(self) -> None:
        rows = list(MATERIALS.values())
        self._any = any(math.isfinite(row.texture_shape) for row in rows)
        means = np.concatenate([quantile_means(row.texture_shape) for row in rows])
        self._means = mi.Float(means)
        self._edge_m = mi.Float64(np.array([row.texture_m for row in rows]))

    def amplitude(
        self,
        material: "mi.UInt32",
        place: "mi.Point3d",
        owner: "mi.UInt32",
        seed: "mi.UInt32",
        active: "mi.Bool",
    ) -> "mi.Float":
        """Return the amplitude factor (N,) of the cell that `place` [m] lies in; its square has mean 1."""
        if not self._any:
            return mi.Float(1)
        edge_m = dr.gather(mi.Float64, self._edge_m, material, active)
        key = lattice_key(place, edge_m, owner ^ seed ^ _STAGE)
        index = (material << _BITS) + (key >> (32 - _BITS))
        return dr.sqrt(dr.gather(mi.Float, self._means, index, active))
