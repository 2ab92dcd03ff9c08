"""Speckle that belongs to the world: a scatterer's place and reflectivity are a hash of where it is.

Surfaces are cut into patches by a world-fixed lattice (an object's own lattice where it moves). Each patch is
one scatterer at a hashed place in it, with a circular complex Gaussian reflectivity, so that a standing radar
sees the same speckle in every scan and a moving one sees it change through the path lengths alone. The
intensity of a sum of such scatterers is exponential (Goodman, "Speckle Phenomena in Optics", 2007, ch. 3).
"""

import math

from echoscape.sim.raytracing.mitsuba_backend import dr, mi

PATCH_M = 0.05
"""Edge of the smallest patch."""
PATCH_STEPS = (1, 2, 4)
"""Patches grow by these factors where rays are few, so that rays do not leave their patch within the lengths
over which speckle decorrelates (wavelength / 2 / beam width, some 0.1 m); the largest stay below the range
resolution."""

_ORIGIN = (0.0137, 0.0211, 0.0173)
"""Lattice offset [m] that keeps common planes (z = 0, kerb heights) away from the lattice's own."""


def hash32(value: "mi.UInt32") -> "mi.UInt32":
    """Mix 32 bits (Wellons' lowbias32): each input bit flips each output bit with a chance of one half."""
    value = mi.UInt32(value)
    value ^= value >> 16
    value *= 0x7FEB352D
    value ^= value >> 15
    value *= 0x846CA68B
    value ^= value >> 16
    return value


def _uniform(bits: "mi.UInt32") -> "mi.Float":
    """Return the middle of one of 2^24 even steps in (0, 1)."""
    return (mi.Float(bits >> 8) + 0.5) * (1.0 / 16777216.0)


def patch_step(mean_rays: "mi.Float") -> "mi.UInt32":
    """Return the least step (N,) whose patch expects a ray, from the rays of the smallest patch."""
    return dr.select(
        mean_rays >= 1,
        mi.UInt32(PATCH_STEPS[0]),
        dr.select(mean_rays >= 0.25, PATCH_STEPS[1], PATCH_STEPS[2]),
    )


def _cell(place: "mi.Float64", axis: int, edge_m: "mi.Float64") -> "mi.Float64":
    return dr.floor((place + _ORIGIN[axis]) / edge_m)


def lattice_key(place: "mi.Point3d", edge_m: "mi.Float64", salt: "mi.UInt32") -> "mi.UInt32":
    """Return the hash (N,) of the cell of a lattice of edge `edge_m` [m] that `place` [m] lies in."""
    key = hash32(salt)
    for axis in range(3):
        cell = mi.Int32(_cell(place[axis], axis, edge_m))
        key = hash32(key ^ dr.reinterpret_array(mi.UInt32, cell))
    return key


def patch_key(place: "mi.Point3d", step: "mi.UInt32", owner: "mi.UInt32", seed: "mi.UInt32") -> "mi.UInt32":
    """Return the hash (N,) of the patch that `place` [m] lies in; `owner` tells apart lattices that move."""
    return lattice_key(place, mi.Float64(step) * PATCH_M, owner ^ seed ^ (step << 24))


def scatterer_offset(place: "mi.Point3d", step: "mi.UInt32", key: "mi.UInt32") -> "mi.Vector3d":
    """Return the vector from `place` to its patch's scatterer [m], in the lattice's frame."""
    offset, bits, edge_m = mi.Vector3d(0), key, mi.Float64(step) * PATCH_M
    for axis in range(3):
        bits = hash32(bits + 0x9E3779B9)
        cell = _cell(place[axis], axis, edge_m)
        offset[axis] = (cell + mi.Float64(_uniform(bits))) * edge_m - _ORIGIN[axis] - place[axis]
    return offset


def reflectivity(key: "mi.UInt32") -> "tuple[mi.Float, mi.Float]":
    """Return real and imaginary part of a circular complex Gaussian of unit mean power (Box-Muller)."""
    first = hash32(key ^ 0x68E31DA4)
    second = hash32(first ^ 0xB5297A4D)
    amplitude = dr.sqrt(-dr.log(_uniform(first)))
    sine, cosine = dr.sincos(_uniform(second) * (2 * math.pi))
    return amplitude * cosine, amplitude * sine
