"""Checks that a drive is free of collisions: the car's box, swept along the drive, against triangles.

Triangles are clipped to the heights between the ground clearance of the car and its antenna; the rest,
projected to the ground, must not meet the outline of the car at any of its poses.
"""

from dataclasses import dataclass

import numpy as np
import shapely
from numpy.typing import NDArray

from echoscape.scenes.core.scene import Scene
from echoscape.scenes.core.trajectory import Trajectory
from echoscape.scenes.driving.ego_drive import EGO_EXTENT_M

GROUND_CLEARANCE_M = 0.3
"""Lower parts, such as kerbs, ramps and the ground, are driven over [m]."""

HEADROOM_M = 0.2
"""Least clearance above the antenna [m]."""

_STEP_M = 0.1
_TURN_RAD = 0.05
_STEP_S = 0.02


@dataclass(frozen=True, kw_only=True)
class Collision:
    """The first collision of a drive.

    Attributes:
        instance: Instance id of the object that is hit.
        time_s: Time of the collision [s].
        position_m: Position x, y of the car at that time [m].
    """

    instance: int
    time_s: float
    position_m: tuple[float, float]


def first_collision(
    scene: Scene, track: Trajectory, *, until_s: float, height_m: float, first_instance: int = 1
) -> Collision | None:
    """Find the first object that the car hits.

    Placed prototypes are not tested, since streets are laid out clear of them.

    Args:
        scene: The scene.
        track: Trajectory of the car.
        until_s: End of the time that is tested, which starts at 0 [s].
        height_m: Height of the antenna above the ground [m].
        first_instance: Lowest instance id that is tested.

    Returns:
        The first collision, None if there is none.
    """
    times, poses = _places(track, until_s)
    heights = (float(poses[0, 2]) + GROUND_CLEARANCE_M, float(poses[0, 2]) + height_m + HEADROOM_M)
    reach = np.hypot(*EGO_EXTENT_M[:2]) / 2
    window = np.array([poses[:, :2].min(axis=0) - reach, poses[:, :2].max(axis=0) + reach])
    corners, instances = _triangles(scene, first_instance)
    around = _enclosing(corners, instances, poses[0, :3] + [0.0, 0.0, sum(heights) / 2 - float(poses[0, 2])])
    if around is not None:
        return Collision(instance=around, time_s=0.0, position_m=(float(poses[0, 0]), float(poses[0, 1])))
    near = _overlapping(corners, window, heights)
    if not near.any():
        return None
    shapes = _cut(corners[near], heights)
    poses_hit, objects = shapely.STRtree(shapes).query(_outlines(poses), predicate="intersects")
    if len(poses_hit) == 0:
        return None
    first = int(poses_hit.argmin())
    x, y = (float(value) for value in poses[poses_hit[first], :2])
    return Collision(
        instance=int(instances[near][objects[first]]),
        time_s=float(times[poses_hit[first]]),
        position_m=(x, y),
    )


def _places(track: Trajectory, until_s: float) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Return times (P,) and poses (P, 4), one each time that the car has moved or turned a little."""
    times = np.linspace(0.0, until_s, max(int(np.ceil(until_s / _STEP_S)), 1) + 1)
    poses = track.pose(times)
    moved = np.hypot(*np.diff(poses[:, :2], axis=0).T) / _STEP_M
    stretch = np.append(0.0, np.cumsum(moved + np.abs(np.diff(poses[:, 3])) / _TURN_RAD))
    wanted = np.arange(0.0, stretch[-1] + 1.0)
    at = np.unique(np.interp(wanted, stretch, times))
    return at, track.pose(at)


def _outlines(poses: NDArray[np.float64]) -> NDArray[np.object_]:
    """Return the outlines of the car (P,) seen from above."""
    length, width, _ = EGO_EXTENT_M
    unit = np.array([[0.5, 0.5], [-0.5, 0.5], [-0.5, -0.5], [0.5, -0.5]]) * (length, width)
    cos, sin = np.cos(poses[:, 3, None]), np.sin(poses[:, 3, None])
    x = poses[:, 0, None] + cos * unit[:, 0] - sin * unit[:, 1]
    y = poses[:, 1, None] + sin * unit[:, 0] + cos * unit[:, 1]
    return np.asarray(shapely.polygons(np.stack([x, y], axis=-1)))


def _triangles(scene: Scene, first_instance: int) -> tuple[NDArray[np.float64], NDArray[np.uint32]]:
    """Return triangles (T, 3, 3) [m] and instance ids (T,) of objects with ids from `first_instance` on."""
    corners, instances = [np.zeros((0, 3, 3))], [np.zeros(0, np.uint32)]
    for mesh in scene.static.values():
        chosen = mesh.instance >= first_instance
        corners.append(mesh.vertices[mesh.faces[chosen]].astype(np.float64))
        instances.append(mesh.instance[chosen])
    for placed in scene.targets:
        # Point targets have no mesh.
        if placed.target.kind == "point" and placed.instance >= first_instance:
            corners.append(np.tile(np.array(placed.target.position_m), (1, 3, 1)))
            instances.append(np.array([placed.instance], np.uint32))
    return np.concatenate(corners), np.concatenate(instances)


def _enclosing(
    corners: NDArray[np.float64], instances: NDArray[np.uint32], place: NDArray[np.float64]
) -> int | None:
    """Return the instance id of a closed body that contains `place` (3,) [m], None if there is none.

    A ray from inside leaves a closed body through an odd number of its triangles (Moller & Trumbore, Journal
    of Graphics Tools 2(1), 1997); three rays must agree.
    """
    inside = np.full(int(instances.max(initial=0)) + 1, True)
    first, second = corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0]
    offset = place - corners[:, 0]
    across = np.cross(offset, first)
    for direction in np.array([[0.013, 0.017, 1.0], [1.0, 0.011, 0.019], [0.023, -1.0, 0.007]]):
        normal = np.cross(direction, second)
        scale = np.einsum("tk,tk->t", first, normal)
        with np.errstate(divide="ignore", invalid="ignore"):
            u, v = np.einsum("tk,tk->t", offset, normal) / scale, across @ direction / scale
            distance = np.einsum("tk,tk->t", second, across) / scale
        hit = (u >= 0) & (v >= 0) & (u + v <= 1) & (distance > 0)
        inside &= np.bincount(instances[hit], minlength=len(inside)) % 2 == 1
    found = np.flatnonzero(inside)
    return int(found[0]) if len(found) else None


def _overlapping(
    corners: NDArray[np.float64], window: NDArray[np.float64], heights: tuple[float, float]
) -> NDArray[np.bool_]:
    """Return which triangles (T, 3, 3) may reach into the window (2, 2) between the heights."""
    low, high = corners.min(axis=1), corners.max(axis=1)
    beside = (high[:, :2] < window[0]) | (low[:, :2] > window[1])
    return ~beside.any(axis=1) & (high[:, 2] > heights[0]) & (low[:, 2] < heights[1])


def _cut(corners: NDArray[np.float64], heights: tuple[float, float]) -> NDArray[np.object_]:
    """Clip triangles (T, 3, 3) to the range of heights and return what is left, seen from above (T,).

    It is the convex hull of the corners within the range and of the points where edges cross its limits.
    """
    points, inside = [corners], [(corners[:, :, 2] >= heights[0]) & (corners[:, :, 2] <= heights[1])]
    after = np.roll(corners, -1, axis=1)
    rise = after[:, :, 2] - corners[:, :, 2]
    for height in heights:
        share = np.divide(height - corners[:, :, 2], rise, out=np.full_like(rise, -1.0), where=rise != 0)
        points.append(corners + np.clip(share, 0, 1)[:, :, None] * (after - corners))
        inside.append((share >= 0) & (share <= 1))
    every, valid = np.concatenate(points, axis=1)[:, :, :2], np.concatenate(inside, axis=1)
    # Points outside the range are moved onto one inside it, so that all triangles have equally many.
    some = np.take_along_axis(every, valid.argmax(axis=1)[:, None, None], axis=1)
    return np.asarray(shapely.convex_hull(shapely.multipoints(np.where(valid[:, :, None], every, some))))
