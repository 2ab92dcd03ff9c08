"""Slender metal facets of a scene, divided along their length: bars of railings, posts, rails of barriers.

The point of each part is a hash of where its facet is (SplitMix64: Steele, Lea & Flood, OOPSLA 2014), so that
it does not depend on what else is in the scene.
"""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from echoscape.scenes.core.scene import Mesh, Prototype, Scene

MATERIAL = "metal"
"""Material of the facets: of the others none reflects more than a fifth."""
WIDEST_M = 0.3
"""Facets of this width and more are met by enough rays at any range [m]."""
PART_M = 0.1
"""Length of the parts [m]: most of a row of posts is hidden by those in front, so a facet needs several."""
LEAST_PARTS = 2
"""Fewest parts of a facet."""
STEEPEST = 0.9
"""Largest vertical component of the normal of a facet: those that face up or down do not face a radar."""
_STEP = np.uint64(0x9E3779B97F4A7C15)


@dataclass(frozen=True, kw_only=True)
class SlenderParts:
    """N parts of slender facets in the world.

    Attributes:
        point: A point in each (N, 3) float64 [m].
        normal: Unit normals (N, 3) float32.
        width_m: Width of the facet of each (N,) float32 [m].
        area_m2: Areas (N,) float32 [m^2].
    """

    point: NDArray[np.float64]
    normal: NDArray[np.float32]
    width_m: NDArray[np.float32]
    area_m2: NDArray[np.float32]


def facet_widths(corners: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return the widths of facets: twice their area over their longest edge.

    Args:
        corners: Corners of the facets (F, 3, 3) [m].

    Returns:
        Widths (F,) [m], 0 for a facet without area.
    """
    doubled = np.linalg.norm(np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0]), axis=1)
    longest = np.linalg.norm(corners - np.roll(corners, -1, axis=1), axis=2).max(axis=1)
    return doubled / np.maximum(longest, 1e-9)


def slender_parts(scene: Scene, *, key: int) -> SlenderParts:
    """Divide the flat slender metal facets of all that is at rest.

    Args:
        scene: Static meshes, prototypes and their placements.
        key: Decides the points, from 0 to 2^64 - 1.

    Returns:
        Their parts.
    """
    places = scene.placements
    found = [np.zeros((0, 3, 3))]
    if MATERIAL in scene.static:
        found.append(_slender(scene.static[MATERIAL]))
    for number in np.unique(places.prototype).tolist():
        mesh = scene.prototypes[number].parts.get(MATERIAL)
        if mesh is None:
            continue
        at = places.prototype == number
        found.append(_placed(_slender(mesh), places.position[at], places.yaw[at], places.scale[at]))
    return _divided(np.concatenate(found), key)


def prototype_parts(prototype: Prototype, *, key: int) -> SlenderParts:
    """Divide the flat slender metal facets of a prototype.

    Args:
        prototype: The prototype.
        key: Decides the points, from 0 to 2^64 - 1.

    Returns:
        Their parts, in the frame of the prototype.
    """
    mesh = prototype.parts.get(MATERIAL)
    return _divided(np.zeros((0, 3, 3)) if mesh is None else _slender(mesh), key)


def is_slender(mesh: Mesh, corners: NDArray[np.float64]) -> NDArray[np.bool_]:
    """Return which faces of a metal mesh rays may be aimed at.

    Args:
        mesh: The mesh.
        corners: Corners of its faces (F, 3, 3) [m].

    Returns:
        Whether each is flat, narrow, has an area and does not face up or down (F,) bool.
    """
    width = facet_widths(corners)
    normal = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    upright = np.abs(normal[:, 2]) < STEEPEST * np.linalg.norm(normal, axis=1)
    slender = (width > 1e-4) & (width < WIDEST_M) & upright
    return slender if mesh.normals is None else slender & ~np.any(mesh.normals != 0, axis=(1, 2))


def _slender(mesh: Mesh) -> NDArray[np.float64]:
    """Return the corners of the slender faces of a mesh (F, 3, 3) [m]."""
    corners = mesh.vertices[mesh.faces].astype(np.float64)
    return corners[is_slender(mesh, corners)]


def _placed(
    corners: NDArray[np.float64], position: NDArray, yaw: NDArray, scale: NDArray
) -> NDArray[np.float64]:
    """Return faces (F, 3, 3) at P placements, as (P F, 3, 3) [m]."""
    cosine, sine, size = (each[:, None, None] for each in (np.cos(yaw), np.sin(yaw), scale))
    x, y, z = (corners[..., axis] * size for axis in range(3))
    # One product at a time: a placement has the same bits whatever others there are.
    turned = np.stack([cosine * x - sine * y, sine * x + cosine * y, z], axis=-1)
    return (turned + position[:, None, None, :]).reshape(-1, 3, 3)


def _divided(corners: NDArray[np.float64], key: int) -> SlenderParts:
    """Divide faces (F, 3, 3) along their longest edges."""
    edges = np.linalg.norm(corners - np.roll(corners, -1, axis=1), axis=2)
    start = edges.argmax(axis=1)
    row = np.arange(len(corners))
    a, b, apex = (corners[row, (start + k) % 3] for k in range(3))
    along, aside = b - a, apex - a
    length = np.linalg.norm(along, axis=1)
    foot = np.clip(np.einsum("fk,fk->f", along, aside) / np.maximum(length, 1e-9) ** 2, 1e-6, 1 - 1e-6)
    across = aside - along * foot[:, None]
    count = np.maximum(np.ceil(length / PART_M), LEAST_PARTS).astype(np.int64)
    face = np.repeat(row, count)
    number = np.arange(len(face)) - np.repeat(np.cumsum(count) - count, count)
    first = _mixed(_face_hash(corners, key)[face] + number.astype(np.uint64) * _STEP)
    place = (number + _fraction(first)) / count[face]
    height = np.where(place < foot[face], place / foot[face], (1 - place) / (1 - foot[face]))
    up = height * _fraction(_mixed(first + _STEP))
    at = a[face] + along[face] * place[:, None] + across[face] * up[:, None]
    width = np.linalg.norm(across, axis=1)
    normal = np.cross(along, across) / np.maximum(length * width, 1e-12)[:, None]
    return SlenderParts(
        point=at,
        normal=normal[face].astype(np.float32),
        width_m=width[face].astype(np.float32),
        area_m2=(height * (length * width / count)[face]).astype(np.float32),
    )


def _face_hash(corners: NDArray[np.float64], key: int) -> NDArray[np.uint64]:
    """Return a hash of the coordinates of each face (F, 3, 3) and the key (F,)."""
    bits = (corners.reshape(len(corners), 9) + 0.0).view(np.uint64)  # adding 0 leaves no negative zeros
    mixed = np.full(len(corners), key, np.uint64)
    for column in range(9):
        mixed = _mixed((mixed ^ bits[:, column]) + _STEP)
    return mixed


def _mixed(value: NDArray[np.uint64]) -> NDArray[np.uint64]:
    """Return numbers whose every bit depends on every bit of the value: the finaliser of SplitMix64."""
    value = (value ^ (value >> np.uint64(30))) * np.uint64(0xBF58476D1CE4E5B9)
    value = (value ^ (value >> np.uint64(27))) * np.uint64(0x94D049BB133111EB)
    return value ^ (value >> np.uint64(31))


def _fraction(value: NDArray[np.uint64]) -> NDArray[np.float64]:
    """Return hashes as fractions, 0 to below 1."""
    return (value >> np.uint64(11)).astype(np.float64) * 2.0**-53
