"""Whether a drive stays clear of what stands: the car's box, swept along it, against the triangles.

Triangles are cut to the heights between the car's ground clearance and its antenna; what is left, seen from
above, must not meet the car's outline at any of its places.
"""

from dataclasses import dataclass

import numpy as np
import shapely
from numpy.typing import NDArray

from echoscape.scenes.core.scene import Scene
from echoscape.scenes.core.trajectory import Trajectory
from echoscape.scenes.driving.ego_drive import EGO_EXTENT_M

GROUND_CLEARANCE_M = 0.3
"""What is lower is driven over: kerbs, ramps, the ground itself."""

HEADROOM_M = 0.2
"""Nothing comes nearer to the antenna from above."""

_STEP_M = 0.1
_TURN_RAD = 0.05
_STEP_S = 0.02


@dataclass(frozen=True, kw_only=True)
class Contact:
    """The first thing that the car meets: its instance id, the time [s], the car's x, y [m]."""

    instance: int
    time_s: float
    place_m: tuple[float, float]


def first_contact(
    town: Scene, track: Trajectory, *, until_s: float, height_m: float, since: int = 1
) -> Contact | None:
    """Return what the car on `track` meets first before `until_s`, or None if its way is clear.

    `height_m` is that of the antenna above the ground; only instances from the id `since` on count. Placed
    prototypes are not looked at: streets are laid clear of them.
    """
    times, poses = _places(track, until_s)
    heights = (float(poses[0, 2]) + GROUND_CLEARANCE_M, float(poses[0, 2]) + height_m + HEADROOM_M)
    reach = np.hypot(*EGO_EXTENT_M[:2]) / 2
    window = np.array([poses[:, :2].min(axis=0) - reach, poses[:, :2].max(axis=0) + reach])
    corners, instances = _standing(town, since)
    around = _enclosing(corners, instances, poses[0, :3] + [0.0, 0.0, sum(heights) / 2 - float(poses[0, 2])])
    if around is not None:
        return Contact(instance=around, time_s=0.0, place_m=(float(poses[0, 0]), float(poses[0, 1])))
    near = _overlapping(corners, window, heights)
    if not near.any():
        return None
    shapes = _cut(corners[near], heights)
    cars, things = shapely.STRtree(shapes).query(_outlines(poses), predicate="intersects")
    if len(cars) == 0:
        return None
    first = int(cars.argmin())
    x, y = (float(value) for value in poses[cars[first], :2])
    return Contact(
        instance=int(instances[near][things[first]]), time_s=float(times[cars[first]]), place_m=(x, y)
    )


def _places(track: Trajectory, until_s: float) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Return times (P,) and poses (P, 4) at which the car has moved or turned a little."""
    times = np.linspace(0.0, until_s, max(int(np.ceil(until_s / _STEP_S)), 1) + 1)
    poses = track.pose(times)
    moved = np.hypot(*np.diff(poses[:, :2], axis=0).T) / _STEP_M
    stretch = np.append(0.0, np.cumsum(moved + np.abs(np.diff(poses[:, 3])) / _TURN_RAD))
    wanted = np.arange(0.0, stretch[-1] + 1.0)
    at = np.unique(np.interp(wanted, stretch, times))
    return at, track.pose(at)


def _outlines(poses: NDArray[np.float64]) -> NDArray[np.object_]:
    """Return the car's outlines (P,) seen from above."""
    length, width, _ = EGO_EXTENT_M
    unit = np.array([[0.5, 0.5], [-0.5, 0.5], [-0.5, -0.5], [0.5, -0.5]]) * (length, width)
    cos, sin = np.cos(poses[:, 3, None]), np.sin(poses[:, 3, None])
    x = poses[:, 0, None] + cos * unit[:, 0] - sin * unit[:, 1]
    y = poses[:, 1, None] + sin * unit[:, 0] + cos * unit[:, 1]
    return np.asarray(shapely.polygons(np.stack([x, y], axis=-1)))


def _standing(town: Scene, since: int) -> tuple[NDArray[np.float64], NDArray[np.uint32]]:
    """Return the triangles (T, 3, 3) [m] and instances (T,) of what has an id of `since` or more."""
    corners, instances = [np.zeros((0, 3, 3))], [np.zeros(0, np.uint32)]
    for mesh in town.static.values():
        chosen = mesh.instance >= since
        corners.append(mesh.vertices[mesh.faces[chosen]].astype(np.float64))
        instances.append(mesh.instance[chosen])
    for placed in town.targets:
        if placed.target.kind == "point" and placed.instance >= since:  # which has no mesh
            corners.append(np.tile(np.array(placed.target.position_m), (1, 3, 1)))
            instances.append(np.array([placed.instance], np.uint32))
    return np.concatenate(corners), np.concatenate(instances)


def _enclosing(
    corners: NDArray[np.float64], instances: NDArray[np.uint32], place: NDArray[np.float64]
) -> int | None:
    """Return the instance of a closed body that `place` (3,) [m] is inside of, None if there is none.

    Three rays each leave such a body through an odd number of its triangles (Moller & Trumbore, Journal of
    Graphics Tools 2(1), 1997, for each).
    """
    inside = np.full(int(instances.max(initial=0)) + 1, True)
    first, second = corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0]
    offset = place - corners[:, 0]
    across = np.cross(offset, first)
    for way in np.array([[0.013, 0.017, 1.0], [1.0, 0.011, 0.019], [0.023, -1.0, 0.007]]):
        normal = np.cross(way, second)
        scale = np.einsum("tk,tk->t", first, normal)
        with np.errstate(divide="ignore", invalid="ignore"):
            u, v = np.einsum("tk,tk->t", offset, normal) / scale, across @ way / scale
            distance = np.einsum("tk,tk->t", second, across) / scale
        met = (u >= 0) & (v >= 0) & (u + v <= 1) & (distance > 0)
        inside &= np.bincount(instances[met], minlength=len(inside)) % 2 == 1
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
    """Return what is between the heights of triangles (T, 3, 3) that reach there, seen from above (T,).

    That is the hull of the corners between the heights and of where the sides cross either of them.
    """
    points, inside = [corners], [(corners[:, :, 2] >= heights[0]) & (corners[:, :, 2] <= heights[1])]
    after = np.roll(corners, -1, axis=1)
    rise = after[:, :, 2] - corners[:, :, 2]
    for height in heights:
        share = np.divide(height - corners[:, :, 2], rise, out=np.full_like(rise, -1.0), where=rise != 0)
        points.append(corners + np.clip(share, 0, 1)[:, :, None] * (after - corners))
        inside.append((share >= 0) & (share <= 1))
    every, valid = np.concatenate(points, axis=1)[:, :, :2], np.concatenate(inside, axis=1)
    # Points that do not count are moved onto one that does, so that all triangles have as many.
    some = np.take_along_axis(every, valid.argmax(axis=1)[:, None, None], axis=1)
    return np.asarray(shapely.convex_hull(shapely.multipoints(np.where(valid[:, :, None], every, some))))
