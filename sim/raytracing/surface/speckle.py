"""Speckle fixed to the world: position and reflectivity of each scatterer are a hash of where it is.

Surfaces are divided into patches by a world-fixed lattice (by a lattice of its own for a moving object). Each
patch is one scatterer at a hashed position in it, with a circular complex Gaussian reflectivity: a radar at
rest sees the same speckle in every scan, and for a moving one it changes through the path lengths alone. The
intensity of a sum of such scatterers is exponential (Goodman, "Speckle Phenomena in Optics", 2007, ch. 3).
"""

import math

from echoscape.sim.raytracing.mitsuba_backend import dr, mi

PATCH_M = 0.05
"""Edge of the smallest patch [m]."""
PATCH_STEPS = (1, 2, 4)
"""Factors by which patches are larger where rays are sparse: a ray then stays in its patch over the length in
which speckle decorrelates (wavelength / 2 / beam width, some 0.1 m). The largest patches stay below the
range resolution."""

_ORIGIN = (0.0137, 0.0211, 0.0173)
"""Lattice offset, so that its planes do not coincide with common ones (z = 0, kerb heights) [m]."""


def hash32(value: "mi.UInt32") -> "mi.UInt32":
    """Mix 32 bits: each input bit flips each output bit with a probability of one half (Wellons' lowbias32).

    Args:
        value: Numbers (N).

    Returns:
        Hashes (N).
    """
    value = mi.UInt32(value)
    value ^= value >> 16
    value *= 0x7FEB352D
    value ^= value >> 15
    value *= 0x846CA68B
    value ^= value >> 16
    return value


def _uniform(bits: "mi.UInt32") -> "mi.Float":
    """Return the middle of one of 2^24 even steps in (0, 1), by the upper 24 bits."""
    return (mi.Float(bits >> 8) + 0.5) * (1.0 / 16777216.0)


def patch_step(mean_rays: "mi.Float") -> "mi.UInt32":
    """Return the smallest patch size that a ray is expected in.

    Args:
        mean_rays: Expected number of rays in a patch of the smallest size (N).

    Returns:
        Edge over that of the smallest patch (N), one of `PATCH_STEPS`.
    """
    return dr.select(
        mean_rays >= 1,
        mi.UInt32(PATCH_STEPS[0]),
        dr.select(mean_rays >= 0.25, PATCH_STEPS[1], PATCH_STEPS[2]),
    )


def _cell(point: "mi.Float64", axis: int, edge_m: "mi.Float64") -> "mi.Float64":
    return dr.floor((point + _ORIGIN[axis]) / edge_m)


def lattice_key(point: "mi.Point3d", edge_m: "mi.Float64", salt: "mi.UInt32") -> "mi.UInt32":
    """Return a hash of the lattice cell that a point lies in.

    Args:
        point: Points (N) [m].
        edge_m: Edges of the cells (N) [m].
        salt: Tells lattices apart (N).

    Returns:
        Hashes (N).
    """
    key = hash32(salt)
    for axis in range(3):
        cell = mi.Int32(_cell(point[axis], axis, edge_m))
        key = hash32(key ^ dr.reinterpret_array(mi.UInt32, cell))
    return key


def patch_key(point: "mi.Point3d", step: "mi.UInt32", owner: "mi.UInt32", seed: "mi.UInt32") -> "mi.UInt32":
    """Return a hash of the patch that a point lies in.

    Args:
        point: Points (N) [m].
        step: Patch sizes (N), from `patch_step`.
        owner: Tells apart the lattices of moving objects (N).
        seed: Seed of the simulator.

    Returns:
        Hashes (N).
    """
    return lattice_key(point, mi.Float64(step) * PATCH_M, owner ^ seed ^ (step << 24))


def scatterer_offset(point: "mi.Point3d", step: "mi.UInt32", key: "mi.UInt32") -> "mi.Vector3d":
    """Return the vector from a point to the scatterer of its patch.

    Args:
        point: Points (N) [m].
        step: Patch sizes (N).
        key: Hashes of the patches (N).

    Returns:
        Vectors in the frame of the lattice (N) [m].
    """
    offset, bits, edge_m = mi.Vector3d(0), key, mi.Float64(step) * PATCH_M
    for axis in range(3):
        bits = hash32(bits + 0x9E3779B9)
        cell = _cell(point[axis], axis, edge_m)
        offset[axis] = (cell + mi.Float64(_uniform(bits))) * edge_m - _ORIGIN[axis] - point[axis]
    return offset


def reflectivity(key: "mi.UInt32") -> "tuple[mi.Float, mi.Float]":
    """Return the reflectivity of scatterers, circular complex Gaussian of unit mean power (Box-Muller).

    Args:
        key: Hashes of their patches (N).

    Returns:
        Real and imaginary part (N).
    """
    first = hash32(key ^ 0x68E31DA4)
    second = hash32(first ^ 0xB5297A4D)
    amplitude = dr.sqrt(-dr.log(_uniform(first)))
    sine, cosine = dr.sincos(_uniform(second) * (2 * math.pi))
    return amplitude * cosine, amplitude * sine
