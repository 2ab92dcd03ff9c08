"""Pedestrians on the pavements, who walk around their block or up and down their footpath.

All on one footpath walk at the same pace and keep to the right, so they never collide. The strip that they
sweep is kept free of obstacles.
"""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.interpolate import CubicSpline

from echoscape.scenes.core.gaussian import gaussian_filter1d
from echoscape.scenes.core.headings import unwrapped_headings
from echoscape.scenes.core.trajectory import Trajectory
from echoscape.scenes.driving.lane_path import smoothed_line
from echoscape.scenes.roads.ground_mesh import WALKING_OFFSET_M

PACE_MPS = (0.8, 1.8)
PAVEMENT_M = 0.12

_STEP_M = 0.1
_KNOT_S = 0.25
_SHORTEST_M = 4.0
_CLOSED_M = 1.0
_CORNER_M = 0.5
_APART_M = 2.0


@dataclass(frozen=True, kw_only=True)
class WalkingLoop:
    """A closed path along a footpath and back.

    Attributes:
        arc_m: Arc length at each point (S,) [m].
        xy: Points (S, 2) [m]; the last equals the first.
    """

    arc_m: NDArray[np.float64]
    xy: NDArray[np.float64]


def walking_loops(path: NDArray[np.float64], *, aside_m: float = WALKING_OFFSET_M) -> list[WalkingLoop]:
    """Return the paths of pedestrians along a footpath, on its right-hand side in each direction.

    Args:
        path: The footpath (P, 2) [m].
        aside_m: Lateral distance from it [m].

    Returns:
        Two loops for a closed footpath, one per direction; one loop, up and down, for an open one.
    """
    arc = np.concatenate([[0.0], np.cumsum(np.hypot(*np.diff(path, axis=0).T))])
    closed = bool(np.hypot(*(path[-1] - path[0])) < _CLOSED_M)
    spare = 0.0 if closed else aside_m  # space for the half circles at the ends
    at = np.linspace(spare, arc[-1] - spare, max(int(arc[-1] / _STEP_M), 4))
    line = np.stack([np.interp(at, arc, path[:, axis]) for axis in (0, 1)], axis=-1)
    sigma = _CORNER_M / (at[1] - at[0])
    if not closed:
        return [_up_and_down(smoothed_line(line, sigma=sigma), aside_m)]
    ring = gaussian_filter1d(line[:-1], sigma, axis=0, mode="wrap")
    return [_closed_loop(_beside(side, aside_m)) for side in (ring, ring[::-1])]


def _beside(ring: NDArray[np.float64], aside_m: float) -> NDArray[np.float64]:
    """Return the closed line `aside_m` to the right of `ring` (P, 2)."""
    ahead = np.roll(ring, -1, axis=0) - np.roll(ring, 1, axis=0)
    ahead /= np.linalg.norm(ahead, axis=-1)[:, None]
    return ring + aside_m * np.stack([ahead[:, 1], -ahead[:, 0]], axis=-1)


def _up_and_down(line: NDArray[np.float64], aside_m: float) -> WalkingLoop:
    """Return the loop along an open line and back, with half circles at its ends."""
    tangent = np.gradient(line, axis=0)
    tangent /= np.linalg.norm(tangent, axis=-1)[:, None]
    right = aside_m * np.stack([tangent[:, 1], -tangent[:, 0]], axis=-1)
    angle = np.linspace(0, np.pi, 12)[1:-1, None]
    last = line[-1] + np.cos(angle) * right[-1] + aside_m * np.sin(angle) * tangent[-1]
    first = line[0] - np.cos(angle) * right[0] - aside_m * np.sin(angle) * tangent[0]
    return _closed_loop(np.concatenate([line + right, last, (line - right)[::-1], first]))


def _closed_loop(open_line: NDArray[np.float64]) -> WalkingLoop:
    """Close a line."""
    closed = np.concatenate([open_line, open_line[:1]])
    return WalkingLoop(
        arc_m=np.concatenate([[0.0], np.cumsum(np.hypot(*np.diff(closed, axis=0).T))]), xy=closed
    )


def pedestrian_track(loop: WalkingLoop, *, start_m: float, pace_mps: float, duration_s: float) -> Trajectory:
    """Return the trajectory of a pedestrian.

    Args:
        loop: Path of the pedestrian.
        start_m: Distance along it at time 0 [m].
        pace_mps: Speed [m/s].
        duration_s: Duration [s].

    Returns:
        The trajectory.
    """
    count = max(int(np.ceil(duration_s / _KNOT_S)), 1)
    time = np.linspace(0.0, duration_s, count + 1)
    spline = CubicSpline(loop.arc_m, loop.xy, bc_type="periodic")
    around = loop.arc_m[-1]
    at = start_m + pace_mps * time
    xy, tangent, bend = (spline(at % around, nu=order) for order in (0, 1, 2))
    # Between knots the heading changes by 1.1 rad at most, so it can be unwrapped.
    yaw = unwrapped_headings(tangent)
    yaw_rate = (tangent[:, 0] * bend[:, 1] - tangent[:, 1] * bend[:, 0]) / np.sum(tangent**2, axis=-1)
    height = np.full_like(time, PAVEMENT_M)
    state = np.stack([*xy.T, height, yaw], axis=-1)
    rate = pace_mps * np.stack([*tangent.T, np.zeros_like(time), yaw_rate], axis=-1)
    return Trajectory(time_s=time, state=state, rate=rate)


def pedestrian_tracks(
    footpaths: tuple[NDArray[np.float64], ...], count: int, *, duration_s: float, rng: np.random.Generator
) -> list[Trajectory]:
    """Draw pedestrians, distributed over footpaths by length.

    Args:
        footpaths: Footpaths (P, 2) [m].
        count: Largest number of pedestrians; those who would start within 2 m of another are left out.
        duration_s: Duration [s].
        rng: Random generator.

    Returns:
        Their trajectories.
    """
    long = [path for path in footpaths if np.hypot(*np.diff(path, axis=0).T).sum() > _SHORTEST_M]
    loops = [loop for path in long for loop in walking_loops(path)]
    if not loops:
        return []
    length = np.array([loop.arc_m[-1] for loop in loops])
    pace = rng.uniform(*PACE_MPS, size=len(loops))
    starts: dict[int, list[float]] = {}
    tracks = []
    for place in rng.choice(len(loops), size=count, p=length / length.sum()):
        start = float(rng.uniform(0, length[place]))
        others = starts.setdefault(int(place), [])
        if any(
            abs((start - other + length[place] / 2) % length[place] - length[place] / 2) < _APART_M
            for other in others
        ):
            continue
        others.append(start)
        tracks.append(
            pedestrian_track(loops[place], start_m=start, pace_mps=float(pace[place]), duration_s=duration_s)
        )
    return tracks
