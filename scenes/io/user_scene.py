"""Scenes of one's own: a TOML file that names a mesh, says what its objects are made of, and gives a drive.

Keys are those of docs/scenes.md. What the file says and the hash of the mesh decide the scene; where the
files lie does not.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from fnmatch import fnmatchcase
from pathlib import Path

import numpy as np

from echoscape.scenes.core.lane_graph import RoadGraph
from echoscape.scenes.core.materials import MATERIAL_NAMES
from echoscape.scenes.core.scene import CLASSES, Mesh, Scene, StaticMesh
from echoscape.scenes.io.mesh_import import UPS, MeshPart, default_up, mesh_sha256, read_parts
from echoscape.scenes.io.strict_toml import SceneError, Table, read_toml
from echoscape.scenes.io.target_toml import AnyTarget, targets_of
from echoscape.scenes.io.user_drive import DrivePlan, UserDrive, make_user_drive, read_drive_plan
from echoscape.scenes.town.placement import SceneBuilder

CLASS_NAMES = CLASSES[1:]
"""Classes that an object may have: all but "none"."""

_TOLD = 5
_MARGIN_M = 10.0


@dataclass(frozen=True, kw_only=True)
class ObjectRule:
    """What the objects whose name fits `pattern` (fnmatch, capitals count) are; `skip` leaves them out."""

    pattern: str
    material: str = ""
    class_name: str = ""
    skip: bool = False


@dataclass(frozen=True, kw_only=True)
class UserScene:
    """A scene of one's own, as its TOML file describes it.

    folder: where the mesh `file` lies; sha256: of the mesh as it was when the description was read; up: the
    axis that points up in it; scale: metres a unit; rules: the first that fits an object counts.
    """

    folder: Path
    file: str
    sha256: str
    up: str
    scale: float
    rules: tuple[ObjectRule, ...]
    drive: DrivePlan
    targets: tuple[AnyTarget, ...] = ()

    @property
    def mesh_path(self) -> Path:
        """The mesh file."""
        return self.folder / self.file


@dataclass(frozen=True, kw_only=True)
class BuiltUserScene:
    """A scene of one's own, built: `names[i]` is the name of the object with instance id i."""

    scene: Scene
    drive: UserDrive
    names: tuple[str, ...]


def read_user_scene(path: str | Path) -> UserScene:
    """Read the description of a scene and hash its mesh, which is not looked into yet.

    Raises:
        SceneError: a file cannot be read, or a key is missing, unknown or wrong; the message names it.
    """
    path = Path(path)
    table = read_toml(path)
    mesh = path.parent / table.text("file")
    rules = [_rule(entry, entry.text("name")) for entry in table.tables("object")]
    if "default" in table:
        rules.append(_rule(table.table("default"), "*"))
    scale = table.number("scale", 1.0)
    if scale <= 0:
        raise table.fault(f"scale must be above 0, got {scale:g}")
    scene = UserScene(
        folder=mesh.parent.absolute(),
        file=mesh.name,
        sha256=mesh_sha256(mesh),
        up=table.text("up", default_up(mesh), allowed=UPS),
        scale=scale,
        rules=tuple(rules),
        drive=read_drive_plan(table.table("drive")),
        targets=targets_of(table),
    )
    table.finish()
    return scene


def build_user_scene(scene: UserScene) -> BuiltUserScene:
    """Read the mesh of a scene and give every object its instance, material and class.

    Raises:
        SceneError: the mesh is broken or is not the one that was described, or no rule fits an object.
    """
    if mesh_sha256(scene.mesh_path) != scene.sha256:
        raise SceneError(f"{scene.mesh_path}: changed since its description was read")
    parts = read_parts(scene.mesh_path, up=scene.up, scale=scene.scale)
    builder, names = SceneBuilder(()), ["none"]
    for (owner, class_name), meshes in _objects(scene, parts).items():
        builder.add(class_name, {material: _joined(pieces) for material, pieces in meshes.items()})
        names.append(owner)
    drive = make_user_drive(scene.drive)
    static = builder.static()
    built = Scene(
        preset="custom",
        seed=0,
        static=static,
        prototypes=(),
        placements=builder.placements(),
        instance_class=builder.instance_class(),
        roads=RoadGraph(lanes=(), junctions=np.zeros((0, 2))),
        bounds_m=_bounds(static, drive),
    )
    return BuiltUserScene(scene=built, drive=drive, names=tuple(names))


def _rule(entry: Table, pattern: str) -> ObjectRule:
    """Return what an `[[object]]` or the `[default]` says."""
    skip = entry.flag("skip")
    given = "material" in entry, "class" in entry
    if skip and any(given):
        raise entry.fault("skip leaves no material and no class to give")
    rule = ObjectRule(
        pattern=pattern,
        material="" if skip else entry.text("material", allowed=MATERIAL_NAMES),
        class_name="" if skip else entry.text("class", allowed=CLASS_NAMES),
        skip=skip,
    )
    entry.finish()
    return rule


def _objects(scene: UserScene, parts: Sequence[MeshPart]) -> dict[tuple[str, str], dict[str, list[Mesh]]]:
    """Return the meshes of every object by material; objects are told apart by name and class."""
    objects: dict[tuple[str, str], dict[str, list[Mesh]]] = {}
    nameless = []
    for part in parts:
        rule = next((rule for rule in scene.rules if _fits(rule, part)), None)
        if rule is None:
            nameless.append(part.owner)
        elif not rule.skip:
            meshes = objects.setdefault((part.owner, rule.class_name), {})
            meshes.setdefault(rule.material, []).append(part.mesh)
    if nameless:
        told = list(dict.fromkeys(nameless))
        more = f" and {len(told) - _TOLD} more" if len(told) > _TOLD else ""
        raise SceneError(
            f"{scene.mesh_path}: no [[object]] gives a material and a class to "
            f"{', '.join(map(repr, told[:_TOLD]))}{more}"
        )
    if not objects:
        raise SceneError(f"{scene.mesh_path}: every object is skipped")
    return objects


def _fits(rule: ObjectRule, part: MeshPart) -> bool:
    return any(fnmatchcase(name, rule.pattern) for name in part.names)


def _joined(meshes: Sequence[Mesh]) -> Mesh:
    starts = np.cumsum([0, *(len(mesh.vertices) for mesh in meshes)])
    return Mesh(
        vertices=np.concatenate([mesh.vertices for mesh in meshes]),
        faces=np.concatenate(
            [mesh.faces + np.uint32(start) for mesh, start in zip(meshes, starts, strict=False)]
        ),
    )


def _bounds(static: dict[str, StaticMesh], drive: UserDrive) -> tuple[float, float, float, float]:
    """Return x0, y0, x1, y1 [m] of the meshes and of the drive with some room round it."""
    way = drive.trajectory.state[:, :2]
    corners = [way - _MARGIN_M, way + _MARGIN_M, *(mesh.vertices[:, :2] for mesh in static.values())]
    low, high = (np.array([edge(corner, axis=0) for corner in corners]) for edge in (np.min, np.max))
    (x0, y0), (x1, y1) = low.min(axis=0), high.max(axis=0)
    return float(x0), float(y0), float(x1), float(y1)
