"""Custom scenes: a TOML file with a mesh, materials and classes of its objects, and a drive.

The keys are documented in docs/scenes.md. The scene depends on the content of the file and the hash of the
mesh, but not on the paths of the files.
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

_MOST_NAMED = 5
_MARGIN_M = 10.0


@dataclass(frozen=True, kw_only=True)
class ObjectRule:
    """Material and class of the objects whose name matches a pattern.

    Attributes:
        pattern: Case-sensitive pattern (fnmatch).
        material: Name of the material.
        class_name: Name of the class.
        skip: Whether the objects are left out.
    """

    pattern: str
    material: str = ""
    class_name: str = ""
    skip: bool = False


@dataclass(frozen=True, kw_only=True)
class UserScene:
    """Description of a custom scene, as read from its TOML file.

    Attributes:
        folder: Folder of the mesh.
        file: Name of the mesh file.
        sha256: Hash of the mesh when the description was read.
        up: Axis that points up in the mesh, "y" or "z".
        scale: Metres per unit of the mesh.
        rules: Rules for the objects; the first that matches applies.
        drive: Plan of the drive.
        targets: Test targets.
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
        """Path of the mesh file."""
        return self.folder / self.file


@dataclass(frozen=True, kw_only=True)
class BuiltUserScene:
    """A custom scene with its mesh.

    Attributes:
        scene: The scene.
        drive: The drive.
        names: Name of the object of each instance id.
    """

    scene: Scene
    drive: UserDrive
    names: tuple[str, ...]


def read_user_scene(path: str | Path) -> UserScene:
    """Read the description of a custom scene and hash its mesh, without parsing the mesh.

    Args:
        path: The TOML file.

    Returns:
        The description.

    Raises:
        SceneError: A file cannot be read, or a key is missing, unknown or invalid; the message names it.
    """
    path = Path(path)
    table = read_toml(path)
    mesh = path.parent / table.string("file")
    rules = [_rule(entry, entry.string("name")) for entry in table.tables("object")]
    if "default" in table:
        rules.append(_rule(table.table("default"), "*"))
    scale = table.number("scale", 1.0)
    if scale <= 0:
        raise table.error(f"scale must be above 0, got {scale:g}")
    scene = UserScene(
        folder=mesh.parent.absolute(),
        file=mesh.name,
        sha256=mesh_sha256(mesh),
        up=table.string("up", default_up(mesh), allowed=UPS),
        scale=scale,
        rules=tuple(rules),
        drive=read_drive_plan(table.table("drive")),
        targets=targets_of(table),
    )
    table.reject_unknown_keys()
    return scene


def build_user_scene(scene: UserScene, *, seed: int) -> BuiltUserScene:
    """Read the mesh of a custom scene and assign instance ids, materials and classes.

    Args:
        scene: Description of the scene.
        seed: Decides the unevenness of the road.

    Returns:
        The scene and its drive.

    Raises:
        SceneError: The mesh is invalid or has changed since it was described, or no rule matches an object.
    """
    if mesh_sha256(scene.mesh_path) != scene.sha256:
        raise SceneError(f"{scene.mesh_path}: changed since its description was read")
    parts = read_parts(scene.mesh_path, up=scene.up, scale=scene.scale)
    builder, names = SceneBuilder(()), ["none"]
    for (owner, class_name), meshes in _objects(scene, parts).items():
        builder.add(class_name, {material: _joined(pieces) for material, pieces in meshes.items()})
        names.append(owner)
    drive = make_user_drive(scene.drive, seed=seed)
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
    """Read an `[[object]]` or `[default]` entry."""
    skip = entry.boolean("skip")
    given = "material" in entry, "class" in entry
    if skip and any(given):
        raise entry.error("skip excludes material and class")
    rule = ObjectRule(
        pattern=pattern,
        material="" if skip else entry.string("material", allowed=MATERIAL_NAMES),
        class_name="" if skip else entry.string("class", allowed=CLASS_NAMES),
        skip=skip,
    )
    entry.reject_unknown_keys()
    return rule


def _objects(scene: UserScene, parts: Sequence[MeshPart]) -> dict[tuple[str, str], dict[str, list[Mesh]]]:
    """Return the meshes of each object by material; objects are distinguished by name and class."""
    objects: dict[tuple[str, str], dict[str, list[Mesh]]] = {}
    unmatched = []
    for part in parts:
        rule = next((rule for rule in scene.rules if _fits(rule, part)), None)
        if rule is None:
            unmatched.append(part.owner)
        elif not rule.skip:
            meshes = objects.setdefault((part.owner, rule.class_name), {})
            meshes.setdefault(rule.material, []).append(part.mesh)
    if unmatched:
        names = list(dict.fromkeys(unmatched))
        more = f" and {len(names) - _MOST_NAMED} more" if len(names) > _MOST_NAMED else ""
        raise SceneError(
            f"{scene.mesh_path}: no [[object]] gives a material and a class to "
            f"{', '.join(map(repr, names[:_MOST_NAMED]))}{more}"
        )
    if not objects:
        raise SceneError(f"{scene.mesh_path}: every object is skipped")
    return objects


def _fits(rule: ObjectRule, part: MeshPart) -> bool:
    """Return whether a rule matches any name of a part."""
    return any(fnmatchcase(name, rule.pattern) for name in part.names)


def _joined(meshes: Sequence[Mesh]) -> Mesh:
    """Concatenate meshes."""
    starts = np.cumsum([0, *(len(mesh.vertices) for mesh in meshes)])
    return Mesh(
        vertices=np.concatenate([mesh.vertices for mesh in meshes]),
        faces=np.concatenate(
            [mesh.faces + np.uint32(start) for mesh, start in zip(meshes, starts, strict=False)]
        ),
    )


def _bounds(static: dict[str, StaticMesh], drive: UserDrive) -> tuple[float, float, float, float]:
    """Return the extent x0, y0, x1, y1 [m] of the meshes and of the drive with a margin."""
    path = drive.trajectory.state[:, :2]
    corners = [path - _MARGIN_M, path + _MARGIN_M, *(mesh.vertices[:, :2] for mesh in static.values())]
    low, high = (np.array([edge(corner, axis=0) for corner in corners]) for edge in (np.min, np.max))
    (x0, y0), (x1, y1) = low.min(axis=0), high.max(axis=0)
    return float(x0), float(y0), float(x1), float(y1)
