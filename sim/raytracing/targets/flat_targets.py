"""Paths over plates and corners: ray tubes that plane patches reflect into each other.

Shooting and bouncing rays (Ling, Chou & Lee, IEEE TAP 37(2), 1989). Within a cell of the grid the phase is
taken as linear (a sinc), so the grid need not follow the wavelength; cells are short against the first
Fresnel zone instead.
"""

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from echoscape.scenes.core.targets import Target
from echoscape.sim.raytracing.surface.fresnel import reflection
from echoscape.sim.raytracing.targets.surface_paths import SurfacePaths, Vectors, phase_factor

_LEAST_STEPS = {"plate": 16, "dihedral": 32, "trihedral": 64}
"""Least number of points along each edge of a patch: corners are then good to 0.05 dB (tests/physics)."""
_MOST_STEPS = 2048
"""Largest number of points along each edge of a patch: targets that would need more are refused."""
_FRESNEL_SHARE = 0.1
"""Longest edge of a cell over sqrt(lambda R): large plates then have the power of the image to 0.15 dB."""
_MAX_BOUNCES = 3


def target_paths(
    target: Target, radar: Vectors, receiver: Vectors, *, wavelength_m: float, epsilon: complex
) -> SurfacePaths:
    """Return the paths over a plate, dihedral or trihedral.

    Args:
        target: The target.
        radar: Position of the antenna (3,) [m], or of its image in a mirror.
        receiver: Where the paths end (3,) [m].
        wavelength_m: Wavelength [m].
        epsilon: Complex relative permittivity of the material of the target.

    Returns:
        The paths.

    Raises:
        ValueError: The target is too large to be summed from so near.
    """
    shape = _patches_of(target)
    nearer = min(radar, receiver, key=shape.nearest_m)
    tubes, parts = _illuminated(shape, radar, shape.steps(nearer, target, wavelength_m)), []
    for _ in range(_MAX_BOUNCES):
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


def nearest_m(target: Target, radar: Vectors) -> float:
    """Return the distance of the nearest part of a plate, dihedral or trihedral.

    Args:
        target: The target.
        radar: Position of the antenna (3,) [m].

    Returns:
        The distance [m], each patch taken as a whole parallelogram.
    """
    return _patches_of(target).nearest_m(radar)


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
        least = _LEAST_STEPS[target.kind]
        first, second = (max(least, math.ceil(edge_m / cell_m)) for edge_m in edges_m)
        if max(first, second) > _MOST_STEPS:
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
    amplitude = size * phase_factor(path_m, wavelength_m)
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
