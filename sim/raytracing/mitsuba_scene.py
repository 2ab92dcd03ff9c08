"""A town in the ray tracer: few merged meshes, placed prototypes as instances, and a garage of movers.

The town is built once. Movers are not in it: each distinct shape stands once in the garage, a small scene of
its own, and a ray meets a mover by being moved into that shape's frame at the ray's own time. So movers move
exactly within a scan and nothing is ever rebuilt.
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from echoscape.scenes.core.materials import MATERIAL_NAMES
from echoscape.scenes.core.scene import CLASSES, Mesh, Mover, Prototype, Scene
from echoscape.sim.raytracing.mitsuba_backend import dr, mi

GARAGE_SPACING_M = 50.0
"""Distance between shapes in the garage; no mover is as long."""


@dataclass(frozen=True, kw_only=True)
class _Faces:
    """Faces of a Mitsuba mesh: corner (F, 3), unit normal (F, 3) float32, material, instance (F,) uint32."""

    corner: NDArray[np.float32]
    normal: NDArray[np.float32]
    material: NDArray[np.uint32]
    instance: NDArray[np.uint32]


def _faces(mesh: Mesh, material: int, instance: NDArray[np.uint32] | None = None) -> _Faces:
    """Tabulate the planes of a mesh's faces; `instance` defaults to 0 (the placement knows it)."""
    corners = mesh.vertices[mesh.faces].astype(np.float64)
    normal = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    length = np.linalg.norm(normal, axis=1, keepdims=True)
    normal = np.divide(normal, length, out=np.tile([0.0, 0.0, 1.0], (len(normal), 1)), where=length > 0)
    return _Faces(
        corner=corners[:, 0].astype(np.float32),
        normal=normal.astype(np.float32),
        material=np.full(len(mesh.faces), material, np.uint32),
        instance=np.zeros(len(mesh.faces), np.uint32) if instance is None else instance.astype(np.uint32),
    )


def _shape(name: str, vertices: NDArray, faces: NDArray) -> "mi.Mesh":
    """Make a Mitsuba mesh from (V, 3) vertices and (F, 3) faces."""
    mesh = mi.Mesh(name, len(vertices), len(faces))
    parameters = mi.traverse(mesh)
    parameters["vertex_positions"] = np.ascontiguousarray(vertices, np.float32).ravel()
    parameters["faces"] = np.ascontiguousarray(faces, np.uint32).ravel()
    parameters.update()
    return mesh


def _merged(prototype: Prototype) -> tuple[NDArray, NDArray, _Faces]:
    """Return vertices, faces and face table of all parts of a prototype as one mesh."""
    vertices, faces, tables, count = [], [], [], 0
    for material, mesh in prototype.parts.items():
        vertices.append(mesh.vertices)
        faces.append(mesh.faces + np.uint32(count))
        tables.append(_faces(mesh, MATERIAL_NAMES.index(material)))
        count += len(mesh.vertices)
    return np.concatenate(vertices), np.concatenate(faces), _concatenate(tables)


def _concatenate(tables: Sequence[_Faces]) -> _Faces:
    return _Faces(
        corner=np.concatenate([table.corner for table in tables]),
        normal=np.concatenate([table.normal for table in tables]),
        material=np.concatenate([table.material for table in tables]),
        instance=np.concatenate([table.instance for table in tables]),
    )


def _registry_id(shape: "mi.Shape") -> int:
    return int(dr.reinterpret_array(mi.UInt32, mi.ShapePtr(shape))[0])


def _by_registry_id(ids: list[int], values: Sequence[int]) -> "mi.UInt32":
    """Return a table from Dr.Jit's shape number to a value (0 for shapes of other scenes)."""
    table = np.zeros(max(ids, default=0) + 1, np.uint32)
    table[ids] = values
    return mi.UInt32(table)


class MitsubaScene:
    """The ray tracer's copy of a town and of the shapes that move through it.

    `town` is the Mitsuba scene of all that stands still; `garage` holds the movers' shapes. Tables by face
    (corner, normal, material, instance) cover both; `shape_face` and `prototype_face` say where a mesh's
    faces begin in them.
    """

    def __init__(self, town: Scene, movers: Sequence[Mover]) -> None:
        tables: list[_Faces] = []
        self._face_count = 0
        self.town = self._load_town(town, tables)
        self.shapes = {mover.prototype.name: mover.prototype for mover in movers}
        self.garage = self._load_garage(list(self.shapes.values()), tables)
        table = _concatenate(tables)
        self.face_corner = mi.Float(table.corner.ravel())
        self.face_normal = mi.Float(table.normal.ravel())
        self.face_material = mi.UInt32(table.material)
        self.face_instance = mi.UInt32(table.instance)
        self.triangles = len(table.material)

    def _add(self, tables: list[_Faces], table: _Faces) -> int:
        """Append a face table and return where it begins."""
        start = self._face_count
        tables.append(table)
        self._face_count += len(table.material)
        return start

    def _load_town(self, town: Scene, tables: list[_Faces]) -> "mi.Scene":
        scene: dict[str, object] = {"type": "scene"}
        static, starts = [], []
        for material, mesh in town.static.items():
            if len(mesh.faces):
                starts.append(self._add(tables, _faces(mesh, MATERIAL_NAMES.index(material), mesh.instance)))
                static.append(_shape(material, mesh.vertices, mesh.faces))
                scene[f"static_{material}"] = static[-1]
        proto_start, groups = self._load_groups(town, tables)
        scene |= {f"group_{index}": group for index, group in groups.items()}
        places = town.placements
        instances = []
        for prototype, position, yaw, scale in zip(
            places.prototype, places.position, places.yaw, places.scale, strict=True
        ):
            to_world = (
                mi.ScalarTransform4f().translate(position.tolist()).rotate([0, 0, 1], float(np.degrees(yaw)))
            )
            instances.append(
                mi.load_dict(
                    {
                        "type": "instance",
                        "group": groups[int(prototype)],
                        "to_world": to_world.scale([float(scale)] * 3),
                    }
                )
            )
        scene |= {f"placed_{index}": instance for index, instance in enumerate(instances)}
        loaded = mi.load_dict(scene)
        self.shape_face = _by_registry_id([_registry_id(shape) for shape in static], starts)
        # Number 0 is "no instance", so placements count from 1.
        self.placement = _by_registry_id(
            [_registry_id(shape) for shape in instances], range(1, len(instances) + 1)
        )
        self._tabulate_placements(town, proto_start)
        return loaded

    def _load_groups(self, town: Scene, tables: list[_Faces]) -> tuple[dict[int, int], dict[int, object]]:
        """Return, for every prototype that is placed, where its faces begin and its shape group."""
        starts: dict[int, int] = {}
        groups: dict[int, object] = {}
        for index in np.unique(town.placements.prototype).tolist():
            vertices, faces, table = _merged(town.prototypes[index])
            starts[index] = self._add(tables, table)
            groups[index] = mi.load_dict(
                {"type": "shapegroup", "mesh": _shape(f"prototype_{index}", vertices, faces)}
            )
        return starts, groups

    def _tabulate_placements(self, town: Scene, proto_start: dict[int, int]) -> None:
        """Tabulate the placements' frames and faces, row 0 standing for the world itself."""
        places = town.placements
        self.placement_position = mi.Float64(np.vstack([np.zeros((1, 3)), places.position]).ravel())
        self.placement_cos = mi.Float64(np.append(1.0, np.cos(places.yaw)))
        self.placement_sin = mi.Float64(np.append(0.0, np.sin(places.yaw)))
        self.placement_scale = mi.Float64(np.append(1.0, places.scale))
        self.placement_instance = mi.UInt32(np.append(0, places.instance).astype(np.uint32))
        starts = [proto_start[int(prototype)] for prototype in places.prototype]
        self.placement_face = mi.UInt32(np.append(0, starts).astype(np.uint32))

    def _load_garage(self, shapes: list[Prototype], tables: list[_Faces]) -> "mi.Scene":
        """Stand the movers' shapes on a square lattice far enough apart that a ray meets only its own."""
        side = max(1, int(np.ceil(np.sqrt(len(shapes)))))
        self.garage_place: dict[str, NDArray[np.float64]] = {}
        vertices, faces, count = [np.zeros((3, 3), np.float32)], [np.array([[0, 1, 2]], np.uint32)], 3
        vertices[0][:, 2] = -1e4 + np.arange(3)  # a face that no ray meets, so that the scene is never empty
        start = self._add(tables, _faces(Mesh(vertices=vertices[0], faces=faces[0]), 0))
        for index, shape in enumerate(shapes):
            place = GARAGE_SPACING_M * np.array([index % side, index // side, 0.0])
            self.garage_place[shape.name] = place
            local, shape_faces, table = _merged(shape)
            vertices.append((local + place).astype(np.float32))
            faces.append(shape_faces + np.uint32(count))
            self._add(tables, table)
            count += len(local)
        self.garage_face = start
        mesh = _shape("garage", np.concatenate(vertices), np.concatenate(faces))
        return mi.load_dict({"type": "scene", "mesh": mesh})


def instance_classes(town: Scene, movers: Sequence[Mover]) -> NDArray[np.uint8]:
    """Return the class id (I,) uint8 of every instance id, standing or moving."""
    last = max([len(town.instance_class) - 1, *(mover.instance for mover in movers)])
    classes = np.zeros(last + 1, np.uint8)
    classes[: len(town.instance_class)] = town.instance_class
    for mover in movers:
        classes[mover.instance] = CLASSES.index(mover.prototype.class_name)
    return classes
