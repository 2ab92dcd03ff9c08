"""Finds stationary obstacles: the low triangles of a scene, and the boxes that overlap them.

Ground, road, kerb and pavement are no obstacles, nor is anything higher than 2.5 m.
Boxes and triangles are tested by separating axes (Gottschalk et al., OBBTree, SIGGRAPH 1996, in the plane).
"""

import numpy as np
import shapely
from numpy.typing import NDArray

from echoscape.scenes.core.scene import CLASSES, Mesh, Scene

OVERHEAD_M = 2.5

_UNDERFOOT = ("none", "ground", "road", "pavement", "kerb")
_CELL_M = 8.0
_STEP_M = 0.02


class Obstacles:
    """The low triangles of a scene near given places.

    corner_m (T, 3, 2) in the plane; low_m, high_m (T,) above the ground; instance (T,) of each.
    """

    def __init__(self, scene: Scene, *, near: NDArray[np.float64]) -> None:
        """Collect the triangles within about 8 m of the places `near` (N, 2) [m]."""
        cells = _Cells(near)
        kept = [_kept(corner, who, scene, cells) for corner, who in (*_made(scene), *_placed(scene, cells))]
        corner = np.concatenate([np.zeros((0, 3, 3)), *(corner for corner, _ in kept)])
        self.instance = np.concatenate([np.zeros(0, np.uint32), *(who for _, who in kept)])
        self.corner_m = corner[..., :2]
        self.low_m, self.high_m = corner[..., 2].min(axis=1), corner[..., 2].max(axis=1)
        low, high = self.corner_m.min(axis=1), self.corner_m.max(axis=1)
        self._tree = shapely.STRtree(shapely.box(*low.T, *high.T))

    def touched(
        self, pose: NDArray[np.float64], extent_m: tuple[float, float, float], *, shrink_m: float = 0.02
    ) -> NDArray[np.uint32]:
        """Return (N,) which object a box of `extent_m` at `pose` (N, 4) x, y, z, yaw overlaps, 0 if none.

        The box is taken `shrink_m` [m] smaller on every side.
        """
        half = np.array(extent_m[:2]) / 2 - shrink_m
        cos, sin = np.abs(np.cos(pose[:, 3])), np.abs(np.sin(pose[:, 3]))
        reach = np.stack([half[0] * cos + half[1] * sin, half[0] * sin + half[1] * cos], axis=-1)
        row, triangle = self._tree.query(shapely.box(*(pose[:, :2] - reach).T, *(pose[:, :2] + reach).T))
        level = self.low_m[triangle] < pose[row, 2] + extent_m[2]
        level &= self.high_m[triangle] > pose[row, 2] + _STEP_M
        row, triangle = row[level], triangle[level]
        overlap = triangle_overlaps_box(_seen_from(pose[row], self.corner_m[triangle]), half)
        found = np.zeros(len(pose), dtype=np.uint32)
        found[row[overlap]] = self.instance[triangle[overlap]]
        return found


class _Cells:
    """Square cells of the plane, marked where a place is in them or in a neighbour."""

    def __init__(self, places: NDArray[np.float64]) -> None:
        self._low = places.min(axis=0) - 2 * _CELL_M
        shape = np.ceil((places.max(axis=0) + 2 * _CELL_M - self._low) / _CELL_M).astype(int) + 1
        self._marked = np.zeros(tuple(shape), dtype=bool)
        at = ((places - self._low) / _CELL_M).astype(int)
        for x in (-1, 0, 1):
            for y in (-1, 0, 1):
                self._marked[at[:, 0] + x, at[:, 1] + y] = True

    def hold(self, low: NDArray[np.float64], high: NDArray[np.float64]) -> NDArray[np.bool_]:
        """Tell (N,) which rectangles from `low` to `high` (N, 2) have an end, or their middle, in a cell."""
        inside = np.zeros(len(low), dtype=bool)
        for place in (low, (low + high) / 2, high):
            at = np.floor((place - self._low) / _CELL_M).astype(int)
            within = ((at >= 0) & (at < self._marked.shape)).all(axis=1)
            inside[within] |= self._marked[at[within, 0], at[within, 1]]
        return inside | ((high - low).max(axis=1, initial=0.0) > 2 * _CELL_M)


def _kept(
    corner: NDArray[np.float64], instance: NDArray[np.uint32], scene: Scene, cells: _Cells
) -> tuple[NDArray[np.float64], NDArray[np.uint32]]:
    """Return the triangles (T, 3, 3) that are low, near and not ground, and their instance ids."""
    underfoot = np.isin(scene.instance_class, [CLASSES.index(name) for name in _UNDERFOOT])
    keep = (corner[..., 2].min(axis=1) < OVERHEAD_M) & ~underfoot[instance]
    corner, instance = corner[keep], instance[keep]
    near = cells.hold(corner[..., :2].min(axis=1), corner[..., :2].max(axis=1))
    return corner[near], instance[near]


def _made(scene: Scene) -> list[tuple[NDArray[np.float64], NDArray[np.uint32]]]:
    return [(_corners(mesh), mesh.instance) for mesh in scene.static.values()]


def _corners(mesh: Mesh) -> NDArray[np.float64]:
    return mesh.vertices.astype(np.float64)[mesh.faces]


def _placed(scene: Scene, cells: _Cells) -> list[tuple[NDArray[np.float64], NDArray[np.uint32]]]:
    """Return the triangles of all placements, prototype by prototype."""
    placed, found = scene.placements, []
    for number, prototype in enumerate(scene.prototypes):
        reach = np.hypot(*prototype.extent_m[:2]) / 2 * placed.scale[:, None]
        flat = placed.position[:, :2]
        rows = np.flatnonzero((placed.prototype == number) & cells.hold(flat - reach, flat + reach))
        shape = np.concatenate([_corners(part) for part in prototype.parts.values()])
        shape = shape[shape[..., 2].min(axis=1) < 2 * OVERHEAD_M]
        cos, sin = (placed.scale[rows] * wave(placed.yaw[rows]) for wave in (np.cos, np.sin))
        cos, sin, scale = (value[:, None, None] for value in (cos, sin, placed.scale[rows]))
        x, y, z = shape[..., 0], shape[..., 1], shape[..., 2]
        corner = np.stack([cos * x - sin * y, sin * x + cos * y, scale * z], axis=-1)
        corner += placed.position[rows, None, None]
        found.append((corner.reshape(-1, 3, 3), np.repeat(placed.instance[rows], len(shape))))
    return found


def _seen_from(pose: NDArray[np.float64], corner: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return `corner` (K, 3, 2) in the frames of `pose` (K, 4)."""
    cos, sin = np.cos(pose[:, None, 3]), np.sin(pose[:, None, 3])
    x, y = np.moveaxis(corner - pose[:, None, :2], -1, 0)
    return np.stack([cos * x + sin * y, cos * y - sin * x], axis=-1)


def triangle_overlaps_box(corner: NDArray[np.float64], half: NDArray[np.float64]) -> NDArray[np.bool_]:
    """Return (K,) whether triangles (K, 3, 2) overlap the box from -`half` to `half` (2,) about the origin.

    A triangle seen edge on counts as the line that it is.
    """
    apart = ((corner.min(axis=1) > half) | (corner.max(axis=1) < -half)).any(axis=-1)
    edge = np.roll(corner, -1, axis=1) - corner
    normal = np.stack([-edge[..., 1], edge[..., 0]], axis=-1)  # (K, 3, 2)
    along = np.einsum("kec,kpc->kep", normal, corner)
    reach = (np.abs(normal) * half).sum(axis=-1)
    apart |= ((along.min(axis=-1) > reach) | (along.max(axis=-1) < -reach)).any(axis=-1)
    return ~apart
