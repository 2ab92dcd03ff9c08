"""Triangle meshes: made from vertices or quads, joined, moved, mirrored, and gathered to prototypes.

Faces are counter-clockwise seen from outside. Shapes are computed in float64 and rounded once to float32.
"""

from collections.abc import Iterable, Sequence

import numpy as np
from numpy.typing import ArrayLike, NDArray

from echoscape.scenes.core.scene import Mesh, Prototype, joined_normals

_MIN_AREA_M2 = 1e-8
"""Smaller faces are dropped; they arise where a shape tapers to an edge."""


def mesh(vertices: ArrayLike, faces: ArrayLike, normals: ArrayLike | None = None) -> Mesh:
    """Make a mesh without faces of zero area.

    Args:
        vertices: Positions (V, 3) [m].
        faces: Vertex indices (F, 3).
        normals: Unit normals of the curved surface at the corners of each face (F, 3, 3), zero for faces that
            are flat; None where all are.

    Returns:
        The mesh.
    """
    points = np.asarray(vertices, dtype=np.float32).reshape(-1, 3)
    triangles = np.asarray(faces, dtype=np.uint32).reshape(-1, 3)
    kept = areas(points, triangles) > _MIN_AREA_M2
    smooth = None if normals is None else np.asarray(normals, np.float32).reshape(-1, 3, 3)[kept]
    return Mesh(vertices=points, faces=triangles[kept], normals=smooth)


def areas(vertices: NDArray[np.float32], faces: NDArray[np.uint32]) -> NDArray[np.float64]:
    """Return the area of each face.

    Args:
        vertices: Positions (V, 3) float32 [m].
        faces: Vertex indices (F, 3) uint32.

    Returns:
        Areas (F,) [m^2].
    """
    first, second, third = vertices[faces.T].astype(np.float64)
    ux, uy, uz = (second - first).T
    vx, vy, vz = (third - first).T
    return 0.5 * np.sqrt((uy * vz - uz * vy) ** 2 + (uz * vx - ux * vz) ** 2 + (ux * vy - uy * vx) ** 2)


def quads(corners: ArrayLike) -> Mesh:
    """Make a mesh of separate quads.

    Args:
        corners: Corners (Q, 4, 3) [m], each quad counter-clockwise seen from its outer side.

    Returns:
        The mesh, two triangles per quad.
    """
    points = np.asarray(corners, dtype=np.float64).reshape(-1, 4, 3)
    first = 4 * np.arange(len(points))
    return mesh(points, first[:, None] + [0, 1, 2, 0, 2, 3])


def merge(meshes: Iterable[Mesh]) -> Mesh:
    """Concatenate meshes.

    Args:
        meshes: The meshes; may be none.

    Returns:
        One mesh.
    """
    parts = list(meshes)
    if not parts:
        return Mesh(vertices=np.zeros((0, 3), np.float32), faces=np.zeros((0, 3), np.uint32))
    start = np.cumsum([0] + [len(part.vertices) for part in parts[:-1]])
    faces = [part.faces + np.uint32(offset) for part, offset in zip(parts, start, strict=True)]
    return Mesh(
        vertices=np.concatenate([part.vertices for part in parts]),
        faces=np.concatenate(faces),
        normals=joined_normals(parts),
    )


def moved(
    part: Mesh,
    offset_m: Sequence[float] = (0.0, 0.0, 0.0),
    *,
    yaw_rad: float = 0.0,
    rotation: ArrayLike | None = None,
) -> Mesh:
    """Rotate and translate a mesh.

    Args:
        part: The mesh.
        offset_m: Translation x, y, z [m], applied last.
        yaw_rad: Rotation about z [rad], applied after `rotation`.
        rotation: Rotation matrix (3, 3), applied first; None for none.

    Returns:
        The transformed mesh.
    """
    cos, sin = np.cos(yaw_rad), np.sin(yaw_rad)
    turn = np.array([[cos, -sin, 0.0], [sin, cos, 0.0], [0.0, 0.0, 1.0]])
    turn = turn if rotation is None else turn @ np.asarray(rotation, dtype=np.float64)
    points = part.vertices.astype(np.float64) @ turn.T + np.asarray(offset_m, dtype=np.float64)
    normals = None if part.normals is None else (part.normals @ turn.T).astype(np.float32)
    return Mesh(vertices=points.astype(np.float32), faces=part.faces, normals=normals)


def mirrored(part: Mesh) -> Mesh:
    """Mirror a mesh in the x-z plane, so that left becomes right; its faces still point outwards.

    Args:
        part: The mesh.

    Returns:
        The mirrored mesh.
    """
    flip = np.array([1, -1, 1], np.float32)
    normals = None if part.normals is None else part.normals[:, ::-1] * flip
    return Mesh(vertices=part.vertices * flip, faces=part.faces[:, ::-1].copy(), normals=normals)


def prototype(name: str, class_name: str, parts: dict[str, Mesh]) -> Prototype:
    """Make a prototype, shifted so that its bounding box is centred on the origin and stands on z = 0.

    Args:
        name: Name of the prototype.
        class_name: Class of its objects.
        parts: Meshes by name of the material.

    Returns:
        The prototype.
    """
    points = np.concatenate([part.vertices[np.unique(part.faces)] for part in parts.values()])
    low, high = points.min(axis=0).astype(np.float64), points.max(axis=0).astype(np.float64)
    shift = (-(low[0] + high[0]) / 2, -(low[1] + high[1]) / 2, -low[2])
    length, width, height = (high - low).tolist()
    return Prototype(
        name=name,
        class_name=class_name,
        parts={material: moved(part, shift) for material, part in parts.items()},
        extent_m=(length, width, height),
    )
