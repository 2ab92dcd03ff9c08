"""Test targets with exact positions: corner reflectors, plates, spheres, cylinders, walls and box vehicles.

The frame of a target has x along its boresight (towards the radar), y left and z up. Most targets are
*coherent*: smooth and small compared with the beam, so that their echo is a phase sum over their surface
(computed in `sim`); walls and vehicles are ordinary surfaces. Every target shadows what is behind it and
reflects other echoes.
"""

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from echoscape.scenes.core.materials import MATERIAL_NAMES

_LEAST_SIZE_M, _MOST_SIZE_M = 1e-3, 200.0
_FARTHEST_M = 1e5
_RCS_M2 = (1e-6, 1e8)


@dataclass(frozen=True)
class _Kind:
    """A kind of target: names of its sizes, its class, whether it is coherent and made of flat patches."""

    sizes: tuple[str, ...]
    class_name: str
    coherent: bool
    flat: bool = False


KINDS: dict[str, _Kind] = {
    "point": _Kind((), "target", True),
    "trihedral": _Kind(("edge",), "target", True, flat=True),
    "dihedral": _Kind(("width", "height"), "target", True, flat=True),
    "plate": _Kind(("width", "height"), "target", True, flat=True),
    "sphere": _Kind(("radius",), "target", True),
    "cylinder": _Kind(("radius", "height"), "target", True),
    "wall": _Kind(("length", "height", "thickness"), "wall", False),
    "vehicle": _Kind(("length", "width", "height"), "car", False),
}
"""Kinds of targets and the names of their sizes."""


@dataclass(frozen=True, kw_only=True)
class Target:
    """One test target.

    Attributes:
        kind: A key of `KINDS`.
        position_m: World position x, y, z of the reference point [m]: the apex of a trihedral, the middle of
            a dihedral's inner edge (vertical, `height` long, between plates `width` wide), the centre of a
            plate, sphere or upright cylinder, the foot of a wall's front face, or the ground below the centre
            of a vehicle.
        heading_rad: Heading of the boresight, counter-clockwise from world x [rad].
        elevation_rad: Elevation of the boresight above the horizon [rad]; flat and corner targets only.
        size_m: Sizes in the order of `KINDS` [m].
        material: Name of a material of `scenes.core.materials`.
        rcs_m2: Radar cross-section of a point target [m^2].
    """

    kind: str
    position_m: tuple[float, float, float]
    heading_rad: float = 0.0
    elevation_rad: float = 0.0
    size_m: tuple[float, ...] = ()
    material: str = "metal"
    rcs_m2: float = 1.0

    def __post_init__(self) -> None:
        """Check all fields.

        Raises:
            ValueError: A field is not allowed; the message names it.
        """
        if self.kind not in KINDS:
            raise ValueError(f"kind must be one of {', '.join(KINDS)}, got {self.kind!r}")
        if self.material not in MATERIAL_NAMES:
            raise ValueError(f"material must be one of {', '.join(MATERIAL_NAMES)}, got {self.material!r}")
        sizes = KINDS[self.kind].sizes
        if len(self.size_m) != len(sizes):
            wanted = f"({', '.join(sizes)})" if sizes else "empty"
            raise ValueError(f"size_m of a {self.kind} must be {wanted} [m], got {self.size_m}")
        if len(self.position_m) != 3:
            raise ValueError(f"position_m must be x, y, z [m], got {self.position_m}")
        numbers = (*self.position_m, self.heading_rad, self.elevation_rad, *self.size_m, self.rcs_m2)
        if not all(math.isfinite(number) for number in numbers):
            raise ValueError(f"position_m, heading_rad, elevation_rad, size_m, rcs_m2 must be finite: {self}")
        for name, size in zip(sizes, self.size_m, strict=True):
            if not _LEAST_SIZE_M <= size <= _MOST_SIZE_M:
                limits = f"between {_LEAST_SIZE_M:g} and {_MOST_SIZE_M:g} m"
                raise ValueError(f"{name} of a {self.kind} must be {limits}, got {size:g}")
        if max(map(abs, self.position_m)) > _FARTHEST_M:
            raise ValueError(f"position_m must be within {_FARTHEST_M:g} m of 0, got {self.position_m}")
        if abs(self.elevation_rad) > math.pi / 2:
            raise ValueError(f"elevation_rad must be within a right angle, got {self.elevation_rad:g}")
        if not _RCS_M2[0] <= self.rcs_m2 <= _RCS_M2[1]:
            raise ValueError(f"rcs_m2 must be between {_RCS_M2[0]:g} and {_RCS_M2[1]:g}, got {self.rcs_m2:g}")
        if self.elevation_rad and not KINDS[self.kind].flat:
            raise ValueError(f"elevation_rad must be 0 for a {self.kind}, got {self.elevation_rad}")

    @property
    def coherent(self) -> bool:
        """Whether the echo is a phase sum over the surface."""
        return KINDS[self.kind].coherent

    @property
    def reach_m(self) -> float:
        """Distance from the reference point within which the whole target lies [m]."""
        return float(np.linalg.norm(self.size_m)) if self.size_m else 0.0

    @property
    def axes(self) -> NDArray[np.float64]:
        """Axes of the target's frame in the world (3, 3): rows are boresight, left and up."""
        cos_h, sin_h = math.cos(self.heading_rad), math.sin(self.heading_rad)
        cos_e, sin_e = math.cos(self.elevation_rad), math.sin(self.elevation_rad)
        return np.array(
            [
                [cos_e * cos_h, cos_e * sin_h, sin_e],
                [-sin_h, cos_h, 0.0],
                [-sin_e * cos_h, -sin_e * sin_h, cos_e],
            ]
        )

    @property
    def patches(self) -> NDArray[np.float64]:
        """Flat patches of a plate or corner reflector in the world (P, 3, 3) [m]; none for other kinds.

        The rows of a patch are a corner and the two edge vectors that start there. A patch is the
        parallelogram between the edges; for a trihedral it is the triangle.
        """
        patches = _flat_patches(self.kind, self.size_m) @ self.axes
        patches[:, 0] += np.array(self.position_m)
        return patches


@dataclass(frozen=True, kw_only=True)
class PlacedTarget:
    """A target in a scene.

    Attributes:
        target: The target.
        instance: Its instance id in the scene.
    """

    target: Target
    instance: int


def _flat_patches(kind: str, size_m: tuple[float, ...]) -> NDArray[np.float64]:
    """Return patches (P, 3, 3) [m] in the target's frame: a corner and two edges, facing the boresight."""
    if kind == "plate":
        y, z = size_m
        return np.array([[[0, -y / 2, -z / 2], [0, y, 0], [0, 0, z]]], np.float64)
    if kind == "dihedral":
        # Plates of `width` at 45 degrees to the boresight, meeting in an upright edge.
        w, z = size_m[0] / math.sqrt(2), size_m[1]
        foot = [0, 0, -z / 2]
        left, right = [foot, [w, w, 0], [0, 0, z]], [foot, [0, 0, z], [w, -w, 0]]
        return np.array([left, right], np.float64)
    if kind == "trihedral":
        # Three edges at equal angles to the boresight, one of them straight above it.
        turns = math.pi / 2 + 2 * math.pi / 3 * np.arange(3)
        edges = np.column_stack([np.ones(3), math.sqrt(2) * np.cos(turns), math.sqrt(2) * np.sin(turns)])
        edges *= size_m[0] / math.sqrt(3)
        return np.array([[np.zeros(3), edges[i], edges[(i + 1) % 3]] for i in range(3)])
    return np.zeros((0, 3, 3))
