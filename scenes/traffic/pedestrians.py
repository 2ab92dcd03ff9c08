"""People on the pavements: round their block, or up and down their walking line, over and over.

All on one line keep one pace and keep to the right, so that they pass one another and never run into one
another. The strip that they walk in is kept free of everything that stands.
"""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.interpolate import CubicSpline
from scipy.ndimage import gaussian_filter1d

from echoscape.scenes.core.trajectory import Trajectory
from echoscape.scenes.driving.lane_path import smoothed_line
from echoscape.scenes.roads.ground_mesh import ASIDE_M

PACE_MPS = (0.8, 1.8)
PAVEMENT_M = 0.12

_STEP_M = 0.1
_KNOT_S = 0.25
_SHORTEST_M = 4.0
_CLOSED_M = 1.0
_CORNER_M = 0.5
_APART_M = 2.0


@dataclass(frozen=True, kw_only=True)
class Round:
    """A closed way along a walking line and back: `arc_m` (S,), `xy` (S, 2) [m], ending where it begins."""

    arc_m: NDArray[np.float64]
    xy: NDArray[np.float64]


def walking_rounds(walk: NDArray[np.float64], *, aside_m: float = ASIDE_M) -> list[Round]:
    """Return the ways along `walk` (P, 2) [m], `aside_m` to the right of it in either direction.

    A closed line, as round a block, has two, clockwise and back; an open one has one, up and down.
    """
    arc = np.concatenate([[0.0], np.cumsum(np.hypot(*np.diff(walk, axis=0).T))])
    closed = bool(np.hypot(*(walk[-1] - walk[0])) < _CLOSED_M)
    spare = 0.0 if closed else aside_m  # room to turn round in
    at = np.linspace(spare, arc[-1] - spare, max(int(arc[-1] / _STEP_M), 4))
    line = np.stack([np.interp(at, arc, walk[:, axis]) for axis in (0, 1)], axis=-1)
    sigma = _CORNER_M / (at[1] - at[0])
    if not closed:
        return [_up_and_down(smoothed_line(line, sigma=sigma), aside_m)]
    ring = gaussian_filter1d(line[:-1], sigma, axis=0, mode="wrap")
    return [_round(_beside(way, aside_m)) for way in (ring, ring[::-1])]


def _beside(ring: NDArray[np.float64], aside_m: float) -> NDArray[np.float64]:
    ahead = np.roll(ring, -1, axis=0) - np.roll(ring, 1, axis=0)
    ahead /= np.linalg.norm(ahead, axis=-1)[:, None]
    return ring + aside_m * np.stack([ahead[:, 1], -ahead[:, 0]], axis=-1)


def _up_and_down(line: NDArray[np.float64], aside_m: float) -> Round:
    tangent = np.gradient(line, axis=0)
    tangent /= np.linalg.norm(tangent, axis=-1)[:, None]
    right = aside_m * np.stack([tangent[:, 1], -tangent[:, 0]], axis=-1)
    angle = np.linspace(0, np.pi, 12)[1:-1, None]
    last = line[-1] + np.cos(angle) * right[-1] + aside_m * np.sin(angle) * tangent[-1]
    first = line[0] - np.cos(angle) * right[0] - aside_m * np.sin(angle) * tangent[0]
    return _round(np.concatenate([line + right, last, (line - right)[::-1], first]))


def _round(open_line: NDArray[np.float64]) -> Round:
    closed = np.concatenate([open_line, open_line[:1]])
    return Round(arc_m=np.concatenate([[0.0], np.cumsum(np.hypot(*np.diff(closed, axis=0).T))]), xy=closed)


def pedestrian_track(way: Round, *, start_m: float, pace_mps: float, duration_s: float) -> Trajectory:
    """Return the walk that begins `start_m` into `way` and goes on at `pace_mps` for `duration_s`."""
    count = max(int(np.ceil(duration_s / _KNOT_S)), 1)
    time = np.linspace(0.0, duration_s, count + 1)
    spline = CubicSpline(way.arc_m, way.xy, bc_type="periodic")
    around = way.arc_m[-1]
    at = start_m + pace_mps * time
    xy, tangent, bend = (spline(at % around, nu=order) for order in (0, 1, 2))
    yaw = np.unwrap(np.arctan2(tangent[:, 1], tangent[:, 0]))  # a knot turns by 1.1 rad at most
    yaw_rate = (tangent[:, 0] * bend[:, 1] - tangent[:, 1] * bend[:, 0]) / np.sum(tangent**2, axis=-1)
    height = np.full_like(time, PAVEMENT_M)
    state = np.stack([*xy.T, height, yaw], axis=-1)
    rate = pace_mps * np.stack([*tangent.T, np.zeros_like(time), yaw_rate], axis=-1)
    return Trajectory(time_s=time, state=state, rate=rate)


def pedestrian_tracks(
    walks: tuple[NDArray[np.float64], ...], count: int, *, duration_s: float, rng: np.random.Generator
) -> list[Trajectory]:
    """Return up to `count` walks of `duration_s` [s], spread over `walks` by their lengths."""
    long = [walk for walk in walks if np.hypot(*np.diff(walk, axis=0).T).sum() > _SHORTEST_M]
    rounds = [way for walk in long for way in walking_rounds(walk)]
    if not rounds:
        return []
    length = np.array([way.arc_m[-1] for way in rounds])
    pace = rng.uniform(*PACE_MPS, size=len(rounds))
    taken: dict[int, list[float]] = {}
    tracks = []
    for place in rng.choice(len(rounds), size=count, p=length / length.sum()):
        start = float(rng.uniform(0, length[place]))
        others = taken.setdefault(int(place), [])
        if any(
            abs((start - other + length[place] / 2) % length[place] - length[place] / 2) < _APART_M
            for other in others
        ):
            continue
        others.append(start)
        tracks.append(
            pedestrian_track(rounds[place], start_m=start, pace_mps=float(pace[place]), duration_s=duration_s)
        )
    return tracks
