"""What a scene is made of: meshes by material, objects with ids and classes, things placed many times.

Everything here is plain arrays in metres and radians, world frame right-handed with z up; an object's own
frame has x forward, y left, z up and its origin on the ground below its centre.
"""

from collections.abc import Collection, Sequence
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Protocol

import numpy as np
from numpy.typing import NDArray

from echoscape.scenes.core.lane_graph import RoadGraph
from echoscape.scenes.core.trajectory import Trajectory

if TYPE_CHECKING:
    from echoscape.scenes.core.targets import PlacedTarget

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
"""Class names in the order of their numeric ids; 0 is "nothing was hit"."""


@dataclass(frozen=True, kw_only=True)
class Mesh:
    """A triangle mesh: `vertices` (V, 3) float32 [m], `faces` (F, 3) uint32, counter-clockwise outside."""

    vertices: NDArray[np.float32]
    faces: NDArray[np.uint32]


@dataclass(frozen=True, kw_only=True)
class StaticMesh(Mesh):
    """All that stands still and is of one material: `instance` (F,) uint32, the object of each face."""

    instance: NDArray[np.uint32]


@dataclass(frozen=True, kw_only=True)
class Prototype:
    """A shape that is placed many times: `parts` maps a material's name to a mesh in the object's frame.

    `extent_m` is (length, width, height) of its box, centred on the origin in x and y, standing on z = 0.
    """

    name: str
    class_name: str
    parts: dict[str, Mesh]
    extent_m: tuple[float, float, float]


@dataclass(frozen=True, kw_only=True)
class Placements:
    """Where prototypes stand: N rows of equal length.

    prototype (N,) uint32, instance (N,) uint32, position (N, 3) float64 [m], yaw (N,) float64 [rad] counter-
    clockwise from world x, scale (N,) float64.
    """

    prototype: NDArray[np.uint32]
    instance: NDArray[np.uint32]
    position: NDArray[np.float64]
    yaw: NDArray[np.float64]
    scale: NDArray[np.float64]


@dataclass(frozen=True, kw_only=True)
class Scene:
    """A whole static world with its road graph.

    `static` maps material name to mesh; `prototypes` and `placements` add what is instanced; `instance_class`
    (I,) uint8 gives the class id of every static instance id (row 0 is "none"). `bounds_m` is (x0, y0, x1,
    y1); `targets` are the test targets among the static things.
    """

    preset: str
    seed: int
    static: dict[str, StaticMesh]
    prototypes: tuple[Prototype, ...]
    placements: Placements
    instance_class: NDArray[np.uint8]
    roads: RoadGraph
    bounds_m: tuple[float, float, float, float]
    targets: "tuple[PlacedTarget, ...]" = ()


@dataclass(frozen=True, kw_only=True)
class Mover:
    """A rigid thing that moves: a prototype on a trajectory (its own frame: x forward, y left, z up)."""

    instance: int
    prototype: Prototype
    track: Trajectory


class HasPose(Protocol):
    """Anything with a pose at any time: a drive, a mover's track."""

    def pose(self, time_s: NDArray[np.float64]) -> NDArray[np.float64]:
        """Return (..., 4) x, y, z [m] and yaw [rad] at `time_s` (...)."""
        ...


def without(
    town: Scene, movers: Sequence[Mover], instances: Collection[int]
) -> tuple[Scene, tuple[Mover, ...]]:
    """Return the town and the movers without `instances`, shadows and all.

    Raises:
        ValueError: an instance is neither in the town nor among the movers.
    """
    known = set(range(1, len(town.instance_class))) | {mover.instance for mover in movers}
    strange = sorted(set(instances) - known)
    if strange:
        raise ValueError(f"instances must be of the town or its movers, got {strange[0]}")
    gone = np.array(sorted(instances), np.uint32)
    left = replace(
        town,
        static={material: _less(mesh, gone) for material, mesh in town.static.items()},
        placements=_fewer(town.placements, gone),
        targets=tuple(each for each in town.targets if each.instance not in instances),
    )
    return left, tuple(mover for mover in movers if mover.instance not in instances)


def _less(mesh: StaticMesh, gone: np.ndarray) -> StaticMesh:
    keep = ~np.isin(mesh.instance, gone)
    return mesh if keep.all() else replace(mesh, faces=mesh.faces[keep], instance=mesh.instance[keep])


def _fewer(places: Placements, gone: np.ndarray) -> Placements:
    keep = ~np.isin(places.instance, gone)
    return Placements(**{name: values[keep] for name, values in vars(places).items()})
