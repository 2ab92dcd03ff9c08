"""The echo of a smooth target as a phase sum over its surface, for a radar at any distance.

Physical optics with shooting and bouncing rays (Ling, Chou & Lee, IEEE TAP 37(2), 1989): a grid of points on
the target is illuminated by the radar and mirrored from patch to patch, and every illuminated point returns

    dA = Gamma cos(theta) exp(-j k (L + R)) / (L R) dS,      P = (link / lambda^2) |sum dA|^2

with L the unfolded length of the outward path and R that of the return. In the far field this is
sigma = 4 pi |sum|^2 / lambda^2 (4 pi A^2 / lambda^2 for a plate); for an infinite mirror it is the power of
the image, so no far field has to be assumed. Within a cell of the grid the phase is taken as linear (a sinc),
so the grid need not follow the wavelength; cells are short against the first Fresnel zone instead.
Curved targets are integrated by stationary phase across their curvature. Gamma is Fresnel's: test targets are
machined.
"""

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from echoscape.scenes.core.targets import Target
from echoscape.sim.raytracing.surface.fresnel import reflection, vertical_reflection

LEAST_STEPS = {"plate": 16, "dihedral": 32, "trihedral": 64}
"""Least number of points along each edge of a patch: corners are then good to 0.05 dB (tests/physics)."""
MOST_STEPS = 2048
"""Largest number of points along each edge of a patch: targets that would need more are refused."""
NEAREST_M = 0.1
"""A target has no echo for an antenna nearer than this, or inside it [m]."""
_FRESNEL_SHARE = 0.1
"""Longest edge of a cell over sqrt(lambda R): large plates then have the power of the image to 0.15 dB."""
MAX_BOUNCES = 3
_APERTURE = {"plate": 1.0, "dihedral": 1.5, "trihedral": 0.7}
"""Largest aperture over the product of the sizes: 1, sqrt(2) and 1 / sqrt(3), and what other bounces add."""
_GRAZING = 1e-3
"""Curved targets reflect nothing at a smaller cosine of incidence."""
_HALVINGS = 48
"""Of the angle in which a specular point is sought: to the rounding of doubles."""
_CURVE_STEP_M = 0.005
_CURVE_MOST = 4096

Vectors = NDArray[np.float64]


@dataclass(frozen=True, kw_only=True)
class SurfacePaths:
    """S paths from the radar over a target and back.

    Attributes:
        first: Points where the paths meet the target first (S, 3) float64 [m].
        last: Points where they meet it last (S, 3) float64 [m]; the same array where both coincide.
        path_m: Whole length (S,) float64 [m].
        amplitude: Share of the sum, dA without antenna gains (S,) complex128 [1].
    """

    first: Vectors
    last: Vectors
    path_m: NDArray[np.float64]
    amplitude: NDArray[np.complex128]

    def take(self, keep: NDArray) -> "SurfacePaths":
        """Return some of the paths.

        Args:
            keep: A mask or an index of them.

        Returns:
            These paths.
        """
        first = self.first[keep]
        return SurfacePaths(
            first=first,
            last=first if self.last is self.first else self.last[keep],
            path_m=self.path_m[keep],
            amplitude=self.amplitude[keep],
        )


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
    if min(_nearest_m(target, end) for end in ends) < NEAREST_M:
        return _no_paths()
    if target.kind == "point":
        return _point(target, *ends, wavelength_m=wavelength_m)
    if target.kind == "sphere":
        return _sphere(target, *ends, wavelength_m=wavelength_m, epsilon=epsilon)
    if target.kind == "cylinder":
        return _cylinder(target, *ends, wavelength_m=wavelength_m, epsilon=epsilon)
    return _flat(target, *ends, wavelength_m=wavelength_m, epsilon=epsilon)


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


def _no_paths() -> SurfacePaths:
    points, none = np.zeros((0, 3)), np.zeros(0, np.complex128)
    return SurfacePaths(first=points, last=points, path_m=np.zeros(0), amplitude=none)


def _nearest_m(target: Target, radar: Vectors) -> float:
    """Return the distance of the nearest part of a target that reflects [m], below 0 from inside it."""
    away = radar - np.array(target.position_m)
    if target.kind == "cylinder":  # its side is not seen from above
        return float(np.hypot(away[0], away[1])) - target.size_m[0]
    if target.kind == "sphere":
        return float(np.linalg.norm(away)) - target.size_m[0]
    if target.kind == "point":
        return float(np.linalg.norm(away))
    return _patches_of(target).nearest_m(radar)


def _phase_factor(path_m: NDArray, wavelength_m: float) -> NDArray[np.complex128]:
    """Return exp(-j k path)."""
    cycles = path_m / wavelength_m
    return np.exp(-2j * math.pi * (cycles - np.floor(cycles)))


# ---------------------------------------------------------------------- points and curved targets


def _point(target: Target, radar: Vectors, receiver: Vectors, *, wavelength_m: float) -> SurfacePaths:
    """Return the one path over a point of cross-section sigma: |sum| = sqrt(sigma / 4 pi) lambda / (L R)."""
    point = np.array([target.position_m])
    out_m, back_m = (np.linalg.norm(point - end, axis=1) for end in (radar, receiver))
    size = math.sqrt(target.rcs_m2 / (4 * math.pi)) * wavelength_m / (out_m * back_m)
    path_m = out_m + back_m
    return SurfacePaths(
        first=point, last=point, path_m=path_m, amplitude=size * _phase_factor(path_m, wavelength_m)
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
        return _no_paths()
    gamma = vertical_reflection(epsilon, direction, normal)
    across, along = (1 + back_m * (1 / out_m + bend / radius) for bend in (2 * cosine, 2 / cosine))
    size = gamma * (wavelength_m / (out_m * math.sqrt(across * along)))
    path_m = np.array([out_m + back_m])
    return SurfacePaths(
        first=point, last=point, path_m=path_m, amplitude=size * _phase_factor(path_m, wavelength_m)
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
        return _no_paths()
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
        first=point, last=point, path_m=path_m, amplitude=size * _phase_factor(path_m, wavelength_m)
    )


# ---------------------------------------------------------------------- plates and corners


@dataclass
class _Tubes:
    """S ray tubes over plane patches.

    first, point (S, 3): where they met the target first and last so far [m]; direction (S, 3): unit, of
    arrival; across, along (S, 3): its change over a tube in both directions of the grid [rad]; travelled (S,)
    [m]; solid (S,): solid angle from the radar [sr]; gamma (S,): reflection so far; patch (S,): number.
    """

    first: Vectors
    point: Vectors
    direction: Vectors
    across: Vectors
    along: Vectors
    travelled: NDArray[np.float64]
    solid: NDArray[np.float64]
    gamma: NDArray[np.float64]
    patch: NDArray[np.int64]

    def take(self, keep: NDArray) -> "_Tubes":
        """Return some of the tubes (an index or a mask)."""
        return _Tubes(**{name: value[keep] for name, value in vars(self).items()})


def _flat(
    target: Target, radar: Vectors, receiver: Vectors, *, wavelength_m: float, epsilon: complex
) -> SurfacePaths:
    """Return the paths over plane patches that reflect into each other."""
    shape = _patches_of(target)
    nearer = min(radar, receiver, key=shape.nearest_m)
    tubes, parts = _illuminated(shape, radar, shape.steps(nearer, target, wavelength_m)), []
    for _ in range(MAX_BOUNCES):
        normal = shape.normal[tubes.patch]
        normal = normal * -np.sign(_dot(tubes.direction, normal))[:, None]
        tubes.gamma = tubes.gamma * -_coefficient(tubes.direction, normal, epsilon)
        home = receiver - tubes.point
        seen = _dot(home, normal) > 0
        seen[seen] = shape.next(tubes.point[seen], _unit(home[seen]), tubes.patch[seen])[0] < 0
        parts.append(_returned(tubes.take(seen), normal[seen], receiver, wavelength_m))
        tubes = _mirrored(tubes, normal, shape)
    names = ("first", "last", "path_m", "amplitude")
    return SurfacePaths(**{name: np.concatenate([getattr(part, name) for part in parts]) for name in names})


def _patches_of(target: Target) -> "_Patches":
    return _Patches(target.patches, triangular=target.kind == "trihedral")


class _Patches:
    """Plane patches (P, 3, 3), each a corner and two edges, and their intersections with rays."""

    def __init__(self, patches: Vectors, *, triangular: bool) -> None:
        self.corner, self.first, self.second = patches.transpose(1, 0, 2)
        self.triangular = triangular
        area = np.cross(self.first, self.second)
        self.normal = _unit(area)
        # Dual edges: the two coordinates of a point in its patch are its products with them.
        scale = _dot(area, area)[:, None]
        self._duals = np.cross(self.second, area) / scale, np.cross(area, self.first) / scale

    def nearest_m(self, radar: Vectors) -> float:
        """Return the distance from `radar` (3,) to the nearest patch, taken as a whole parallelogram [m]."""
        offset = radar - self.corner
        u, v = (np.clip(_dot(offset, dual), 0, 1)[:, None] for dual in self._duals)
        return float(np.linalg.norm(offset - u * self.first - v * self.second, axis=1).min())

    def steps(self, radar: Vectors, target: Target, wavelength_m: float) -> tuple[int, int]:
        """Return the number of cells along each edge, so that the phase is about linear in each.

        Raises:
            ValueError: They would be too many.
        """
        cell_m = _FRESNEL_SHARE * math.sqrt(wavelength_m * self.nearest_m(radar))
        edges_m = [float(np.linalg.norm(edge, axis=1).max()) for edge in (self.first, self.second)]
        least = LEAST_STEPS[target.kind]
        first, second = (max(least, math.ceil(edge_m / cell_m)) for edge_m in edges_m)
        if max(first, second) > MOST_STEPS:
            raise ValueError(
                f"size_m of a {target.kind} of {max(edges_m):g} m is too large to be summed from "
                f"{self.nearest_m(radar):.3g} m away; a wall is an ordinary surface of any size"
            )
        largest = max(first, second)
        return (largest, largest) if self.triangular else (first, second)

    def grid(self, steps: tuple[int, int]) -> tuple[NDArray[np.int64], Vectors, NDArray[np.float64]]:
        """Return patch (S,), centre (S, 3) [m] and area (S,) [m^2] of the cells of all patches."""
        i, j = (values.ravel() for values in np.meshgrid(*map(np.arange, steps), indexing="ij"))
        inside = i + j < steps[0] if self.triangular else np.full(len(i), True)
        i, j = i[inside], j[inside]
        # Cells on the long edge of a triangle are halved; their centroid is a third from the right angle.
        half = (i + j == steps[0] - 1) & self.triangular
        middle = np.where(half, 1 / 3, 1 / 2)
        u, v = (((k + middle) / n)[None, :, None] for k, n in zip((i, j), steps, strict=True))
        point = self.corner[:, None] + u * self.first[:, None] + v * self.second[:, None]
        whole = np.linalg.norm(np.cross(self.first, self.second), axis=1) / (steps[0] * steps[1])
        area = whole[:, None] * np.where(half, 0.5, 1.0)
        return np.repeat(np.arange(len(self.corner)), len(i)), point.reshape(-1, 3), area.ravel()

    def next(self, point: Vectors, direction: Vectors, start: NDArray) -> tuple[NDArray[np.int64], NDArray]:
        """Return the next patch (S,) that rays from `point` (S, 3) on patch `start` (S,) meet, -1 for none.

        With it the distance (S,) along the unit `direction` (S, 3) [m].
        """
        nearest, best = np.full(len(point), -1), np.full(len(point), np.inf)
        for patch in range(len(self.corner)):
            closing = direction @ self.normal[patch]
            with np.errstate(divide="ignore", invalid="ignore"):
                distance = ((self.corner[patch] - point) @ self.normal[patch]) / closing
                offset = point + direction * distance[:, None] - self.corner[patch]
            u, v = offset @ self._duals[0][patch], offset @ self._duals[1][patch]
            inside = (u >= 0) & (v >= 0) & ((u + v <= 1) if self.triangular else (u <= 1) & (v <= 1))
            nearer = inside & (distance > 0) & (distance < best) & (start != patch)
            nearest, best = np.where(nearer, patch, nearest), np.where(nearer, distance, best)
        return nearest, best


def _illuminated(shape: _Patches, radar: Vectors, steps: tuple[int, int]) -> _Tubes:
    """Return the tubes from the radar to all cells that no other patch hides."""
    patch, point, area = shape.grid(steps)
    away = point - radar
    length = np.linalg.norm(away, axis=1)
    direction = away / length[:, None]
    solid = area * np.abs(_dot(direction, shape.normal[patch])) / length**2
    lit = (shape.next(point, -direction, patch)[0] < 0) & (solid > 0)
    ends = [(edge / n)[patch] for edge, n in zip((shape.first, shape.second), steps, strict=True)]
    across, along = ((end - direction * _dot(end, direction)[:, None]) / length[:, None] for end in ends)
    return _Tubes(
        first=point,
        point=point,
        direction=direction,
        across=across,
        along=along,
        travelled=length,
        solid=solid,
        gamma=np.ones(len(point)),
        patch=patch,
    ).take(lit)


def _mirrored(tubes: _Tubes, normal: Vectors, shape: _Patches) -> _Tubes:
    """Return the tubes that are reflected onto another patch."""

    def reflected(vector: Vectors) -> Vectors:
        return vector - 2 * _dot(vector, normal)[:, None] * normal

    direction = reflected(tubes.direction)
    patch, distance = shape.next(tubes.point, direction, tubes.patch)
    meets = patch >= 0
    distance = np.where(meets, distance, 0.0)
    return _Tubes(
        first=tubes.first,
        point=tubes.point + direction * distance[:, None],
        direction=direction,
        across=reflected(tubes.across),
        along=reflected(tubes.along),
        travelled=tubes.travelled + distance,
        solid=tubes.solid,
        gamma=tubes.gamma,
        patch=patch,
    ).take(meets)


def _returned(tubes: _Tubes, normal: Vectors, receiver: Vectors, wavelength_m: float) -> SurfacePaths:
    """Return the paths from the points of the tubes straight to the receiver."""
    away = tubes.point - receiver
    back_m = np.linalg.norm(away, axis=1)
    steepest = tubes.direction + away / back_m[:, None]
    facing = _dot(tubes.direction, normal)
    size = tubes.gamma * tubes.solid * tubes.travelled / back_m
    for change in (tubes.across, tubes.along):
        slant = _dot(normal, change) / facing
        end = tubes.travelled[:, None] * (change - tubes.direction * slant[:, None])
        size = size * np.sinc(_dot(steepest, end) / wavelength_m)
    path_m = tubes.travelled + back_m
    amplitude = size * _phase_factor(path_m, wavelength_m)
    return SurfacePaths(first=tubes.first, last=tubes.point, path_m=path_m, amplitude=amplitude)


def _coefficient(direction: Vectors, normal: Vectors, epsilon: complex) -> NDArray[np.float64]:
    """Return |Gamma| (S,) of a vertically polarised wave, its power divided between TE and TM."""
    te, tm = (np.abs(part) ** 2 for part in reflection(epsilon, np.clip(-_dot(direction, normal), 0, 1)))
    sideways = np.cross(direction, normal)
    up = np.array([0.0, 0.0, 1.0]) - direction * direction[:, 2:]
    scale = np.maximum(_dot(sideways, sideways) * _dot(up, up), 1e-12)
    share = np.clip(_dot(sideways, up) ** 2 / scale, 0, 1)
    return np.sqrt(share * te + (1 - share) * tm)


def _dot(a: Vectors, b: Vectors) -> NDArray[np.float64]:
    return np.einsum("sk,sk->s", a, b)


def _unit(vectors: Vectors) -> Vectors:
    return vectors / np.linalg.norm(vectors, axis=1)[:, None]
