"""Normals of the curved surfaces that facets stand for."""

from dataclasses import replace

import numpy as np
from numpy.typing import ArrayLike, NDArray

from echoscape.scenes.core import portable_math
from echoscape.scenes.core.scene import Mesh

_FLAT = 1e-4
"""Faces whose normals differ by less are flat [rad]."""


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
    angle = portable_math.arccos(np.clip(cosine, -1, 1)).ravel()
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


def _pairs(place: NDArray[np.int64]) -> tuple[NDArray[np.int64], NDArray[np.int64]]:
    """Return all ordered pairs of items that lie in one place, each item with itself included."""
    order = np.argsort(place, kind="stable")
    count = np.bincount(place)
    start = np.cumsum(count) - count
    times = count[place]
    first = np.repeat(np.arange(len(place)), times)
    within = np.arange(len(first)) - np.repeat(np.cumsum(times) - times, times)
    return first, order[start[place[first]] + within]
