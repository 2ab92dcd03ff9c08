"""A scene: meshes by material, objects with instance ids and classes, and prototypes placed many times.

Plain arrays in metres and radians. The world frame is right-handed with z up; the frame of an object has x
forward, y left and z up, with its origin on the ground below the object's centre.
"""

from collections.abc import Collection, Sequence
from dataclasses import dataclass, replace
from typing import Protocol

import numpy as np
from numpy.typing import NDArray

from echoscape.scenes.core.lane_graph import RoadGraph
from echoscape.scenes.core.targets import PlacedTarget
from echoscape.scenes.core.trajectory import Trajectory

CLASSES: tuple[str, ...] = (
    "none",
    "ground",
    "road",
    "pavement",
    "kerb",
    "building",
    "wall",
    "fence",
    "hedge",
    "tree",
    "lamp_post",
    "sign",
    "bollard",
    "bus_shelter",
    "bin",
    "barrier",
    "car",
    "van",
    "truck",
    "bus",
    "cyclist",
    "pedestrian",
    "container",
    "tank",
    "target",
)
"""Class names in the order of their ids; class 0, "none", means that no object was hit."""


@dataclass(frozen=True, kw_only=True)
class Mesh:
    """A triangle mesh.

    Attributes:
        vertices: Positions (V, 3) float32 [m].
        faces: Vertex indices (F, 3) uint32, counter-clockwise seen from outside.
        normals: Unit normals of the curved surface that the faces stand for, at the corners of each face
            (F, 3, 3) float32, zero for faces that are flat; None where all are flat.
    """

    vertices: NDArray[np.float32]
    faces: NDArray[np.uint32]
    normals: NDArray[np.float32] | None = None


@dataclass(frozen=True, kw_only=True)
class StaticMesh(Mesh):
    """All stationary faces of one material.

    Attributes:
        instance: Instance id of the object of each face (F,) uint32.
    """

    instance: NDArray[np.uint32]


@dataclass(frozen=True, kw_only=True)
class Prototype:
    """A shape that is placed many times.

    Attributes:
        name: Name of the prototype.
        class_name: Class of its objects, see `CLASSES`.
        parts: Mesh of each material in the frame of the object, by name of the material.
        extent_m: Length, width and height of the bounding box [m], which is centred on the origin in x and y
            and stands on z = 0.
    """

    name: str
    class_name: str
    parts: dict[str, Mesh]
    extent_m: tuple[float, float, float]


@dataclass(frozen=True, kw_only=True)
class Placements:
    """Poses of the N placed prototypes.

    Attributes:
        prototype: Index into the prototypes of the scene (N,) uint32.
        instance: Instance id (N,) uint32.
        position: World position of the origin (N, 3) float64 [m].
        yaw: Heading counter-clockwise from world x (N,) float64 [rad].
        scale: Scale factor (N,) float64.
    """

    prototype: NDArray[np.uint32]
    instance: NDArray[np.uint32]
    position: NDArray[np.float64]
    yaw: NDArray[np.float64]
    scale: NDArray[np.float64]


@dataclass(frozen=True, kw_only=True)
class Scene:
    """A static world with its road graph.

    Attributes:
        preset: Name of the preset.
        seed: Seed from which the scene was generated.
        static: Stationary meshes by name of the material.
        prototypes: Shapes that are placed.
        placements: Where they are placed.
        instance_class: Class id of each instance id (I,) uint8; entry 0 is "none".
        roads: Lanes, footpaths and kerbs.
        bounds_m: Extent x0, y0, x1, y1 of the scene in the world [m].
        targets: Test targets of the scene.
        origin_deg: Latitude and longitude of the world's origin, WGS84, where it has one [deg]; see
            `scenes.io.osm.elements.projection.LocalProjection` for those of other places.
    """

    preset: str
    seed: int
    static: dict[str, StaticMesh]
    prototypes: tuple[Prototype, ...]
    placements: Placements
    instance_class: NDArray[np.uint8]
    roads: RoadGraph
    bounds_m: tuple[float, float, float, float]
    targets: tuple[PlacedTarget, ...] = ()
    origin_deg: tuple[float, float] | None = None


@dataclass(frozen=True, kw_only=True)
class Mover:
    """A moving object: a rigid prototype that follows a trajectory.

    Attributes:
        instance: Instance id.
        prototype: Shape and class of the object.
        track: Pose of the object's frame over time.
    """

    instance: int
    prototype: Prototype
    track: Trajectory


class HasPose(Protocol):
    """Anything that has a pose at any time: the ego drive or the track of a mover."""

    def pose(self, time_s: NDArray[np.float64]) -> NDArray[np.float64]:
        """Interpolate the pose.

        Args:
            time_s: Times (...) [s].

        Returns:
            x, y, z [m] and yaw [rad] (..., 4).
        """
        ...


def remove_instances(
    scene: Scene, movers: Sequence[Mover], instances: Collection[int]
) -> tuple[Scene, tuple[Mover, ...]]:
    """Remove objects, and with them their shadows and reflections, from a scene and its movers.

    Args:
        scene: The scene.
        movers: Its movers.
        instances: Instance ids of the objects to remove.

    Returns:
        The remaining scene and the remaining movers.

    Raises:
        ValueError: An instance is neither in the scene nor among the movers.
    """
    known = set(range(1, len(scene.instance_class))) | {mover.instance for mover in movers}
    unknown = sorted(set(instances) - known)
    if unknown:
        raise ValueError(f"instances must be of the scene or its movers, got {unknown[0]}")
    removed = np.array(sorted(instances), np.uint32)
    rest = replace(
        scene,
        static={material: _remaining_faces(mesh, removed) for material, mesh in scene.static.items()},
        placements=_remaining_placements(scene.placements, removed),
        targets=tuple(each for each in scene.targets if each.instance not in instances),
    )
    return rest, tuple(mover for mover in movers if mover.instance not in instances)


def joined_normals(meshes: Sequence[Mesh]) -> NDArray[np.float32] | None:
    """Return the corner normals of meshes that are concatenated.

    Args:
        meshes: The meshes, in order.

    Returns:
        Normals (F, 3, 3) float32, zero for flat faces; None where all meshes are flat.
    """
    if all(mesh.normals is None for mesh in meshes):
        return None
    flat = (np.zeros((len(mesh.faces), 3, 3), np.float32) for mesh in meshes)
    return np.concatenate(
        [none if mesh.normals is None else mesh.normals for mesh, none in zip(meshes, flat, strict=True)]
    )


def _remaining_faces(mesh: StaticMesh, removed: NDArray[np.uint32]) -> StaticMesh:
    keep = ~np.isin(mesh.instance, removed)
    if keep.all():
        return mesh
    normals = None if mesh.normals is None else mesh.normals[keep]
    return replace(mesh, faces=mesh.faces[keep], instance=mesh.instance[keep], normals=normals)


def _remaining_placements(placements: Placements, removed: NDArray[np.uint32]) -> Placements:
    keep = ~np.isin(placements.instance, removed)
    return Placements(**{name: values[keep] for name, values in vars(placements).items()})
