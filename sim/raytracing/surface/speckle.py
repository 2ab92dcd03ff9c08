"""Speckle fixed to the world: position and reflectivity of each scatterer are a hash of where it is.

Surfaces are divided into patches by a world-fixed lattice (by a lattice of its own for a moving object). Each
patch is one scatterer at a hashed position in it, with a circular complex Gaussian reflectivity: a radar at
rest sees the same speckle in every scan, and for a moving one it changes through the path lengths. Patches
grow with range in steps, before each of which power passes gradually into those of the next size. The
intensity of a sum of such scatterers is exponential (Goodman, "Speckle Phenomena in Optics", 2007, ch. 3).
"""

import math

from echoscape.sim.raytracing.mitsuba_backend import dr, mi

PATCH_STEPS: tuple[tuple[float, float], ...] = (
    (6.0, 0.05),
    (12.0, 0.1),
    (25.0, 0.2),
    (50.0, 0.4),
    (math.inf, 0.8),
)
"""Horizontal edge of a patch [m] up to each range [m]: a few patches across the beam at any range, each as
wide as a few rays. Speckle decorrelates over wavelength / 2 / beam width, some 0.1 m, whatever their size."""
TRANSITION = 0.2
"""Last share of the ranges up to each step in which power passes into the patches of the next size."""
PATCH_HEIGHT = 3.0
"""Height of a patch over its edge: what lies above each other has nearly the same range."""

_UNTIL_M, _EDGES_M = zip(*PATCH_STEPS, strict=True)
_COARSER_STEPS = tuple(zip(_UNTIL_M, (*_EDGES_M[1:], _EDGES_M[-1]), strict=True))
_TRANSITION_STARTS = tuple((until_m, until_m * (1 - TRANSITION)) for until_m in _UNTIL_M)
_PRIMES = (0x9E3779B1, 0x85EBCA77, 0xC2B2AE3D)
"""Odd factors whose products spread the numbers of cells over 32 bits."""
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


def by_range(range_m: "mi.Float", steps: tuple[tuple[float, float], ...]) -> "mi.Float64":
    """Return the value of a table of steps at given ranges.

    Args:
        range_m: Ranges (N) [m].
        steps: Values up to each range [m], in order; the last range is infinite.

    Returns:
        Values (N).
    """
    found = mi.Float64(steps[-1][1])
    for until_m, value in reversed(steps[:-1]):
        found = dr.select(range_m < until_m, value, found)
    return found


def patch_edge_m(range_m: "mi.Float") -> "mi.Float64":
    """Return the horizontal edge of the patches at given ranges.

    Args:
        range_m: Length of the path out to the patch, unfolded (N) [m].

    Returns:
        Edges (N) [m], from `PATCH_STEPS`.
    """
    return by_range(range_m, PATCH_STEPS)


def coarser_edge_m(range_m: "mi.Float") -> "mi.Float64":
    """Return the horizontal edge of the patches of the next size at given ranges.

    Args:
        range_m: Length of the path out to the patch, unfolded (N) [m].

    Returns:
        Edges (N) [m]; beyond the last step those of the largest patches.
    """
    return by_range(range_m, _COARSER_STEPS)


def coarser_share(range_m: "mi.Float") -> "mi.Float":
    """Return the share of power that patches of the next size have at given ranges.

    Patches of both sizes scatter independently, so that their sum is circular Gaussian whatever the share,
    and two ranges correlate by sqrt(s s') + sqrt((1 - s) (1 - s')). With s = sin^2 of an angle that grows
    with range this is the cosine of the difference of the angles, the same anywhere in a transition.

    Args:
        range_m: Length of the path out to the patch, unfolded (N) [m].

    Returns:
        Shares (N): 0 up to the start of a transition, 1 just before its end.
    """
    start_m = mi.Float(by_range(range_m, _TRANSITION_STARTS))
    angle = (range_m / start_m - 1) * (math.pi / 2 * (1 - TRANSITION) / TRANSITION)
    return dr.square(dr.sin(dr.maximum(angle, 0)))


def _cell(point: "mi.Float64", axis: int, edge_m: "mi.Float64") -> "mi.Float64":
    return dr.floor((point + _ORIGIN[axis]) / edge_m)


def lattice_key(
    point: "mi.Point3d", edge_m: "mi.Float64", salt: "mi.UInt32", *, height: float = 1.0
) -> "mi.UInt32":
    """Return a hash of the lattice cell that a point lies in.

    Args:
        point: Points (N) [m].
        edge_m: Horizontal edges of the cells (N) [m].
        salt: Tells lattices apart (N).
        height: Height of the cells over their horizontal edge.

    Returns:
        Hashes (N).
    """
    key = hash32(salt)
    for axis in range(3):
        cell = mi.Int32(_cell(point[axis], axis, edge_m * height if axis == 2 else edge_m))
        key = hash32(key ^ dr.reinterpret_array(mi.UInt32, cell))
    return key


def patch_key(
    point: "mi.Point3d", edge_m: "mi.Float64", owner: "mi.UInt32", seed: "mi.UInt32"
) -> "mi.UInt32":
    """Return a hash of the patch that a point lies in, which decides its scatterer.

    Two of a scan's n patches have the same one n^2 / 2^33 times, once or twice in a hundred thousand. Their
    scatterers are alike then, at places of their own, which no radar can tell. To sum power by patch takes
    more bits (`patch_number`).

    Args:
        point: Points (N) [m].
        edge_m: Edges of the patches (N) [m], from `patch_edge_m`.
        owner: Tells apart the lattices of moving objects (N).
        seed: Seed of the simulator.

    Returns:
        Hashes (N).
    """
    return lattice_key(point, edge_m, owner ^ seed ^ _step_bits(edge_m), height=PATCH_HEIGHT)


def patch_number(point: "mi.Point3d", edge_m: "mi.Float64", owner: "mi.UInt32") -> "mi.UInt32":
    """Return another hash of the patch that a point lies in, independent of `patch_key`.

    Args:
        point: Points (N) [m].
        edge_m: Edges of the patches (N) [m], from `patch_edge_m`.
        owner: Tells apart the lattices of moving objects (N).

    Returns:
        Hashes (N).
    """
    number = owner ^ _step_bits(edge_m)
    for axis, prime in enumerate(_PRIMES):
        cell = mi.Int32(_cell(point[axis], axis, edge_m * PATCH_HEIGHT if axis == 2 else edge_m))
        number += dr.reinterpret_array(mi.UInt32, cell) * prime
    return hash32(number)


def _step_bits(edge_m: "mi.Float64") -> "mi.UInt32":
    """Return the size of patches in the upper bits of a word."""
    return mi.UInt32(edge_m * (1 / PATCH_STEPS[0][1]) + 0.5) << 24


def scatterer_offset(point: "mi.Point3d", edge_m: "mi.Float64", key: "mi.UInt32") -> "mi.Vector3d":
    """Return the vector from a point to the scatterer of its patch.

    Args:
        point: Points (N) [m].
        edge_m: Edges of the patches (N) [m].
        key: Hashes of the patches (N).

    Returns:
        Vectors in the frame of the lattice (N) [m].
    """
    offset, bits = mi.Vector3d(0), key
    for axis in range(3):
        bits = hash32(bits + 0x9E3779B9)
        edge = edge_m * PATCH_HEIGHT if axis == 2 else edge_m
        offset[axis] = (_cell(point[axis], axis, edge) + mi.Float64(_uniform(bits))) * edge
        offset[axis] -= _ORIGIN[axis] + point[axis]
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
