"""Imports meshes from glb, gltf, obj and ply files through trimesh, checked, in metres with z up.

A part has one name and one material; the parts of a glTF node or of an obj object share the name of their
object. Meshes are not modified: nothing is merged, welded or repaired.
"""

import hashlib
import io
import json
import logging
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from echoscape.scenes.core.scene import Mesh
from echoscape.scenes.io.strict_toml import SceneError
from echoscape.scenes.io.wavefront import relabelled

if TYPE_CHECKING:
    import trimesh

SUFFIXES = (".glb", ".gltf", ".obj", ".ply")
UPS = ("z", "y")
FURTHEST_M = 10_000.0
"""Largest distance of a vertex from the origin [m]; float32 resolves about a millimetre there."""

_log = logging.getLogger(__name__)
_DEGENERATE = 1e-9
"""A triangle is degenerate if twice its area is below this share of its longest side squared."""


@dataclass(frozen=True, kw_only=True)
class MeshPart:
    """One mesh of a file, in the world.

    Attributes:
        owner: Name of the object to which it belongs.
        names: All names by which rules can select it.
        mesh: The mesh.
    """

    owner: str
    names: tuple[str, ...]
    mesh: Mesh


def default_up(path: Path) -> str:
    """Return the default vertical axis of a file format: y in glTF (2.0, section 3.4), z in the others.

    Args:
        path: The file.

    Returns:
        "y" or "z".
    """
    return "y" if path.suffix.lower() in (".glb", ".gltf") else "z"


def mesh_sha256(path: Path) -> str:
    """Hash a mesh file and, one after the other, the buffers to which a .gltf file refers.

    Args:
        path: The file.

    Returns:
        The SHA-256 in hexadecimal.

    Raises:
        SceneError: The format is not supported, or the file or one of its buffers cannot be read.
    """
    _check_suffix(path)
    digest = hashlib.sha256(_read(path))
    if path.suffix.lower() == ".gltf":
        for name in _buffers(path):
            digest.update(_read(path.parent / name))
    return digest.hexdigest()


def read_parts(path: Path, *, up: str, scale: float) -> list[MeshPart]:
    """Read the parts of a mesh file, scaled and with z up.

    Args:
        path: The file.
        up: Axis that points up in the file, "y" or "z".
        scale: Metres per unit of the file.

    Returns:
        The parts, sorted by name.

    Raises:
        SceneError: The file cannot be read, is truncated, has no faces or invalid numbers; the message names
            the file and the part.
    """
    _check_suffix(path)
    turn = np.eye(4)
    if up == "y":
        turn[:3, :3] = [[1, 0, 0], [0, 0, -1], [0, 1, 0]]
    turn[:3, :3] *= scale
    parts = list(_loaded(path, turn))
    # trimesh returns nodes in no particular order; instance ids need one.
    return sorted(parts, key=lambda part: (part.owner, part.names, part.mesh.vertices.tobytes()))


def _check_suffix(path: Path) -> None:
    """Refuse formats that are not supported."""
    if path.suffix.lower() not in SUFFIXES:
        raise SceneError(f"{path}: meshes must be {', '.join(SUFFIXES)}, got {path.suffix or 'no suffix'}")


def _read(path: Path) -> bytes:
    """Return the bytes of a file."""
    try:
        return path.read_bytes()
    except OSError as error:
        raise SceneError(f"{path}: cannot be read ({error.strerror})") from error


def _buffers(path: Path) -> list[str]:
    """Return the names of the files that hold the buffers of a .gltf file (glTF 2.0, section 5.10)."""
    try:
        buffers = json.loads(_read(path)).get("buffers", [])
        uris = [str(buffer.get("uri", "")) for buffer in buffers]
    except (ValueError, AttributeError) as error:
        raise SceneError(f"{path}: not a valid glTF file ({error})") from error
    return [uri for uri in uris if uri and not uri.startswith("data:")]


def _loaded(path: Path, turn: NDArray[np.float64]) -> Iterator[MeshPart]:
    """Yield every mesh of the file, transformed by its node and by `turn` (4, 4)."""
    data, suffix = _read(path), path.suffix.lower()
    labels: list[tuple[str, ...]] = []
    if suffix == ".obj":
        data, labels = relabelled(path, data)
    scene = _scene(path, data)
    if suffix == ".ply":
        _check_ply(path, data, scene)
    for node in scene.graph.nodes_geometry:
        matrix, name = scene.graph[node]
        geometry = scene.geometry[name]
        if suffix == ".ply":
            owner, names = path.stem, (path.stem,)
        elif suffix == ".obj":
            names = labels[int(str(name).removeprefix("part"))] if labels else (path.stem,)
            owner = names[0]
        else:
            owner, names = _gltf_names(scene, str(node), str(name))
        yield _part(path, owner, names, geometry, turn @ matrix)


def _scene(path: Path, data: bytes) -> "trimesh.Scene":
    """Load a file with trimesh; any exception becomes a one-line error."""
    import trimesh  # slow to import, and only needed here
    from trimesh.resolvers import FilePathResolver

    suffix = path.suffix.lower()
    options: dict[str, Any] = {"split_objects": True} if suffix == ".obj" else {}
    try:
        scene = trimesh.load_scene(
            io.BytesIO(data),
            file_type=suffix[1:],
            resolver=FilePathResolver(str(path)),
            process=False,
            **options,
        )
    except Exception as error:  # parsers of damaged files raise many kinds of errors
        raise SceneError(f"{path}: damaged or truncated ({type(error).__name__}: {_line(error)})") from error
    if not scene.geometry:
        raise SceneError(f"{path}: contains no mesh")
    return scene


def _line(error: Exception) -> str:
    """Return the message of an error on one line."""
    return " ".join(str(error).split())[:200]


def _gltf_names(scene: "trimesh.Scene", node: str, geometry: str) -> tuple[str, tuple[str, ...]]:
    """Return the object of a glTF node, and its names: object, mesh and material.

    A mesh with several materials becomes one node per material, below the node with the name.
    """
    mesh = scene.geometry[geometry]
    owner = node
    if mesh.metadata.get("from_gltf_primitive"):
        owner = str(scene.graph.transforms.parents.get(node, node))
    material = getattr(getattr(mesh.visual, "material", None), "name", None)
    return owner, tuple(dict.fromkeys(str(name) for name in (owner, geometry, material) if name))


def _part(
    path: Path, owner: str, names: tuple[str, ...], geometry: object, matrix: NDArray[np.float64]
) -> MeshPart:
    """Check and transform one mesh, without its degenerate faces."""
    import trimesh

    where = f"{path}: object {owner!r}"
    if not isinstance(geometry, trimesh.Trimesh) or len(geometry.faces) == 0:
        raise SceneError(f"{where} has no faces")
    vertices, faces = np.asarray(geometry.vertices, np.float64), np.asarray(geometry.faces, np.int64)
    if faces.min() < 0 or faces.max() >= len(vertices):
        raise SceneError(
            f"{where}: a face refers to vertex {faces.max()}, but there are {len(vertices)}, counted from 0"
        )
    if not np.isfinite(vertices).all() or not np.isfinite(matrix).all():
        raise SceneError(f"{where}: a vertex or its transform is not finite (NaN or infinite)")
    vertices = vertices @ matrix[:3, :3].T + matrix[:3, 3]
    reach_m = np.abs(vertices[faces]).max()
    if reach_m > FURTHEST_M:
        raise SceneError(
            f"{where} reaches {reach_m:.0f} m from the origin, further than {FURTHEST_M:.0f} m: "
            "move the scene to its origin, or set scale"
        )
    vertices = vertices.astype(np.float32)
    if np.linalg.det(matrix[:3, :3]) < 0:  # a mirrored node turns faces inside out
        faces = faces[:, ::-1]
    faces = faces[_proper(where, vertices[faces].astype(np.float64))]
    used, place = np.unique(faces, return_inverse=True)
    mesh = Mesh(vertices=vertices[used], faces=place.reshape(faces.shape).astype(np.uint32))
    return MeshPart(owner=owner, names=names, mesh=mesh)


def _proper(where: str, corners: NDArray[np.float64]) -> NDArray[np.bool_]:
    """Return which triangles (T, 3, 3) have an area; log how many have none."""
    sides = np.roll(corners, -1, axis=1) - corners
    longest = (sides**2).sum(axis=2).max(axis=1)
    doubled = np.linalg.norm(np.cross(sides[:, 0], sides[:, 1]), axis=1)
    proper = doubled > _DEGENERATE * longest
    if not proper.any():
        raise SceneError(f"{where} has only degenerate faces (no area)")
    if not proper.all():
        _log.warning("%s: %d degenerate faces left out", where, int((~proper).sum()))
    return proper


def _check_ply(path: Path, data: bytes, scene: "trimesh.Scene") -> None:
    """Refuse a truncated ply file, which has fewer triangles than its header declares faces."""
    promised = 0
    for line in data.split(b"end_header", 1)[0].splitlines():
        words = line.split()
        if words[:2] == [b"element", b"face"] and len(words) == 3:
            promised = int(words[2])
    found = sum(len(getattr(mesh, "faces", ())) for mesh in scene.geometry.values())
    if found < promised:
        raise SceneError(f"{path}: damaged or truncated ({promised} faces declared, {found} found)")
