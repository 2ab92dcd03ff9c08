"""Small solids as triangle meshes: boxes, prisms, lofts, tubes and ellipsoids.

Faces are counter-clockwise seen from outside. Round solids carry the normals of the surface that their facets
stand for.
"""

from collections.abc import Sequence

import numpy as np
from numpy.typing import ArrayLike, NDArray

from echoscape.scenes.core.scene import Mesh
from echoscape.scenes.geometry.meshes import mesh
from echoscape.scenes.geometry.triangulation import polygon_triangles

_BOX_CORNERS = np.array(
    [[-1, -1, -1], [1, -1, -1], [1, 1, -1], [-1, 1, -1], [-1, -1, 1], [1, -1, 1], [1, 1, 1], [-1, 1, 1]]
)
_BOX_QUADS = np.array(
    [[3, 2, 1, 0], [4, 5, 6, 7], [0, 1, 5, 4], [2, 3, 7, 6], [3, 0, 4, 7], [1, 2, 6, 5]]
)  # below, above, -y, +y, -x, +x


def box(size_m: Sequence[float], centre_m: Sequence[float] = (0.0, 0.0, 0.0)) -> Mesh:
    """Make a box.

    Args:
        size_m: Size in x, y, z [m].
        centre_m: Centre x, y, z [m].

    Returns:
        The mesh.
    """
    points = 0.5 * np.asarray(size_m, dtype=np.float64) * _BOX_CORNERS + np.asarray(centre_m)
    return mesh(points, _quad_faces(_BOX_QUADS))


def loft(rings: ArrayLike, *, caps: bool = True, normals: ArrayLike | None = None) -> Mesh:
    """Make the surface between successive cross-sections.

    Args:
        rings: Cross-sections (K, N, 3) [m], each counter-clockwise seen from the side of the last one.
        caps: Whether to close both ends with triangle fans; the end rings must then be convex.
        normals: Unit normals of the curved surface at the points of the rings (K, N, 3); None for flat sides.
            Caps are flat.

    Returns:
        The mesh.
    """
    points = np.asarray(rings, dtype=np.float64)
    count, size = points.shape[:2]
    faces = _quad_faces(loft_quads(count, size))
    if caps:
        fan = np.stack([np.zeros(size - 2), np.arange(1, size - 1), np.arange(2, size)], axis=1)
        faces = np.concatenate([faces, fan[:, ::-1], fan + (count - 1) * size])
    if normals is None:
        return mesh(points.reshape(-1, 3), faces)
    smooth = np.asarray(normals, dtype=np.float64).reshape(-1, 3)[faces.astype(np.int64)]
    smooth[2 * (count - 1) * size :] = 0.0
    return mesh(points.reshape(-1, 3), faces, smooth)


def loft_quads(count: int, size: int) -> NDArray[np.int64]:
    """Return the quads between successive rings of vertices.

    Args:
        count: Number of rings.
        size: Number of points per ring.

    Returns:
        Vertex indices ((count - 1) * size, 4).
    """
    ring, point = np.divmod(np.arange((count - 1) * size), size)
    following = ring * size + (point + 1) % size
    own = ring * size + point
    return np.stack([own, following, following + size, own + size], axis=1)


def _quad_faces(corners: NDArray[np.int64]) -> NDArray[np.int64]:
    """Split quads (Q, 4) into triangles (2 Q, 3)."""
    return np.concatenate([corners[:, [0, 1, 2]], corners[:, [0, 2, 3]]])


def prism(outline: ArrayLike, *, bottom_m: float, top_m: float) -> Mesh:
    """Make an upright prism over a polygon.

    Args:
        outline: Simple counter-clockwise polygon (N, 2) [m], convex or not.
        bottom_m: Height of the bottom [m].
        top_m: Height of the top [m].

    Returns:
        The mesh.
    """
    corners = np.asarray(outline, dtype=np.float64)
    lid = polygon_triangles(corners)
    size = len(corners)
    points = np.concatenate([np.c_[corners, np.full(size, bottom_m)], np.c_[corners, np.full(size, top_m)]])
    return mesh(points, np.concatenate([_quad_faces(loft_quads(2, size)), lid[:, ::-1], lid + size]))


def circle(radius_m: float, sides: int) -> NDArray[np.float64]:
    """Return the corners of a regular polygon.

    Args:
        radius_m: Radius of its circumcircle [m].
        sides: Number of corners.

    Returns:
        Corners (sides, 2) [m], counter-clockwise.
    """
    angle = 2 * np.pi * np.arange(sides) / sides
    return radius_m * np.stack([np.cos(angle), np.sin(angle)], axis=1)


def cylinder(radius_m: float, height_m: float, *, sides: int = 8, top_radius_m: float | None = None) -> Mesh:
    """Make an upright cylinder that stands on z = 0.

    Args:
        radius_m: Radius of the bottom [m].
        height_m: Height [m].
        sides: Number of sides.
        top_radius_m: Radius of the top [m]; None for that of the bottom, 0 for a cone.

    Returns:
        The mesh.
    """
    return tube((0, 0, 0), (0, 0, height_m), radius_m, top_radius_m, sides=sides)


def tube(
    start_m: ArrayLike,
    end_m: ArrayLike,
    radius_m: float,
    end_radius_m: float | None = None,
    *,
    sides: int = 6,
) -> Mesh:
    """Make a round bar between two points.

    Args:
        start_m: Start x, y, z [m].
        end_m: End x, y, z [m].
        radius_m: Radius at the start [m].
        end_radius_m: Radius at the end [m]; None for that at the start.
        sides: Number of sides.

    Returns:
        The mesh.
    """
    start, end = np.asarray(start_m, dtype=np.float64), np.asarray(end_m, dtype=np.float64)
    axis = (end - start) / np.linalg.norm(end - start)
    across = np.cross(axis, (1.0, 0.0, 0.0) if abs(axis[0]) < 0.7 else (0.0, 1.0, 0.0))
    across /= np.linalg.norm(across)
    ring = circle(1.0, sides) @ np.stack([across, np.cross(axis, across)])
    last = radius_m if end_radius_m is None else end_radius_m
    outwards = ring + (radius_m - last) / np.linalg.norm(end - start) * axis
    outwards /= np.linalg.norm(outwards, axis=1, keepdims=True)
    rings = np.stack([start + radius_m * ring, end + last * ring])
    return loft(rings, normals=np.stack([outwards, outwards]))


def ellipsoid(
    radii_m: Sequence[float], centre_m: Sequence[float] = (0.0, 0.0, 0.0), *, sides: int = 8, rows: int = 5
) -> Mesh:
    """Make a faceted ellipsoid.

    Args:
        radii_m: Radii in x, y, z [m].
        centre_m: Centre x, y, z [m].
        sides: Number of facets around the z axis.
        rows: Number of bands between the poles.

    Returns:
        The mesh.
    """
    latitude = np.linspace(-np.pi / 2, np.pi / 2, rows + 1)
    flat = np.cos(latitude)[:, None, None] * circle(1.0, sides)
    high = np.broadcast_to(np.sin(latitude)[:, None, None], (rows + 1, sides, 1))
    unit = np.concatenate([flat, high], axis=2)
    outwards = unit / np.asarray(radii_m)
    outwards /= np.linalg.norm(outwards, axis=2, keepdims=True)
    return loft(unit * np.asarray(radii_m) + np.asarray(centre_m), caps=False, normals=outwards)
