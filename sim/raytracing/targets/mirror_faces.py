"""The flat faces of a scene that may be mirrors, gathered by the planes that they lie in."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from echoscape.scenes.core.materials import MATERIAL_NAMES
from echoscape.scenes.core.scene import Mesh, Scene

LEAST_AREA_M2 = 3.0
"""Smallest plane that is taken as a mirror [m^2]."""
NORMAL_STEP = 1e-3
"""Step of the normal by which faces are gathered in planes."""
_OFFSET_STEP_M = 1e-2
"""Step of the distance from the origin by which they are."""
_VOLUMES = ("foliage", "person")
"""Materials whose faces stand for leaves or cloth in all directions: no plane mirrors."""
_LEAST_FACE_M2 = 0.02
_LEAST_WIDTH_M = 0.05
"""Faces of less area, or narrower, are far smaller than a Fresnel zone."""

Vectors = NDArray[np.float64]


@dataclass(frozen=True, kw_only=True)
class MirrorFaces:
    """The F flat faces of a scene that may be mirrors, in order of the G planes that they lie in.

    Attributes:
        corners: Corners of each face (F, 3, 3) float64 [m].
        normal: Unit normal of each face (F, 3) float64.
        material: Material id of each face (F,) int64.
        instance: Instance id of each face (F,) int64.
        middle: Mean of the corners of each face (F, 3) float64 [m].
        reach_m: Distance of the farthest corner from it (F,) float64 [m].
        first: First face of each plane, and F at the end (G + 1,) int64.
        centre: Centre of a sphere about the faces of each plane (G, 3) float64 [m].
        radius_m: Its radius (G,) float64 [m].
    """

    corners: NDArray[np.float64]
    normal: Vectors
    material: NDArray[np.int64]
    instance: NDArray[np.int64]
    middle: Vectors
    reach_m: NDArray[np.float64]
    first: NDArray[np.int64]
    centre: Vectors
    radius_m: NDArray[np.float64]


def mirror_faces(scene: Scene) -> MirrorFaces:
    """Gather the flat faces of a scene by planes, but for those of its coherent targets.

    Args:
        scene: The scene.

    Returns:
        Faces of all planes of `LEAST_AREA_M2` or more.
    """
    own = [each.instance for each in scene.targets if each.target.coherent]
    parts = [(np.zeros((0, 3, 3)), np.zeros(0, np.int64), np.zeros(0, np.int64))]
    parts += [
        _flat_faces(mesh, material, mesh.instance.astype(np.int64), np.isin(mesh.instance, own))
        for material, mesh in scene.static.items()
    ]
    places = scene.placements
    for index in np.unique(places.prototype).tolist():
        placed = np.flatnonzero(places.prototype == index)
        for material, mesh in scene.prototypes[index].parts.items():
            none = np.zeros(len(mesh.faces), np.bool_)
            corners, number, _ = _flat_faces(mesh, material, np.zeros(len(mesh.faces), np.int64), none)
            cosine, sine = (each[:, None, None] for each in (np.cos(places.yaw), np.sin(places.yaw)))
            for at in placed.tolist():
                x, y, z = np.moveaxis(corners * places.scale[at], -1, 0)
                turned = np.stack([cosine[at] * x - sine[at] * y, sine[at] * x + cosine[at] * y, z], axis=-1)
                instance = np.full(len(corners), int(places.instance[at]))
                parts.append((turned + places.position[at], number, instance))
    return _by_planes(*(np.concatenate(each) for each in zip(*parts, strict=True)))


def _flat_faces(
    mesh: Mesh, material: str, instance: NDArray[np.int64], left_out: NDArray[np.bool_]
) -> tuple[NDArray[np.float64], NDArray[np.int64], NDArray[np.int64]]:
    """Return corners (F, 3, 3), material and instance (F,) of the faces that may be part of a mirror."""
    if material in _VOLUMES:
        left_out = np.ones_like(left_out)
    if mesh.normals is not None:
        left_out = left_out | mesh.normals.any(axis=(1, 2))
    keep = np.flatnonzero(~left_out)
    corners = mesh.vertices[mesh.faces[keep]].astype(np.float64)
    edges = np.roll(corners, -1, axis=1) - corners
    twice_m2 = np.linalg.norm(np.cross(edges[:, 0], edges[:, 1]), axis=1)
    longest_m = np.linalg.norm(edges, axis=2).max(axis=1, initial=0.0)
    large = (twice_m2 > 2 * _LEAST_FACE_M2) & (twice_m2 > _LEAST_WIDTH_M * longest_m)
    number = np.full(int(large.sum()), MATERIAL_NAMES.index(material), np.int64)
    return corners[large], number, instance[keep[large]]


def _by_planes(
    corners: NDArray[np.float64], material: NDArray[np.int64], instance: NDArray[np.int64]
) -> MirrorFaces:
    """Sort faces by planes and leave out those of small planes."""
    normal = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    area_m2 = np.linalg.norm(normal, axis=1) / 2
    normal /= 2 * area_m2[:, None]
    offset_m = np.einsum("fk,fk->f", normal, corners[:, 0])
    _, plane = np.unique(_plane_keys(normal, offset_m, material), return_inverse=True)
    large = np.bincount(plane, area_m2)[plane] >= LEAST_AREA_M2 if len(plane) else plane.astype(np.bool_)
    order = np.flatnonzero(large)[np.argsort(plane[large], kind="stable")]
    corners, plane = corners[order], plane[order]
    first = np.flatnonzero(np.diff(plane, prepend=-1))
    middle = corners.mean(axis=1)
    counts = np.diff(first, append=len(plane))
    centre = np.add.reduceat(middle, first) / counts[:, None] if len(first) else np.zeros((0, 3))
    away_m = np.linalg.norm(corners - np.repeat(centre, counts, axis=0)[:, None], axis=2).max(
        axis=1, initial=0
    )
    return MirrorFaces(
        corners=corners,
        normal=normal[order],
        material=material[order],
        instance=instance[order],
        middle=middle,
        reach_m=np.linalg.norm(corners - middle[:, None], axis=2).max(axis=1, initial=0),
        first=np.append(first, len(plane)),
        centre=centre,
        radius_m=np.maximum.reduceat(away_m, first) if len(first) else np.zeros(0),
    )


def _plane_keys(
    normal: Vectors, offset_m: NDArray[np.float64], material: NDArray[np.int64]
) -> NDArray[np.uint64]:
    """Return a number (F,) that faces of one plane and material share."""
    steps = [*np.rint(normal / NORMAL_STEP).T, np.rint(offset_m / _OFFSET_STEP_M), material]
    key = np.zeros(len(material), np.uint64)
    for step in steps:
        key = (key ^ np.asarray(step, np.int64).astype(np.uint64)) * np.uint64(0x9E3779B97F4A7C15)
        key ^= key >> np.uint64(29)
    return key
