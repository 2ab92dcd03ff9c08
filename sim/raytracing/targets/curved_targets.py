"""Paths over points, spheres and upright cylinders: stationary phase across their curvature.

Geometrical optics of curved surfaces: Deschamps, Proc. IEEE 60(9), 1972.
"""

import math

import numpy as np
from numpy.typing import NDArray

from echoscape.scenes.core.targets import Target
from echoscape.sim.raytracing.surface.fresnel import vertical_reflection
from echoscape.sim.raytracing.targets.surface_paths import SurfacePaths, Vectors, no_paths, phase_factor

_GRAZING = 1e-3
"""Curved targets reflect nothing at a smaller cosine of incidence."""
_HALVINGS = 48
"""Of the angle in which a specular point is sought: to the rounding of doubles."""
_CURVE_STEP_M = 0.005
_CURVE_MOST = 4096


def target_paths(
    target: Target, radar: Vectors, receiver: Vectors, *, wavelength_m: float, epsilon: complex
) -> SurfacePaths:
    """Return the paths over a point, sphere or cylinder.

    Args:
        target: The target.
        radar: Position of the antenna (3,) [m], or of its image in a mirror.
        receiver: Where the paths end (3,) [m].
        wavelength_m: Wavelength [m].
        epsilon: Complex relative permittivity of the material of the target.

    Returns:
        The paths.
    """
    if target.kind == "point":
        return _point(target, radar, receiver, wavelength_m=wavelength_m)
    shape = _sphere if target.kind == "sphere" else _cylinder
    return shape(target, radar, receiver, wavelength_m=wavelength_m, epsilon=epsilon)


def nearest_m(target: Target, radar: Vectors) -> float:
    """Return the distance of the nearest part of a point, sphere or cylinder that reflects.

    Args:
        target: The target.
        radar: Position of the antenna (3,) [m].

    Returns:
        The distance [m], below 0 from inside the target.
    """
    away = radar - np.array(target.position_m)
    if target.kind == "cylinder":  # its side is not seen from above
        return float(np.hypot(away[0], away[1])) - target.size_m[0]
    if target.kind == "sphere":
        return float(np.linalg.norm(away)) - target.size_m[0]
    return float(np.linalg.norm(away))


def _point(target: Target, radar: Vectors, receiver: Vectors, *, wavelength_m: float) -> SurfacePaths:
    """Return the one path over a point of cross-section sigma: |sum| = sqrt(sigma / 4 pi) lambda / (L R)."""
    point = np.array([target.position_m])
    out_m, back_m = (np.linalg.norm(point - end, axis=1) for end in (radar, receiver))
    size = math.sqrt(target.rcs_m2 / (4 * math.pi)) * wavelength_m / (out_m * back_m)
    path_m = out_m + back_m
    return SurfacePaths(
        first=point, last=point, path_m=path_m, amplitude=size * phase_factor(path_m, wavelength_m)
    )


def _sphere(
    target: Target, radar: Vectors, receiver: Vectors, *, wavelength_m: float, epsilon: complex
) -> SurfacePaths:
    """Return the path over the specular point of a sphere: geometrical optics, pi r^2 in the far field.

    A spherical wave from a distance s leaves with the radii of curvature 1 / (1 / s + 2 cos / r) across the
    plane of incidence and 1 / (1 / s + 2 / (r cos)) in it (Deschamps, Proc. IEEE 60(9), 1972).
    """
    radius, centre = target.size_m[0], np.array(target.position_m)
    away = [end - centre for end in (radar, receiver)]
    centre_m = [float(np.linalg.norm(each)) for each in away]
    towards = away[0] / centre_m[0]
    aside = away[1] - (away[1] @ towards) * towards
    aside_m = float(np.linalg.norm(aside))
    between = math.atan2(aside_m, float(away[1] @ towards))
    turn = float(_specular_turn(np.array([between]), np.array([centre_m]), radius, np.zeros((1, 2)))[0])
    normal = math.cos(turn) * towards + math.sin(turn) * (aside / max(aside_m, 1e-12))
    point = (centre + radius * normal)[None]
    out_m, back_m = (float(np.linalg.norm(point - end)) for end in (radar, receiver))
    direction = (point - radar) / out_m
    cosine = -float(direction[0] @ normal)
    if cosine <= _GRAZING:
        return no_paths()
    gamma = vertical_reflection(epsilon, direction, normal)
    across, along = (1 + back_m * (1 / out_m + bend / radius) for bend in (2 * cosine, 2 / cosine))
    size = gamma * (wavelength_m / (out_m * math.sqrt(across * along)))
    path_m = np.array([out_m + back_m])
    return SurfacePaths(
        first=point, last=point, path_m=path_m, amplitude=size * phase_factor(path_m, wavelength_m)
    )


def _cylinder(
    target: Target, radar: Vectors, receiver: Vectors, *, wavelength_m: float, epsilon: complex
) -> SurfacePaths:
    """Return the paths over the line of an upright cylinder over which they are shortest.

    Stationary phase across the axis gives sqrt(lambda / L''), with L'' the second derivative of the path
    along the circumference; along the axis the sum is taken, which gives 2 pi r h^2 / lambda in the far field
    at broadside.
    """
    radius, height = target.size_m
    count = int(np.clip(height / _CURVE_STEP_M, 64, _CURVE_MOST))
    step_m = height / count
    z = (np.arange(count) + 0.5) * step_m - height / 2 + target.position_m[2]
    foot = np.array(target.position_m[:2], np.float64)
    away = [end[:2] - foot for end in (radar, receiver)]
    centre_m = np.tile([math.hypot(*each) for each in away], (count, 1))
    rise_m = np.column_stack([z - end[2] for end in (radar, receiver)])
    heading = [math.atan2(each[1], each[0]) for each in away]
    between = math.remainder(heading[1] - heading[0], 2 * math.pi)
    turn = _specular_turn(np.full(count, abs(between)), centre_m, radius, rise_m)
    angle = turn[:, None] - [0.0, abs(between)]
    facing_m = centre_m * np.cos(angle) - radius
    length_m = np.sqrt(np.square(facing_m) + np.square(centre_m * np.sin(angle)) + np.square(rise_m))
    if (facing_m <= _GRAZING * length_m).any():
        return no_paths()
    bearing = heading[0] + math.copysign(1.0, between) * turn
    normal = np.column_stack([np.cos(bearing), np.sin(bearing), np.zeros(count)])
    point = np.empty((count, 3), np.float64)
    point[:, :2], point[:, 2] = foot + radius * normal[:, :2], z
    bend = centre_m * np.cos(angle) / radius / length_m - np.square(centre_m * np.sin(angle)) / length_m**3
    across = np.sqrt(wavelength_m / bend.sum(axis=1)) * np.exp(-0.25j * math.pi)
    gamma = vertical_reflection(epsilon, (point - radar) / length_m[:, :1], normal)
    smear = np.sinc((rise_m / length_m).sum(axis=1) * step_m / wavelength_m)
    size = gamma * (facing_m[:, 0] / length_m[:, 0]) * across * smear * step_m / length_m.prod(axis=1)
    path_m = length_m.sum(axis=1)
    return SurfacePaths(
        first=point, last=point, path_m=path_m, amplitude=size * phase_factor(path_m, wavelength_m)
    )


def _specular_turn(
    between: NDArray[np.float64], centre_m: NDArray[np.float64], radius: float, height_m: NDArray[np.float64]
) -> NDArray[np.float64]:
    """Return where the path over a circle is shortest, as the angle (N,) from the direction of its start.

    Start and end lie `between` (N,) [rad] apart, at the distances `centre_m` (N, 2) from the centre and
    `height_m` (N, 2) above the plane of the circle [m].
    """
    low, high = np.zeros_like(between), between.copy()
    for _ in range(_HALVINGS):
        turn = (low + high) / 2
        slope = np.zeros_like(turn)
        for k, angle in enumerate((turn, turn - between)):
            flat = np.square(centre_m[:, k]) + radius**2 - 2 * radius * centre_m[:, k] * np.cos(angle)
            slope += centre_m[:, k] * np.sin(angle) / np.sqrt(flat + np.square(height_m[:, k]))
        low, high = np.where(slope < 0, turn, low), np.where(slope < 0, high, turn)
    return (low + high) / 2
