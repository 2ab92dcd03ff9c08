"""A scene in the ray tracer: merged static meshes, instances of prototypes, shapes of moving objects.

The static part is built once. Moving objects are not in it: each distinct shape stands once in a second,
small Mitsuba scene, and a ray is transformed into the frame of a moving object at the time of its azimuth.
So objects move continuously within a scan, and no acceleration structure is ever rebuilt.
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from echoscape.scenes.core.materials import MATERIAL_NAMES
from echoscape.scenes.core.scene import CLASSES, Mesh, Mover, Prototype, Scene
from echoscape.sim.raytracing.mitsuba_backend import dr, mi
from echoscape.sim.raytracing.surface.slender_facets import MATERIAL as SLENDER_MATERIAL
from echoscape.sim.raytracing.surface.slender_facets import facet_widths, is_slender

SHAPE_SPACING_M = 50.0
"""Distance between the shapes of moving objects in their Mitsuba scene; no object is as long."""


@dataclass(frozen=True, kw_only=True)
class _Faces:
    """F faces: corner and unit normal (F, 3) float32, material and instance (F,) uint32, and curvature.

    The normal of a curved face is proportional to n + M (p - corner) at a point p (Phong, Comm. ACM 18(6),
    1975: linear between the normals at its corners). `bend` holds the rows of (n, M) of the C curved faces
    (C, 12) float32; `curved` has the row of each face in it counted from 1, 0 for flat faces (F,) uint32.
    `width_m` is the width of slender metal facets, at which rays are aimed, 0 for others (F,) float32.
    """

    corner: NDArray[np.float32]
    normal: NDArray[np.float32]
    material: NDArray[np.uint32]
    instance: NDArray[np.uint32]
    curved: NDArray[np.uint32]
    bend: NDArray[np.float32]
    width_m: NDArray[np.float32]


def _faces(mesh: Mesh, material: int, instance: NDArray[np.uint32] | None = None) -> _Faces:
    """Tabulate the planes of the faces of a mesh; `instance` is 0 where the placement gives it."""
    corners = mesh.vertices[mesh.faces].astype(np.float64)
    normal = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    length = np.linalg.norm(normal, axis=1, keepdims=True)
    normal = np.divide(normal, length, out=np.tile([0.0, 0.0, 1.0], (len(normal), 1)), where=length > 0)
    curved, bend = _curvature(corners, normal, mesh.normals)
    return _Faces(
        corner=corners[:, 0].astype(np.float32),
        normal=normal.astype(np.float32),
        material=np.full(len(mesh.faces), material, np.uint32),
        instance=np.zeros(len(mesh.faces), np.uint32) if instance is None else instance.astype(np.uint32),
        curved=curved,
        bend=bend,
        width_m=_widths(mesh, corners, material),
    )


def _widths(mesh: Mesh, corners: NDArray[np.float64], material: int) -> NDArray[np.float32]:
    """Return the widths of faces that rays are aimed at, 0 for the others (F,) [m]."""
    if MATERIAL_NAMES[material] != SLENDER_MATERIAL:
        return np.zeros(len(corners), np.float32)
    return np.where(is_slender(mesh, corners), facet_widths(corners), 0).astype(np.float32)


def _curvature(
    corners: NDArray[np.float64], normal: NDArray[np.float64], smooth: NDArray[np.float32] | None
) -> tuple[NDArray[np.uint32], NDArray[np.float32]]:
    """Return row (F,) and coefficients (C, 12) of the curved faces among faces with corners (F, 3, 3)."""
    curved = np.zeros(len(corners), np.uint32)
    if smooth is None:
        return curved, np.zeros((0, 12), np.float32)
    rows = np.flatnonzero(np.any(smooth != 0, axis=(1, 2)))
    curved[rows] = 1 + np.arange(len(rows))
    first, second = (corners[rows, k] - corners[rows, 0] for k in (1, 2))
    doubled = np.sum(np.cross(first, second) * normal[rows], axis=1)[:, None]
    # Gradients of the barycentric coordinates of the second and third corner in the plane of the face.
    along = np.cross(second, normal[rows]) / doubled, np.cross(normal[rows], first) / doubled
    ends = smooth[rows].astype(np.float64)
    slope = np.zeros((len(rows), 3, 3))
    for k in (0, 1):
        slope += (ends[:, k + 1] - ends[:, 0])[:, :, None] * along[k][:, None, :]
    return curved, np.concatenate([ends[:, 0, :, None], slope], axis=2).astype(np.float32).reshape(-1, 12)


def _shape(name: str, vertices: NDArray, faces: NDArray) -> "mi.Mesh":
    """Make a Mitsuba mesh from (V, 3) vertices and (F, 3) faces."""
    mesh = mi.Mesh(name, len(vertices), len(faces))
    parameters = mi.traverse(mesh)
    parameters["vertex_positions"] = np.ascontiguousarray(vertices, np.float32).ravel()
    parameters["faces"] = np.ascontiguousarray(faces, np.uint32).ravel()
    parameters.update()
    return mesh


def _merged(prototype: Prototype) -> tuple[NDArray, NDArray, _Faces]:
    """Return vertices, faces and face table of a prototype, its parts merged into one mesh."""
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
        curved=_concatenated_rows(tables),
        bend=np.concatenate([table.bend for table in tables]),
        width_m=np.concatenate([table.width_m for table in tables]),
    )


def _concatenated_rows(tables: Sequence[_Faces]) -> NDArray[np.uint32]:
    """Return the rows of the curved faces in the tables' joined coefficients."""
    starts = np.cumsum([0] + [len(table.bend) for table in tables])
    moved = [
        np.where(table.curved > 0, table.curved + start, 0)
        for table, start in zip(tables, starts, strict=False)
    ]
    return np.concatenate(moved).astype(np.uint32)


def _registry_id(shape: "mi.Shape") -> int:
    return int(dr.reinterpret_array(mi.UInt32, mi.ShapePtr(shape))[0])


def _by_registry_id(ids: list[int], values: Sequence[int]) -> "mi.UInt32":
    """Return a table from Dr.Jit's shape number to a value (0 for shapes of other scenes)."""
    table = np.zeros(max(ids, default=0) + 1, np.uint32)
    table[ids] = values
    return mi.UInt32(table)


class MitsubaScene:
    """A scene and the shapes of its moving objects in the ray tracer.

    Attributes:
        at_rest: The scene that was loaded.
        static: Mitsuba scene of all that is at rest.
        mover_shapes: Mitsuba scene of the shapes of the moving objects.
        mover_shape_offset: Where each shape stands in it, by name of the prototype (3,) [m].
        face_corner: A corner of each face of both scenes (3 F,) [m].
        face_normal: Unit normal of each face (3 F,).
        face_material: Material id of each face (F,).
        face_instance: Instance id of each face (F,), 0 where a placement gives it.
        face_curved: Row of each face in `bend` counted from 1 (F,), 0 for flat faces.
        face_width: Width of the faces that rays are aimed at, 0 for all others (F,) [m].
        bend: Normal of each curved face as a linear function of place, see `_Faces` (12 (C + 1),).
        shape_face: First face of each static mesh, by its Dr.Jit id.
        mover_shape_face: First face of the shapes of moving objects.
        placement: Number of each placement from 1, by its Dr.Jit id; 0 is none.
        placement_face: First face of each placement's prototype; index 0 is the world.
        placement_position: Position of each placement (3 P,) [m]; its cosine, sine, scale and instance
            follow as `placement_cos`, `placement_sin`, `placement_scale` and `placement_instance`.
    """

    def __init__(self, scene: Scene, movers: Sequence[Mover]) -> None:
        """Build both Mitsuba scenes and the tables.

        Args:
            scene: Static meshes, prototypes and their placements.
            movers: All moving objects.
        """
        tables: list[_Faces] = []
        self.at_rest = scene
        self._face_count = 0
        self.static = self._load_static(scene, tables)
        shapes = {mover.prototype.name: mover.prototype for mover in movers}
        self.mover_shapes = self._load_mover_shapes(list(shapes.values()), tables)
        table = _concatenate(tables)
        self.face_corner = mi.Float(table.corner.ravel())
        self.face_normal = mi.Float(table.normal.ravel())
        self.face_material = mi.UInt32(table.material)
        self.face_instance = mi.UInt32(table.instance)
        self.face_curved = mi.UInt32(table.curved)
        self.face_width = mi.Float(table.width_m)
        self.bend = mi.Float(np.vstack([np.zeros((1, 12), np.float32), table.bend]).ravel())

    def _add(self, tables: list[_Faces], table: _Faces) -> int:
        """Append a face table and return where it begins."""
        start = self._face_count
        tables.append(table)
        self._face_count += len(table.material)
        return start

    def _load_static(self, scene: Scene, tables: list[_Faces]) -> "mi.Scene":
        """Load static meshes and placements, and tabulate where their faces begin."""
        parts: dict[str, object] = {"type": "scene"}
        static, starts = [], []
        for material, mesh in scene.static.items():
            if len(mesh.faces):
                starts.append(self._add(tables, _faces(mesh, MATERIAL_NAMES.index(material), mesh.instance)))
                static.append(_shape(material, mesh.vertices, mesh.faces))
                parts[f"static_{material}"] = static[-1]
        first_face, groups = self._load_groups(scene, tables)
        parts |= {f"group_{index}": group for index, group in groups.items()}
        places = scene.placements
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
        parts |= {f"placed_{index}": instance for index, instance in enumerate(instances)}
        loaded = mi.load_dict(parts)
        self.shape_face = _by_registry_id([_registry_id(shape) for shape in static], starts)
        # 0 stands for no placement, so placements count from 1.
        self.placement = _by_registry_id(
            [_registry_id(shape) for shape in instances], range(1, len(instances) + 1)
        )
        self._tabulate_placements(scene, first_face)
        return loaded

    def _load_groups(self, scene: Scene, tables: list[_Faces]) -> tuple[dict[int, int], dict[int, object]]:
        """Return first face and shape group of each prototype that is placed."""
        starts: dict[int, int] = {}
        groups: dict[int, object] = {}
        for index in np.unique(scene.placements.prototype).tolist():
            vertices, faces, table = _merged(scene.prototypes[index])
            starts[index] = self._add(tables, table)
            groups[index] = mi.load_dict(
                {"type": "shapegroup", "mesh": _shape(f"prototype_{index}", vertices, faces)}
            )
        return starts, groups

    def _tabulate_placements(self, scene: Scene, first_face: dict[int, int]) -> None:
        """Tabulate frames and first faces of the placements; index 0 is the world."""
        places = scene.placements
        self.placement_position = mi.Float64(np.vstack([np.zeros((1, 3)), places.position]).ravel())
        self.placement_cos = mi.Float64(np.append(1.0, np.cos(places.yaw)))
        self.placement_sin = mi.Float64(np.append(0.0, np.sin(places.yaw)))
        self.placement_scale = mi.Float64(np.append(1.0, places.scale))
        self.placement_instance = mi.UInt32(np.append(0, places.instance).astype(np.uint32))
        starts = [first_face[int(prototype)] for prototype in places.prototype]
        self.placement_face = mi.UInt32(np.append(0, starts).astype(np.uint32))

    def _load_mover_shapes(self, shapes: list[Prototype], tables: list[_Faces]) -> "mi.Scene":
        """Place the shapes on a square lattice, so far apart that a ray meets only the one meant."""
        side = max(1, int(np.ceil(np.sqrt(len(shapes)))))
        self.mover_shape_offset: dict[str, NDArray[np.float64]] = {}
        vertices, faces, count = [np.zeros((3, 3), np.float32)], [np.array([[0, 1, 2]], np.uint32)], 3
        vertices[0][:, 2] = -1e4 + np.arange(3)  # no ray meets it: the scene is never empty
        start = self._add(tables, _faces(Mesh(vertices=vertices[0], faces=faces[0]), 0))
        for index, shape in enumerate(shapes):
            offset = SHAPE_SPACING_M * np.array([index % side, index // side, 0.0])
            self.mover_shape_offset[shape.name] = offset
            local, shape_faces, table = _merged(shape)
            vertices.append((local + offset).astype(np.float32))
            faces.append(shape_faces + np.uint32(count))
            self._add(tables, table)
            count += len(local)
        self.mover_shape_face = start
        mesh = _shape("mover_shapes", np.concatenate(vertices), np.concatenate(faces))
        return mi.load_dict({"type": "scene", "mesh": mesh})


def instance_classes(scene: Scene, movers: Sequence[Mover]) -> NDArray[np.uint8]:
    """Return the class of every instance.

    Args:
        scene: The static scene.
        movers: All moving objects.

    Returns:
        Class id of each instance id (I,) uint8.
    """
    last = max([len(scene.instance_class) - 1, *(mover.instance for mover in movers)])
    classes = np.zeros(last + 1, np.uint8)
    classes[: len(scene.instance_class)] = scene.instance_class
    for mover in movers:
        classes[mover.instance] = CLASSES.index(mover.prototype.class_name)
    return classes
