"""Collects the objects of a scene: assigns instance ids, merges stationary meshes, lists placed prototypes.

It also records occupied ground, so that objects do not overlap.
"""

from collections.abc import Mapping
from dataclasses import replace

import numpy as np
import shapely
from numpy.typing import NDArray
from shapely.geometry import Polygon
from shapely.geometry.base import BaseGeometry

from echoscape.scenes.core.scene import CLASSES, Mesh, Placements, Prototype, StaticMesh, joined_normals

_CELL_M = 12.0


class SceneBuilder:
    """A scene under construction."""

    def __init__(self, prototypes: tuple[Prototype, ...]) -> None:
        """Start an empty scene.

        Args:
            prototypes: Shapes that can be placed.
        """
        self.prototypes = prototypes
        self._row = {prototype.name: row for row, prototype in enumerate(prototypes)}
        self._classes: list[int] = [0]
        self._made: dict[str, list[tuple[Mesh, int]]] = {}
        self._placed: list[tuple[int, int, float, float, float, float, float]] = []

    def __getitem__(self, name: str) -> Prototype:
        """Return a prototype by its name."""
        return self.prototypes[self._row[name]]

    def add(self, class_name: str, parts: Mapping[str, Mesh], *, base_m: float = 0.0) -> int:
        """Add a stationary object.

        Args:
            class_name: Class of the object.
            parts: Meshes by name of the material.
            base_m: Height by which it is raised [m].

        Returns:
            Its instance id.
        """
        instance = self._instance(class_name)
        for material, mesh in parts.items():
            lift = np.array([0.0, 0.0, base_m], dtype=np.float32)
            lifted = replace(mesh, vertices=mesh.vertices + lift) if base_m else mesh
            self._made.setdefault(material, []).append((lifted, instance))
        return instance

    def place(
        self, name: str, place: NDArray[np.float64], *, base_m: float, yaw_rad: float, scale: float = 1.0
    ) -> int:
        """Place a prototype.

        Args:
            name: Name of the prototype.
            place: Position (2,) [m].
            base_m: Height of the ground [m].
            yaw_rad: Heading [rad].
            scale: Scale factor.

        Returns:
            Instance id of the object.
        """
        instance = self._instance(self[name].class_name)
        x, y = (float(value) for value in place)
        self._placed.append((self._row[name], instance, x, y, base_m, float(yaw_rad), scale))
        return instance

    def _instance(self, class_name: str) -> int:
        self._classes.append(CLASSES.index(class_name))
        return len(self._classes) - 1

    def static(self) -> dict[str, StaticMesh]:
        """Merge the stationary objects.

        Returns:
            One mesh per material.
        """
        return {material: _merged(parts) for material, parts in sorted(self._made.items())}

    def placements(self) -> Placements:
        """Return the poses of the placed prototypes.

        Returns:
            The placements.
        """
        rows = np.array(self._placed, dtype=np.float64).reshape(-1, 7)
        return Placements(
            prototype=rows[:, 0].astype(np.uint32),
            instance=rows[:, 1].astype(np.uint32),
            position=rows[:, 2:5].copy(),
            yaw=rows[:, 5].copy(),
            scale=rows[:, 6].copy(),
        )

    def instance_class(self) -> NDArray[np.uint8]:
        """Return the class of each instance.

        Returns:
            Class ids (I,) uint8.
        """
        return np.array(self._classes, dtype=np.uint8)


def _merged(parts: list[tuple[Mesh, int]]) -> StaticMesh:
    """Concatenate meshes with their instance ids."""
    offsets = np.cumsum([0] + [len(mesh.vertices) for mesh, _ in parts[:-1]])
    faces = [mesh.faces.astype(np.int64) + first for (mesh, _), first in zip(parts, offsets, strict=True)]
    return StaticMesh(
        vertices=np.concatenate([mesh.vertices for mesh, _ in parts]).astype(np.float32),
        faces=np.concatenate(faces).astype(np.uint32),
        instance=np.repeat(
            np.array([instance for _, instance in parts], dtype=np.uint32),
            [len(mesh.faces) for mesh, _ in parts],
        ),
        normals=joined_normals([mesh for mesh, _ in parts]),
    )


class OccupiedArea:
    """Occupied ground: shapes in a grid of cells."""

    def __init__(self) -> None:
        """Start with all ground free."""
        self._cells: dict[tuple[int, int], list[BaseGeometry]] = {}

    def add(self, shape: BaseGeometry) -> None:
        """Mark ground as occupied.

        Args:
            shape: The shape.
        """
        for cell in _cells(shape):
            self._cells.setdefault(cell, []).append(shape)

    def near(self, shape: BaseGeometry) -> list[BaseGeometry]:
        """Return the occupied shapes in the cells that a shape touches.

        Args:
            shape: The shape.

        Returns:
            Shapes near it.
        """
        found = {id(other): other for cell in _cells(shape) for other in self._cells.get(cell, ())}
        return list(found.values())

    def is_free(self, shape: BaseGeometry) -> bool:
        """Check whether ground is free.

        Args:
            shape: The shape.

        Returns:
            Whether nothing intersects it.
        """
        others = self.near(shape)
        return not others or not bool(np.any(shapely.intersects(shape, others)))

    def claim(self, shape: BaseGeometry) -> bool:
        """Occupy ground if it is free.

        Args:
            shape: The shape.

        Returns:
            Whether it was free.
        """
        free = self.is_free(shape)
        if free:
            self.add(shape)
        return free


def _cells(shape: BaseGeometry) -> list[tuple[int, int]]:
    """Return the grid cells that the bounding box of a shape covers."""
    x0, y0, x1, y1 = (int(np.floor(value / _CELL_M)) for value in shape.bounds)
    return [(x, y) for x in range(x0, x1 + 1) for y in range(y0, y1 + 1)]


def rectangle(centre: NDArray[np.float64], yaw_rad: float, length_m: float, width_m: float) -> Polygon:
    """Return a rectangle.

    Args:
        centre: Centre (2,) [m].
        yaw_rad: Heading of its length [rad].
        length_m: Length [m].
        width_m: Width [m].

    Returns:
        The polygon.
    """
    along = np.array([np.cos(yaw_rad), np.sin(yaw_rad)]) * length_m / 2
    aside = np.array([-np.sin(yaw_rad), np.cos(yaw_rad)]) * width_m / 2
    return Polygon(
        [centre - along - aside, centre + along - aside, centre + along + aside, centre - along + aside]
    )
