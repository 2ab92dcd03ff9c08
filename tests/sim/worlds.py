"""Small worlds with known geometry, and radars that stand or drive straight through them."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from echoscape.scenes.core.lane_graph import RoadGraph
from echoscape.scenes.core.scene import (
    CLASSES,
    Mesh,
    Mover,
    Placements,
    Prototype,
    Scene,
    StaticMesh,
    joined_normals,
)
from echoscape.scenes.core.trajectory import Trajectory


@dataclass(frozen=True)
class Ride:
    trajectory: Trajectory


def standing(x: float = 0.0, y: float = 0.0, yaw: float = 0.0) -> Ride:
    return straight([x, y], [0.0, 0.0], yaw=yaw)


def straight(start: list[float], velocity: list[float], *, yaw: float | None = None, z: float = 0.0) -> Ride:
    """A ride of 100 s from `start` at constant velocity, heading along it unless `yaw` says otherwise."""
    heading = float(np.arctan2(velocity[1], velocity[0])) if yaw is None else yaw
    rate = np.array([*velocity, 0.0, 0.0])
    first = np.array([*start, z, heading])
    return Ride(
        Trajectory(
            time_s=np.array([0.0, 100.0]),
            state=np.array([first, first + 100 * rate]),
            rate=np.array([rate, rate]),
        )
    )


def quad(corners: list[list[float]]) -> Mesh:
    """Two triangles through four corners, in order."""
    return Mesh(vertices=np.array(corners, np.float32), faces=np.array([[0, 1, 2], [0, 2, 3]], np.uint32))


def plate(centre: list[float], facing: list[float], width: float, height: float) -> Mesh:
    """An upright rectangle about `centre` whose normal is the horizontal direction `facing`."""
    normal = np.array([*facing, 0.0]) / np.hypot(facing[0], facing[1])
    along, up = np.cross([0, 0, 1.0], normal) * width / 2, np.array([0, 0, height / 2])
    middle = np.array(centre)
    return quad([list(middle + a * along + b * up) for a, b in ((-1, -1), (1, -1), (1, 1), (-1, 1))])


def box_prototype(
    name: str, size: tuple[float, float, float], material: str, class_name: str = "car"
) -> Prototype:
    """A box standing on the ground."""
    x, y, z = size[0] / 2, size[1] / 2, size[2]
    vertices = np.array([[a * x, b * y, c * z] for a in (-1, 1) for b in (-1, 1) for c in (0, 1)], np.float32)
    faces = [
        [0, 1, 3],
        [0, 3, 2],
        [4, 7, 5],
        [4, 6, 7],
        [0, 4, 5],
        [0, 5, 1],
        [2, 3, 7],
        [2, 7, 6],
        [0, 2, 6],
        [0, 6, 4],
        [1, 5, 7],
        [1, 7, 3],
    ]
    mesh = Mesh(vertices=vertices, faces=np.array(faces, np.uint32))
    return Prototype(name=name, class_name=class_name, parts={material: mesh}, extent_m=size)


def world(*things: tuple[str, str, Mesh]) -> Scene:
    """A town of (material, class name, mesh) things, instance ids from 1 in their order."""
    static: dict[str, list[tuple[Mesh, int]]] = {}
    for instance, (material, _, mesh) in enumerate(things, start=1):
        static.setdefault(material, []).append((mesh, instance))
    meshes = {material: _merged(parts) for material, parts in static.items()}
    none = np.zeros(0)
    return Scene(
        preset="test",
        seed=0,
        static=meshes,
        prototypes=(),
        placements=Placements(
            prototype=none.astype(np.uint32),
            instance=none.astype(np.uint32),
            position=np.zeros((0, 3)),
            yaw=none,
            scale=none,
        ),
        instance_class=np.array([0, *(CLASSES.index(name) for _, name, _ in things)], np.uint8),
        roads=RoadGraph(lanes=(), junctions=np.zeros((0, 2))),
        bounds_m=(-200.0, -200.0, 200.0, 200.0),
    )


def mover(instance: int, prototype: Prototype, ride: Ride) -> Mover:
    return Mover(instance=instance, prototype=prototype, track=ride.trajectory)


def _merged(parts: list[tuple[Mesh, int]]) -> StaticMesh:
    offsets = np.cumsum([0] + [len(mesh.vertices) for mesh, _ in parts])
    return StaticMesh(
        vertices=np.concatenate([mesh.vertices for mesh, _ in parts]),
        faces=np.concatenate(
            [mesh.faces + np.uint32(k) for (mesh, _), k in zip(parts, offsets, strict=False)]
        ),
        instance=np.concatenate([np.full(len(mesh.faces), instance, np.uint32) for mesh, instance in parts]),
        normals=joined_normals([mesh for mesh, _ in parts]),
    )


def decibel(ratio: NDArray | np.floating | float) -> NDArray:
    return 10 * np.log10(np.asarray(ratio))
