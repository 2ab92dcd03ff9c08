"""Exports a scene as glTF: one mesh per material, and prototypes stored once and placed by nodes.

glTF has y up (Khronos glTF 2.0, section 3.4); the root node rotates the world's z up to it.
"""

from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from echoscape.scenes.core.scene import Mesh, Scene

if TYPE_CHECKING:
    import trimesh  # slow to import: the functions that need it import it

COLOURS: dict[str, tuple[float, float, float]] = {
    "concrete": (0.66, 0.65, 0.62),
    "brick": (0.60, 0.31, 0.22),
    "plasterboard": (0.88, 0.86, 0.80),
    "wood": (0.45, 0.32, 0.20),
    "glass": (0.35, 0.48, 0.55),
    "metal": (0.55, 0.57, 0.62),
    "asphalt": (0.20, 0.20, 0.22),
    "paving": (0.72, 0.70, 0.66),
    "soil": (0.36, 0.45, 0.24),
    "foliage": (0.18, 0.38, 0.14),
    "rubber": (0.08, 0.08, 0.08),
    "person": (0.80, 0.60, 0.50),
}
"""Base colour (linear red, green, blue) of each material, for display only."""


def gltf_scene(scene: Scene) -> "trimesh.Scene":
    """Convert a scene to a trimesh scene graph.

    Args:
        scene: The scene.

    Returns:
        One node per material, and one per part of each placement.
    """
    import trimesh

    tree = trimesh.Scene()
    upright = np.array([[1.0, 0, 0, 0], [0, 0, 1, 0], [0, -1, 0, 0], [0, 0, 0, 1]])
    tree.graph.update(frame_to="town", frame_from="world", matrix=upright)
    for material, mesh in scene.static.items():
        name = f"static/{material}"
        tree.add_geometry(_geometry(mesh, material), node_name=name, geom_name=name, parent_node_name="town")
    placed = scene.placements
    for row, prototype in enumerate(scene.prototypes):
        rows = np.flatnonzero(placed.prototype == row)
        if len(rows) == 0:
            continue
        for material, mesh in prototype.parts.items():
            name = f"{prototype.name}/{material}"
            tree.geometry[name] = _geometry(mesh, material)
            for i in rows:
                node = f"{name}/{placed.instance[i]}"
                pose = _pose(placed.position[i], float(placed.yaw[i]), float(placed.scale[i]))
                tree.graph.update(frame_to=node, frame_from="town", matrix=pose, geometry=name)
    return tree


def scene_to_glb(scene: Scene) -> bytes:
    """Convert a scene to binary glTF.

    Args:
        scene: The scene.

    Returns:
        Content of the .glb file.
    """
    data = gltf_scene(scene).export(file_type="glb")
    if not isinstance(data, bytes):
        raise TypeError(f"expected bytes from the glb exporter, got {type(data).__name__}")
    return data


def is_complete_glb(path: Path) -> bool:
    """Check whether a file exists and has the length that its header states; the rest is not read.

    Khronos glTF 2.0, section 4.4.2: "glTF", version and length of the whole file, little-endian 32 bits each.

    Args:
        path: The file.

    Returns:
        Whether it is complete.
    """
    try:
        with path.open("rb") as file:
            header = file.read(12)
        return header[:4] == b"glTF" and int.from_bytes(header[8:], "little") == path.stat().st_size
    except FileNotFoundError:
        return False


def _geometry(mesh: Mesh, material: str) -> "trimesh.Trimesh":
    """Return a mesh with the colour of its material."""
    import trimesh
    from trimesh.visual import TextureVisuals
    from trimesh.visual.material import PBRMaterial

    colour = [*COLOURS.get(material, (0.5, 0.5, 0.5)), 1.0]
    look = PBRMaterial(
        name=material,
        baseColorFactor=colour,
        metallicFactor=0.8 if material == "metal" else 0.0,
        roughnessFactor=0.2 if material == "glass" else 0.8,
    )
    return trimesh.Trimesh(
        vertices=mesh.vertices,
        faces=mesh.faces.astype(np.int64),
        visual=TextureVisuals(material=look),
        process=False,
    )


def _pose(position: NDArray[np.float64], yaw_rad: float, scale: float) -> NDArray[np.float64]:
    """Return the matrix (4, 4) that places a prototype."""
    cos, sin = scale * np.cos(yaw_rad), scale * np.sin(yaw_rad)
    x, y, z = position
    return np.array([[cos, -sin, 0, x], [sin, cos, 0, y], [0, 0, scale, z], [0, 0, 0, 1.0]])
