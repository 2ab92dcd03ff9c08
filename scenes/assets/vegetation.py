"""Trees, shrubs and hedges: wooden trunks and branches, and crowns of many small separate facets.

Rays pass between the leaf clusters, so objects behind a crown still return weakened echoes.
"""

from dataclasses import dataclass
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray

from echoscape.scenes.core import portable_math
from echoscape.scenes.core.scene import Mesh, Prototype
from echoscape.scenes.geometry.meshes import merge, mesh, prototype, quads
from echoscape.scenes.geometry.primitives import tube

_SEED = 20200531


@dataclass(frozen=True, kw_only=True)
class Tree:
    """Shape of a kind of tree.

    Attributes:
        name: Name of its prototype.
        crown_radius_m: Horizontal radius of the crown [m].
        crown_half_height_m: Half the height of the crown [m].
        crown_centre_m: Height of the centre of the crown [m].
        trunk_radius_m: Radius of the trunk [m].
        branches: Number of branches.
        clusters: Number of leaf clusters.
        cluster_m: Smallest and largest leaf cluster [m].
        taper: Narrowing of the crown from bottom to top: 0 gives an ellipsoid, 1 a cone.
    """

    name: str
    crown_radius_m: float
    crown_half_height_m: float
    crown_centre_m: float
    trunk_radius_m: float
    branches: int
    clusters: int
    cluster_m: tuple[float, float]
    taper: float = 0.0


TREES: tuple[Tree, ...] = (
    Tree(name="tree_broadleaf", crown_radius_m=3.0, crown_half_height_m=2.9, crown_centre_m=5.4,
         trunk_radius_m=0.24, branches=7, clusters=380, cluster_m=(0.35, 0.65)),
    Tree(name="tree_tall", crown_radius_m=2.4, crown_half_height_m=4.6, crown_centre_m=8.2,
         trunk_radius_m=0.3, branches=9, clusters=400, cluster_m=(0.35, 0.65)),
    Tree(name="tree_conifer", crown_radius_m=2.0, crown_half_height_m=4.4, crown_centre_m=5.3,
         trunk_radius_m=0.17, branches=10, clusters=360, cluster_m=(0.3, 0.6), taper=1.0),
    Tree(name="tree_street", crown_radius_m=1.6, crown_half_height_m=1.7, crown_centre_m=4.1,
         trunk_radius_m=0.11, branches=5, clusters=260, cluster_m=(0.25, 0.45)),
    Tree(name="tree_spreading", crown_radius_m=4.2, crown_half_height_m=2.4, crown_centre_m=5.2,
         trunk_radius_m=0.36, branches=9, clusters=400, cluster_m=(0.4, 0.7)),
    Tree(name="tree_shrub", crown_radius_m=0.9, crown_half_height_m=0.75, crown_centre_m=0.8,
         trunk_radius_m=0.04, branches=5, clusters=200, cluster_m=(0.15, 0.3)),
)  # fmt: skip


def tree_prototypes() -> tuple[Prototype, ...]:
    """Make one prototype of each of `TREES`, from a fixed seed.

    Returns:
        The prototypes.
    """
    return tuple(_tree(tree, np.random.default_rng([_SEED, row])) for row, tree in enumerate(TREES))


def _tree(tree: Tree, rng: np.random.Generator) -> Prototype:
    """Make a tree with its base on the ground."""
    parts = {"wood": _trunk(tree, rng), "foliage": _crown(tree, rng)}
    return prototype(tree.name, "tree", parts)


def _trunk(tree: Tree, rng: np.random.Generator) -> Mesh:
    """Make a tapered, slightly bent trunk and branches that reach into the crown."""
    base = tree.crown_centre_m - tree.crown_half_height_m
    top = tree.crown_centre_m + 0.5 * tree.crown_half_height_m
    radius = tree.trunk_radius_m
    fork = np.array([*rng.normal(0.0, 0.04, 2), 0.6 * tree.crown_centre_m])
    stem = [
        tube((0, 0, 0), (0, 0, 0.25), 1.35 * radius, radius, sides=8),
        tube((0, 0, 0.25), fork, radius, 0.75 * radius, sides=8),
        tube(fork, (0, 0, top), 0.75 * radius, 0.2 * radius, sides=6),
    ]
    # Steps of the golden angle: no two branches are aligned.
    angles = 2.4 * np.arange(tree.branches) + rng.uniform(0.0, 0.5, tree.branches)
    heights = np.linspace(max(base, 0.3 * tree.crown_centre_m), top, tree.branches, endpoint=False)
    for angle, height in zip(angles, heights, strict=True):
        reach = (
            0.75 * tree.crown_radius_m * (1.0 - tree.taper * (height - base) / (2 * tree.crown_half_height_m))
        )
        end = (reach * np.cos(angle), reach * np.sin(angle), height + 0.35 * reach * (1.0 - tree.taper))
        stem.append(tube((0, 0, height), end, 0.35 * radius, 0.12 * radius, sides=5))
    return merge(stem)


def _crown(tree: Tree, rng: np.random.Generator) -> Mesh:
    """Make leaf clusters: squares of random size and tilt, denser towards the surface of the crown."""
    count = tree.clusters
    direction = rng.normal(size=(count, 3))
    direction /= np.linalg.norm(direction, axis=1, keepdims=True)
    depth = portable_math.power(rng.uniform(0.25, 1.0, (count, 1)), 0.4)
    lumps = 1.0 + 0.12 * np.sin(
        3.0 * portable_math.arctan2(direction[:, 1:2], direction[:, :1]) + 4.0 * direction[:, 2:]
    )
    centre = direction * depth * lumps
    if tree.taper:
        height = np.sqrt(rng.uniform(0.0, 1.0, (count, 1)))  # more clusters low down, where a cone is wide
        angle = rng.uniform(0.0, 2 * np.pi, (count, 1))
        spread = depth * (0.05 + tree.taper * 0.95 * height)
        centre = np.concatenate([spread * np.cos(angle), spread * np.sin(angle), 1.0 - 2.0 * height], axis=1)
    scale = [tree.crown_radius_m, tree.crown_radius_m, tree.crown_half_height_m]
    facets = _facets(centre * scale, rng.uniform(*tree.cluster_m, (count, 1)), rng)
    return quads(facets + np.array([0.0, 0.0, tree.crown_centre_m]))


def _facets(
    centre: NDArray[np.float64], size_m: NDArray[np.float64], rng: np.random.Generator
) -> NDArray[np.float64]:
    """Return skewed squares (N, 4, 3) about `centre` (N, 3), tilted at random, facing outwards."""
    outward = centre / (np.linalg.norm(centre, axis=1, keepdims=True) + 1e-9)
    normal = rng.normal(size=centre.shape) + 0.6 * outward
    normal *= np.where((normal * centre).sum(axis=1, keepdims=True) < 0, -1.0, 1.0)
    normal /= np.linalg.norm(normal, axis=1, keepdims=True)
    across = np.cross(normal, rng.normal(size=centre.shape))
    across /= np.linalg.norm(across, axis=1, keepdims=True)
    along = np.cross(normal, across)
    aspect = rng.uniform(0.6, 1.0, size_m.shape)
    a, b = 0.5 * size_m * across, 0.5 * size_m * aspect * along
    return centre[:, None] + np.stack([-a - b, a - 0.6 * b, a + b, 0.6 * b - a], axis=1)


_HEDGE_SECTION = np.array(
    [[0.5, 0.0], [0.52, 0.45], [0.5, 0.85], [0.3, 1.0], [-0.3, 1.0], [-0.5, 0.85], [-0.52, 0.45], [-0.5, 0.0]]
)
"""Outline of a hedge from its left foot over the top to its right: shares of thickness and height."""


def hedge(
    polyline: NDArray[np.float64],
    *,
    height_m: float,
    thickness_m: float,
    rng: np.random.Generator,
    step_m: float = 0.6,
) -> Mesh:
    """Make a trimmed hedge with uneven facets.

    Args:
        polyline: Line along which it stands (P, 2) [m], on z = 0.
        height_m: Height [m].
        thickness_m: Thickness [m].
        rng: Random generator.
        step_m: Spacing of the cross-sections [m]; their points deviate up to 0.08 m from a smooth surface.

    Returns:
        The mesh.
    """
    middle, left = _walk(np.asarray(polyline, dtype=np.float64), step_m)
    side, high = thickness_m * _HEDGE_SECTION[:, 0], height_m * _HEDGE_SECTION[:, 1]
    shape = (len(middle), len(side))
    aside = side + rng.uniform(-0.08, 0.08, shape)
    raised = np.where(high > 0, high + rng.uniform(-0.06, 0.04, shape), 0.0)
    points = middle[:, None, :] + aside[..., None] * left[:, None, :]
    points += rng.uniform(-0.1, 0.1, (*shape, 1)) * (left[:, None, ::-1] * [1.0, -1.0])
    skin = np.concatenate([points, raised[..., None]], axis=2)
    row = np.arange(shape[0] - 1)[:, None] * shape[1] + np.arange(shape[1] - 1)
    corners = np.stack([row, row + shape[1], row + shape[1] + 1, row + 1], axis=-1).reshape(-1, 4)[:, ::-1]
    fan = np.stack([np.zeros(6, int), np.arange(1, 7), np.arange(2, 8)], axis=1)
    ends = [fan[:, ::-1], fan + (shape[0] - 1) * shape[1]]
    return mesh(skin.reshape(-1, 3), np.concatenate([corners[:, :3], corners[:, [0, 2, 3]], *ends]))


def _walk(polyline: NDArray[np.float64], step_m: float) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Return points (K, 2) along a polyline, corners kept, and unit vectors (K, 2) to their left."""
    step = np.diff(polyline, axis=0)
    length = np.hypot(step[:, 0], step[:, 1])
    at = np.r_[0.0, np.cumsum(length)]
    pieces = [
        np.linspace(a, b, max(2, int(np.ceil((b - a) / step_m)) + 1))[:-1] for a, b in pairwise(at.tolist())
    ]
    place = np.r_[np.concatenate(pieces), at[-1]]
    points = np.stack([np.interp(place, at, polyline[:, axis]) for axis in (0, 1)], axis=1)
    forward = np.gradient(points, axis=0)
    forward /= np.linalg.norm(forward, axis=1, keepdims=True)
    return points, forward[:, ::-1] * [-1.0, 1.0]
