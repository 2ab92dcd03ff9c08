"""Counts of a scene: triangles, objects by class, area by material, size.

*Stored* triangles count every mesh once; *placed* triangles count a prototype once for each placement.
"""

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from echoscape.scenes.core.scene import CLASSES, Mesh, Scene


@dataclass(frozen=True, kw_only=True)
class ClassCount:
    """Counts of one class.

    Attributes:
        objects: Number of objects.
        triangles: Triangles that they are placed with.
    """

    objects: int
    triangles: int


@dataclass(frozen=True, kw_only=True)
class MaterialCount:
    """Counts of one material.

    Attributes:
        triangles: Triangles as placed.
        area_m2: Their area [m^2].
    """

    triangles: int
    area_m2: float


@dataclass(frozen=True, kw_only=True)
class Inventory:
    """Counts of a scene.

    Attributes:
        triangles_stored: Triangles of all meshes, each counted once.
        triangles_placed: Triangles as placed.
        classes: Counts by class.
        materials: Counts by material.
        low_m: Lowest coordinates of the scene's bounding box [m].
        high_m: Highest coordinates of the scene's bounding box [m].
    """

    triangles_stored: int
    triangles_placed: int
    classes: dict[str, ClassCount]
    materials: dict[str, MaterialCount]
    low_m: tuple[float, float, float]
    high_m: tuple[float, float, float]


@dataclass(frozen=True, kw_only=True)
class _Piece:
    """A placed mesh of one material: areas (F,) [m^2], instances (F,), bounding box (2, 3) [m]."""

    material: str
    area: NDArray[np.float64]
    instance: NDArray[np.uint32]
    box: NDArray[np.float64]


def inventory(scene: Scene) -> Inventory:
    """Count triangles, objects and areas of a scene.

    Args:
        scene: The scene.

    Returns:
        Its counts.
    """
    triangles = np.zeros(len(scene.instance_class), np.int64)
    materials: dict[str, MaterialCount] = {}
    boxes = [np.full((2, 3), np.nan)]
    for piece in _pieces(scene):
        triangles += np.bincount(piece.instance, minlength=len(triangles))
        before = materials.get(piece.material, MaterialCount(triangles=0, area_m2=0.0))
        materials[piece.material] = MaterialCount(
            triangles=before.triangles + len(piece.area), area_m2=before.area_m2 + float(piece.area.sum())
        )
        boxes.append(piece.box)
    edges = np.array(boxes[1:] or [np.zeros((2, 3))])
    low, high = edges[:, 0].min(axis=0).tolist(), edges[:, 1].max(axis=0).tolist()
    return Inventory(
        triangles_stored=_stored(scene),
        triangles_placed=int(triangles.sum()),
        classes=_classes(scene, triangles),
        materials=dict(sorted(materials.items())),
        low_m=(low[0], low[1], low[2]),
        high_m=(high[0], high[1], high[2]),
    )


def _classes(scene: Scene, triangles: NDArray[np.int64]) -> dict[str, ClassCount]:
    """Return the counts of the classes that occur, in the order of their ids; `triangles` (I,) by object."""
    ids = scene.instance_class.astype(np.intp)
    objects = np.bincount(ids[1:], minlength=len(CLASSES))
    faces = np.bincount(ids, weights=triangles, minlength=len(CLASSES))
    return {
        name: ClassCount(objects=int(objects[class_id]), triangles=int(faces[class_id]))
        for class_id, name in enumerate(CLASSES)
        if objects[class_id]
    }


def _stored(scene: Scene) -> int:
    """Return the triangles of all meshes, each prototype that is placed counted once."""
    used = np.unique(scene.placements.prototype).tolist()
    parts = [mesh for index in used for mesh in scene.prototypes[index].parts.values()]
    return sum(len(mesh.faces) for mesh in [*scene.static.values(), *parts])


def _pieces(scene: Scene) -> Iterator[_Piece]:
    """Yield every mesh of every material at each of its placements."""
    for material, mesh in scene.static.items():
        if len(mesh.faces):
            yield _Piece(
                material=material, area=_areas(mesh), instance=mesh.instance, box=_box(mesh.vertices)
            )
    placed = scene.placements
    for index, prototype in enumerate(scene.prototypes):
        for material, mesh in prototype.parts.items():
            if len(mesh.faces) == 0:
                continue
            area = _areas(mesh)
            for i in np.flatnonzero(placed.prototype == index):
                yaw, scale = float(placed.yaw[i]), float(placed.scale[i])
                cos, sin = np.cos(yaw), np.sin(yaw)
                turn = scale * np.array([[cos, -sin, 0], [sin, cos, 0], [0, 0, 1]])
                yield _Piece(
                    material=material,
                    area=area * scale**2,
                    instance=np.full(len(mesh.faces), placed.instance[i]),
                    box=_box(mesh.vertices @ turn.T + placed.position[i]),
                )


def _areas(mesh: Mesh) -> NDArray[np.float64]:
    """Return the areas (F,) of a mesh's faces [m^2]."""
    corners = mesh.vertices[mesh.faces].astype(np.float64)
    return np.linalg.norm(np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0]), axis=1) / 2


def _box(vertices: NDArray) -> NDArray[np.float64]:
    """Return the lowest and highest coordinates (2, 3) of vertices (V, 3) [m]."""
    return np.array([vertices.min(axis=0), vertices.max(axis=0)], np.float64)
