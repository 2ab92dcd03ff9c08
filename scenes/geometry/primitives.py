"""Small solids as triangle meshes: boxes, prisms, lofts, tubes, ellipsoids, separate quads, and their union.

Faces are counter-clockwise seen from outside. Shapes are computed in float64 and rounded once to float32.
Round solids carry the normals of the surface that their facets stand for.
"""

from collections.abc import Iterable, Sequence
from dataclasses import replace

import numpy as np
from numpy.typing import ArrayLike, NDArray

from echoscape.scenes.core.scene import Mesh, Prototype, joined_normals

MIN_AREA_M2 = 1e-8
"""Smaller faces are dropped; they arise where a shape tapers to an edge."""
_FLAT = 1e-4
"""Faces whose normals differ by less are flat [rad]."""

_BOX_CORNERS = np.array(
    [[-1, -1, -1], [1, -1, -1], [1, 1, -1], [-1, 1, -1], [-1, -1, 1], [1, -1, 1], [1, 1, 1], [-1, 1, 1]]
)
_BOX_QUADS = np.array(
    [[3, 2, 1, 0], [4, 5, 6, 7], [0, 1, 5, 4], [2, 3, 7, 6], [3, 0, 4, 7], [1, 2, 6, 5]]
)  # below, above, -y, +y, -x, +x


def mesh(vertices: ArrayLike, faces: ArrayLike, normals: ArrayLike | None = None) -> Mesh:
    """Make a mesh without faces of zero area.

    Args:
        vertices: Positions (V, 3) [m].
        faces: Vertex indices (F, 3).
        normals: Unit normals of the curved surface at the corners of each face (F, 3, 3), zero for faces that
            are flat; None where all are.

    Returns:
        The mesh.
    """
    points = np.asarray(vertices, dtype=np.float32).reshape(-1, 3)
    triangles = np.asarray(faces, dtype=np.uint32).reshape(-1, 3)
    kept = areas(points, triangles) > MIN_AREA_M2
    smooth = None if normals is None else np.asarray(normals, np.float32).reshape(-1, 3, 3)[kept]
    return Mesh(vertices=points, faces=triangles[kept], normals=smooth)


def smoothed(part: Mesh, *, crease_rad: float) -> Mesh:
    """Give a mesh the normals of the curved surface that its facets stand for.

    The normal at a corner of a face is the mean of those faces around the corner that are inclined to it by
    less than `crease_rad`, weighted by their angles there (Thuermer & Wuethrich, J. Graphics Tools 3(1),
    1998). Faces that meet none but coplanar ones stay flat.

    Args:
        part: The mesh; corners within 0.01 mm of each other are one.
        crease_rad: Largest angle between neighbours that are one surface [rad].

    Returns:
        The mesh with normals.
    """
    corners = part.vertices[part.faces].astype(np.float64)
    edges = np.roll(corners, -1, axis=1) - corners
    normal = np.cross(edges[:, 0], edges[:, 1])
    normal /= np.linalg.norm(normal, axis=1, keepdims=True)
    toward, back = edges, -np.roll(edges, 1, axis=1)
    cosine = np.sum(toward * back, axis=2) / np.linalg.norm(toward, axis=2) / np.linalg.norm(back, axis=2)
    angle = np.arccos(np.clip(cosine, -1, 1)).ravel()
    _, place = np.unique(np.round(corners.reshape(-1, 3) * 1e5).astype(np.int64), axis=0, return_inverse=True)
    first, second = _pairs(place.ravel())
    one_surface = np.sum(normal[first // 3] * normal[second // 3], axis=1) > np.cos(crease_rad)
    first, second = first[one_surface], second[one_surface]
    weight = angle[second, None] * normal[second // 3]
    total = np.stack([np.bincount(first, weight[:, k], len(angle)) for k in range(3)], axis=1)
    total /= np.linalg.norm(total, axis=1, keepdims=True)
    total = total.reshape(-1, 3, 3)
    flat = np.abs(total - normal[:, None]).max(axis=(1, 2)) < _FLAT
    total[flat] = 0.0
    return replace(part, normals=total.astype(np.float32))


def _pairs(place: NDArray[np.int64]) -> tuple[NDArray[np.int64], NDArray[np.int64]]:
    """Return all ordered pairs of items that lie in one place, each item with itself included."""
    order = np.argsort(place, kind="stable")
    count = np.bincount(place)
    start = np.cumsum(count) - count
    times = count[place]
    first = np.repeat(np.arange(len(place)), times)
    within = np.arange(len(first)) - np.repeat(np.cumsum(times) - times, times)
    return first, order[start[place[first]] + within]


def areas(vertices: NDArray[np.float32], faces: NDArray[np.uint32]) -> NDArray[np.float64]:
    """Return the area of each face.

    Args:
        vertices: Positions (V, 3) float32 [m].
        faces: Vertex indices (F, 3) uint32.

    Returns:
        Areas (F,) [m^2].
    """
    first, second, third = vertices[faces.T].astype(np.float64)
    ux, uy, uz = (second - first).T
    vx, vy, vz = (third - first).T
    return 0.5 * np.sqrt((uy * vz - uz * vy) ** 2 + (uz * vx - ux * vz) ** 2 + (ux * vy - uy * vx) ** 2)


def quads(corners: ArrayLike) -> Mesh:
    """Make a mesh of separate quads.

    Args:
        corners: Corners (Q, 4, 3) [m], each quad counter-clockwise seen from its outer side.

    Returns:
        The mesh, two triangles per quad.
    """
    points = np.asarray(corners, dtype=np.float64).reshape(-1, 4, 3)
    first = 4 * np.arange(len(points))
    return mesh(points, first[:, None] + [0, 1, 2, 0, 2, 3])


def merge(meshes: Iterable[Mesh]) -> Mesh:
    """Concatenate meshes.

    Args:
        meshes: The meshes; may be none.

    Returns:
        One mesh.
    """
    parts = list(meshes)
    if not parts:
        return Mesh(vertices=np.zeros((0, 3), np.float32), faces=np.zeros((0, 3), np.uint32))
    start = np.cumsum([0] + [len(part.vertices) for part in parts[:-1]])
    faces = [part.faces + np.uint32(offset) for part, offset in zip(parts, start, strict=True)]
    return Mesh(
        vertices=np.concatenate([part.vertices for part in parts]),
        faces=np.concatenate(faces),
        normals=joined_normals(parts),
    )


def moved(
    part: Mesh,
    offset_m: Sequence[float] = (0.0, 0.0, 0.0),
    *,
    yaw_rad: float = 0.0,
    rotation: ArrayLike | None = None,
) -> Mesh:
    """Rotate and translate a mesh.

    Args:
        part: The mesh.
        offset_m: Translation x, y, z [m], applied last.
        yaw_rad: Rotation about z [rad], applied after `rotation`.
        rotation: Rotation matrix (3, 3), applied first; None for none.

    Returns:
        The transformed mesh.
    """
    cos, sin = np.cos(yaw_rad), np.sin(yaw_rad)
    turn = np.array([[cos, -sin, 0.0], [sin, cos, 0.0], [0.0, 0.0, 1.0]])
    turn = turn if rotation is None else turn @ np.asarray(rotation, dtype=np.float64)
    points = part.vertices.astype(np.float64) @ turn.T + np.asarray(offset_m, dtype=np.float64)
    normals = None if part.normals is None else (part.normals @ turn.T).astype(np.float32)
    return Mesh(vertices=points.astype(np.float32), faces=part.faces, normals=normals)


def mirrored(part: Mesh) -> Mesh:
    """Mirror a mesh in the x-z plane, so that left becomes right; its faces still point outwards.

    Args:
        part: The mesh.

    Returns:
        The mirrored mesh.
    """
    flip = np.array([1, -1, 1], np.float32)
    normals = None if part.normals is None else part.normals[:, ::-1] * flip
    return Mesh(vertices=part.vertices * flip, faces=part.faces[:, ::-1].copy(), normals=normals)


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


def ring_normals(rings: ArrayLike) -> NDArray[np.float64]:
    """Return the normals of the curved surface through successive rings, from the differences between points.

    Args:
        rings: Closed cross-sections (K, N, 3) [m], as for `loft`; no ring is a single point.

    Returns:
        Unit normals (K, N, 3).
    """
    points = np.asarray(rings, dtype=np.float64)
    around = np.roll(points, -1, axis=1) - np.roll(points, 1, axis=1)
    outwards = np.cross(around, np.gradient(points, axis=0))
    return outwards / np.linalg.norm(outwards, axis=2, keepdims=True)


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


def polygon_triangles(outline: NDArray[np.float64]) -> NDArray[np.int64]:
    """Triangulate a polygon by ear clipping.

    Args:
        outline: Simple counter-clockwise polygon (N, 2).

    Returns:
        Corner indices (N - 2, 3).
    """
    left = list(range(len(outline)))
    triangles = []
    while len(left) > 3:
        ear = next((i for i in range(len(left)) if _is_ear(outline, left, i)), 0)
        triangles.append((left[ear - 1], left[ear], left[(ear + 1) % len(left)]))
        del left[ear]
    return np.array([*triangles, left], dtype=np.int64)


def _is_ear(outline: NDArray[np.float64], left: list[int], i: int) -> bool:
    """Return whether corner `i` of the remaining polygon can be cut off."""
    before, own, after = left[i - 1], left[i], left[(i + 1) % len(left)]
    corners = outline[[before, own, after]]
    edges = np.roll(corners, -1, axis=0) - corners
    if edges[0, 0] * edges[1, 1] - edges[0, 1] * edges[1, 0] <= 1e-12:
        return False
    others = outline[[j for j in left if j not in (before, own, after)]]
    away = others[:, None] - corners  # (M, 3, 2)
    side = edges[:, 0] * away[..., 1] - edges[:, 1] * away[..., 0]
    return not bool(np.any(np.all(side >= 0, axis=1)))


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


def prototype(name: str, class_name: str, parts: dict[str, Mesh]) -> Prototype:
    """Make a prototype, shifted so that its bounding box is centred on the origin and stands on z = 0.

    Args:
        name: Name of the prototype.
        class_name: Class of its objects.
        parts: Meshes by name of the material.

    Returns:
        The prototype.
    """
    points = np.concatenate([part.vertices[np.unique(part.faces)] for part in parts.values()])
    low, high = points.min(axis=0).astype(np.float64), points.max(axis=0).astype(np.float64)
    shift = (-(low[0] + high[0]) / 2, -(low[1] + high[1]) / 2, -low[2])
    length, width, height = (high - low).tolist()
    return Prototype(
        name=name,
        class_name=class_name,
        parts={material: moved(part, shift) for material, part in parts.items()},
        extent_m=(length, width, height),
    )
