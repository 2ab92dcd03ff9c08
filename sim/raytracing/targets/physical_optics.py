"""The echo of a smooth target as a phase sum over its surface, for a radar at any distance.

Physical optics with shooting and bouncing rays (Ling, Chou & Lee, IEEE TAP 37(2), 1989): a grid of points on
the target is illuminated by the radar and mirrored from patch to patch, and every illuminated point returns

    dA = Gamma cos(theta) exp(-j k (L + R)) / (L R) dS,      P = (link / lambda^2) |sum dA|^2

with L the unfolded length of the outward path and R that of the return. In the far field this is
sigma = 4 pi |sum|^2 / lambda^2 (4 pi A^2 / lambda^2 for a plate); for an infinite mirror it is the power of
the image, so no far field has to be assumed. Curved targets are integrated by stationary phase across their
curvature. Gamma is Fresnel's: test targets are machined.
"""

import math

from echoscape.scenes.core.targets import KINDS, Target
from echoscape.sim.raytracing.targets import curved_targets, flat_targets
from echoscape.sim.raytracing.targets.surface_paths import SurfacePaths, Vectors, no_paths

_NEAREST_M = 0.1
"""A target has no echo for an antenna nearer than this, or inside it [m]."""
_APERTURE = {"plate": 1.0, "dihedral": 1.5, "trihedral": 0.7}
"""Largest aperture over the product of the sizes: 1, sqrt(2) and 1 / sqrt(3), and what other bounces add."""


def surface_paths(
    target: Target,
    radar: Vectors,
    *,
    receiver: Vectors | None = None,
    wavelength_m: float,
    epsilon: complex,
) -> SurfacePaths:
    """Return the paths over a coherent target; occlusion by other objects is not in them.

    Args:
        target: The target.
        radar: Position of the antenna (3,) [m], or of its image in a mirror.
        receiver: Where the paths end (3,) [m]; None is back at `radar`.
        wavelength_m: Wavelength [m].
        epsilon: Complex relative permittivity of the material of the target.

    Returns:
        The paths, none from nearer than 0.1 m.

    Raises:
        ValueError: The target is not coherent, or too large to be summed from so near.
    """
    if not target.coherent:
        raise ValueError(f"a {target.kind} has no coherent echo")
    ends = (radar, radar if receiver is None else receiver)
    shape = flat_targets if KINDS[target.kind].flat else curved_targets
    if min(shape.nearest_m(target, end) for end in ends) < _NEAREST_M:
        return no_paths()
    return shape.target_paths(target, *ends, wavelength_m=wavelength_m, epsilon=epsilon)


def largest_sum(target: Target, wavelength_m: float) -> float:
    """Return the largest |sum dA| of a target times both distances, from and to it [m^2].

    Args:
        target: A coherent target.
        wavelength_m: Wavelength [m].

    Returns:
        For a flat target the area of the aperture that it offers at most, sqrt(sigma / 4 pi) lambda.
    """
    if target.kind == "point":
        return math.sqrt(target.rcs_m2 / (4 * math.pi)) * wavelength_m
    if target.kind == "sphere":
        return wavelength_m * target.size_m[0] / 2
    if target.kind == "cylinder":
        return target.size_m[1] * math.sqrt(wavelength_m * target.size_m[0])
    return _APERTURE[target.kind] * target.size_m[0] * target.size_m[-1]
