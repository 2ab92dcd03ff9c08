"""The part of a scene within reach of a motion: all that a sensor of limited range can meet on its way."""

from dataclasses import replace

import numpy as np

from echoscape.scenes.core.scene import Placements, Prototype, Scene, StaticMesh
from echoscape.scenes.core.trajectory import Trajectory

Area = tuple[float, float, float, float]
"""A rectangle x0, y0, x1, y1 in the world [m]."""


def reached_area(track: Trajectory, *, reach_m: float) -> Area:
    """Return a rectangle that holds all places within reach of a motion.

    A cubic between knots lies within the hull of its Bezier points, which are its ends and a third of the
    tangents from them (Farin, Curves and Surfaces for CAGD, 5th ed. 2002, section 4.2).

    Args:
        track: The motion.
        reach_m: Distance from it [m].

    Returns:
        The rectangle.
    """
    third = np.diff(track.time_s)[:, None] / 3
    place, tangent = track.state[:, :2], track.rate[:, :2]
    points = np.concatenate([place, place[:-1] + third * tangent[:-1], place[1:] - third * tangent[1:]])
    (x0, y0), (x1, y1) = points.min(axis=0) - reach_m, points.max(axis=0) + reach_m
    return float(x0), float(y0), float(x1), float(y1)


def surroundings(scene: Scene, area: Area) -> Scene:
    """Return the part of a scene that an area decides: no ray that stays within it meets anything else.

    Args:
        scene: The scene.
        area: The rectangle.

    Returns:
        The scene with those faces and placements whose bounding rectangle touches the area; roads, targets
        and instance ids are the same.
    """
    return replace(
        scene,
        static={material: _faces_in(mesh, area) for material, mesh in scene.static.items()},
        placements=_placements_in(scene.placements, scene.prototypes, area),
    )


def _faces_in(mesh: StaticMesh, area: Area) -> StaticMesh:
    """Return the faces that touch the area, and their vertices."""
    x, y = mesh.vertices[:, 0], mesh.vertices[:, 1]
    beyond = np.zeros(len(x), np.uint8)
    for bit, side in enumerate((x < area[0], y < area[1], x > area[2], y > area[3])):
        beyond |= side.astype(np.uint8) << bit
    # A face lies outside for certain where all of its corners are beyond the same side.
    first, second, third = (beyond[mesh.faces[:, corner]] for corner in range(3))
    keep = (first & second & third) == 0
    if keep.all():
        return mesh
    faces = mesh.faces[keep]
    used = np.zeros(len(mesh.vertices), np.bool_)
    used[faces] = True
    number = np.cumsum(used, dtype=np.uint32) - np.uint32(1)
    return replace(
        mesh,
        vertices=mesh.vertices[used],
        faces=number[faces],
        instance=mesh.instance[keep],
        normals=None if mesh.normals is None else mesh.normals[keep],
    )


def _placements_in(placements: Placements, prototypes: tuple[Prototype, ...], area: Area) -> Placements:
    """Return the placements that may touch the area, by the circle about their prototype's origin."""
    radius = np.array([_radius_m(each) for each in prototypes] + [0.0])
    reach = radius[placements.prototype] * placements.scale
    x, y = placements.position[:, 0], placements.position[:, 1]
    keep = (x + reach >= area[0]) & (y + reach >= area[1]) & (x - reach <= area[2]) & (y - reach <= area[3])
    return Placements(**{name: values[keep] for name, values in vars(placements).items()})


def _radius_m(prototype: Prototype) -> float:
    """Return the largest horizontal distance of a prototype from its origin [m]."""
    places = [part.vertices[:, :2] for part in prototype.parts.values()]
    return max((float(np.hypot(*each.T).max(initial=0)) for each in places), default=0.0)
