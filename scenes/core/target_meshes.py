"""Adds test targets to a scene as meshes that rays can hit.

Echoes of coherent targets are computed from their exact shape (`sim.raytracing.targets`); their meshes
shadow what is behind them and reflect other echoes.
"""

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from echoscape.scenes.core.scene import CLASSES, Mesh, Scene, StaticMesh, joined_normals
from echoscape.scenes.core.targets import KINDS, PlacedTarget, Target

_FACETS = 96
"""Sides of the cylinder or sphere that rays hit; echoes are computed from the exact shape."""


def with_targets(scene: Scene, targets: Sequence[Target]) -> Scene:
    """Add test targets to a scene.

    Args:
        scene: The scene.
        targets: Targets in world coordinates.

    Returns:
        The scene with its targets; their instance ids follow those of the scene.
    """
    meshes: dict[str, list[StaticMesh]] = {material: [mesh] for material, mesh in scene.static.items()}
    classes, placed = list(scene.instance_class), list(scene.targets)
    for target in targets:
        instance = len(classes)
        classes.append(CLASSES.index(KINDS[target.kind].class_name))
        placed.append(PlacedTarget(target=target, instance=instance))
        mesh = _mesh(target)
        if mesh is not None:
            ids = np.full(len(mesh.faces), instance, np.uint32)
            target_mesh = StaticMesh(vertices=mesh.vertices, faces=mesh.faces, instance=ids)
            meshes.setdefault(target.material, []).append(target_mesh)
    return replace(
        scene,
        static={material: _joined(meshes[material]) for material in sorted(meshes)},
        instance_class=np.array(classes, np.uint8),
        targets=tuple(placed),
    )


def _joined(meshes: list[StaticMesh]) -> StaticMesh:
    """Concatenate meshes of one material."""
    if len(meshes) == 1:
        return meshes[0]
    starts = np.cumsum([0] + [len(mesh.vertices) for mesh in meshes[:-1]])
    faces = [mesh.faces + np.uint32(start) for mesh, start in zip(meshes, starts, strict=True)]
    return StaticMesh(
        vertices=np.concatenate([mesh.vertices for mesh in meshes]),
        faces=np.concatenate(faces),
        instance=np.concatenate([mesh.instance for mesh in meshes]),
        normals=joined_normals(meshes),
    )


def _mesh(target: Target) -> Mesh | None:
    """Return the mesh of a target in the world; None for a point target."""
    if target.kind == "point":
        return None
    if KINDS[target.kind].flat:
        return _flat_mesh(target)
    local = _solid(target.kind, target.size_m)
    vertices = local.vertices.astype(np.float64) @ target.axes + np.array(target.position_m)
    return Mesh(vertices=vertices.astype(np.float32), faces=local.faces)


def _flat_mesh(target: Target) -> Mesh:
    """Return the triangles of a target's flat patches, counter-clockwise seen from the boresight."""
    corner, first, second = target.patches.transpose(1, 0, 2)
    triangles = [np.stack([corner, corner + first, corner + second], axis=1)]
    if target.kind != "trihedral":
        triangles.append(np.stack([corner + first, corner + first + second, corner + second], axis=1))
    corners = np.concatenate(triangles).reshape(-1, 3)
    faces = np.arange(len(corners), dtype=np.uint32).reshape(-1, 3)
    return Mesh(vertices=corners.astype(np.float32), faces=faces)


def _solid(kind: str, size_m: tuple[float, ...]) -> Mesh:
    """Return a sphere, cylinder, wall or vehicle in the frame of the target."""
    import trimesh

    if kind == "sphere":
        solid = trimesh.creation.uv_sphere(radius=size_m[0], count=[_FACETS // 2, _FACETS])
    elif kind == "cylinder":
        solid = trimesh.creation.cylinder(radius=size_m[0], height=size_m[1], sections=_FACETS)
    elif kind == "wall":
        length, height, thickness = size_m
        solid = trimesh.creation.box(extents=(thickness, length, height))
        solid.apply_translation([-thickness / 2, 0.0, height / 2])
    else:
        solid = trimesh.creation.box(extents=size_m)
        solid.apply_translation([0.0, 0.0, size_m[2] / 2])
    return Mesh(vertices=np.asarray(solid.vertices, np.float32), faces=np.asarray(solid.faces, np.uint32))
