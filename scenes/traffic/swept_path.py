"""Finds the lanes that long vehicles can take, from their swept path in bends, the lane widths and the kerbs.

With both axles on the line, half a chord before and behind, the centre of a body is inside the line by half
the integral of curvature times distance to the nearer axle; a bend of radius R gives (L / 2)^2 / (2 R). Its
front swings out by a similar amount, for which there is enough space at some kerbs only.
"""

from collections.abc import Iterator
from dataclasses import replace
from typing import NamedTuple

import numpy as np
import shapely
from numpy.typing import NDArray
from scipy.ndimage import convolve1d

from echoscape.scenes.core.headings import unwrapped_headings
from echoscape.scenes.core.lane_graph import Lane
from echoscape.scenes.driving.lane_path import CORNER_SIGMA_M, joined_line, smoothed_line
from echoscape.scenes.driving.route import LaneNetwork

AXLE_SHARE = 0.3
KERB_M = 0.4

_STEP_M = 0.5
_OVERHANG_M = 0.05
_MIRROR_M = 0.1
"""Width that may overhang a kerb; street furniture keeps that distance (`scenes.town.streetscape`) [m]."""
_APART_M = 20.0
_SMALLEST_SHARE = 0.15
_STREET_POINTS = 51
_EVERY = 2


class SweptPaths:
    """Limits of the lanes of a network for vehicles of given length and width."""

    def __init__(self, network: LaneNetwork) -> None:
        """Tabulate the bends of the lanes within junctions; bends of streets are gentle and do not matter.

        Args:
            network: The lane network.
        """
        self._network = network
        self._inside = [lane for lane in network.lanes if lane.kind != "street"]
        bends = [_curvature(lane) for lane in self._inside]
        self._offset = np.cumsum([0] + [len(bend) for bend in bends[:-1]])
        self._bends = np.concatenate([np.zeros(0), *bends])
        self._lane_m = np.array([lane.width_m for lane in network.lanes])
        self._half_m = np.array([lane.width_m / 2 for lane in self._inside]) + KERB_M
        self._street_m = np.where([lane.kind == "street" for lane in network.lanes], network.lengths_m, 0.0)
        stretches = [line[at : at + 2] for line in network.kerbs for at in range(len(line) - 1)]
        lines = shapely.linestrings(np.reshape(stretches, (-1, 2, 2)))
        self._kerbs = shapely.STRtree(shapely.get_parts(lines))
        self._paths = [_junction_path(lanes) for lanes in _junction_paths(network)] if stretches else []

    def drivable_lanes(self, length_m: float, width_m: float) -> NDArray[np.bool_]:
        """Return the lanes on which a vehicle can drive without ever getting stuck.

        A lane within a junction has space for half its width and 0.4 m more on either side, like its
        carriageway; the corners of the vehicle must not cross a kerb. A street lane must be as wide as the
        vehicle.

        Args:
            length_m: Length of the vehicle [m].
            width_m: Width of the vehicle [m].

        Returns:
            Whether a lane can be used (N,); none if that is less than 15 % of the street length.
        """
        usable = width_m <= self._lane_m
        if self._inside:
            inward = np.maximum.reduceat(self._inward(length_m), self._offset)
            usable[[lane.id for lane in self._inside]] = width_m / 2 + inward <= self._half_m + _OVERHANG_M
        usable[self._over_kerbs(length_m, width_m, usable)] = False
        loop = self._network.largest_component(usable)
        return loop if self._street_m @ loop > _SMALLEST_SHARE * self._street_m.sum() else loop & False

    def _over_kerbs(self, length_m: float, width_m: float, usable: NDArray[np.bool_]) -> NDArray[np.intp]:
        """Return the ids of usable lanes (K,) on whose paths the outline of the vehicle crosses a kerb."""
        places = [_places(path, length_m) for path in self._paths if usable[path.lanes].all()]
        if not places:
            return np.zeros(0, dtype=np.intp)
        middle, yaw, lane = (np.concatenate(rows) for rows in zip(*places, strict=True))
        shape = _outlines(middle, yaw, length_m - 2 * _OVERHANG_M, width_m - 2 * _MIRROR_M)
        crossing, _ = self._kerbs.query(shape, predicate="intersects")
        return np.unique(lane[crossing])

    def _inward(self, length_m: float) -> NDArray[np.float64]:
        """Return the inward offset of the centre of a body along the bends (S,) [m]."""
        half_m = AXLE_SHARE * length_m
        reach = np.arange(-int(half_m / _STEP_M), int(half_m / _STEP_M) + 1) * _STEP_M
        chord = convolve1d(self._bends, (half_m - np.abs(reach)) / 2 * _STEP_M, mode="constant")
        return np.abs(chord) + CORNER_SIGMA_M**2 / 2 * np.abs(self._bends)


def _curvature(lane: Lane) -> NDArray[np.float64]:
    """Return the curvature along a lane (S,) [1/m], followed by a straight longer than any chord."""
    step = np.diff(lane.centre, axis=0)
    length = np.hypot(*step.T)
    heading = unwrapped_headings(step)
    station = np.cumsum(length) - length / 2
    grid = _STEP_M * np.arange(-1, max(int(length.sum() / _STEP_M), 1) + 2)
    bend = np.diff(np.interp(grid, station, heading)) / _STEP_M
    return np.concatenate([bend, np.zeros(int(_APART_M / _STEP_M))])


def chords(line: NDArray[np.float64], half: int) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Return the chords that connect points of a line.

    Args:
        line: Line (S, 2) [m].
        half: Half the length of a chord [samples].

    Returns:
        Midpoints (S - 2 half, 2) [m] and unwrapped headings (S - 2 half,) [rad].
    """
    chord = line[2 * half :] - line[: -2 * half]
    return (line[2 * half :] + line[: -2 * half]) / 2, unwrapped_headings(chord)


class _JunctionPath(NamedTuple):
    """A path through a junction from street to street: a smooth line (S, 2), samples every `step_m`.

    `lanes` are those within the junction; `ends_m` are the distances at which the first begins and each ends.
    """

    line: NDArray[np.float64]
    step_m: float
    lanes: NDArray[np.intp]
    ends_m: NDArray[np.float64]


def _junction_paths(network: LaneNetwork) -> Iterator[list[Lane]]:
    """Yield every path through a junction, including the adjacent ends of the two streets."""
    unfinished = [[lane] for lane in network.lanes if lane.kind == "street"]
    while unfinished:
        path = unfinished.pop()
        for after in (network.lanes[number] for number in path[-1].successors):
            if after.kind != "street" and all(after.id != lane.id for lane in path):
                unfinished.append([*path, after])
            elif after.kind == "street" and len(path) > 1:
                first = replace(path[0], centre=path[0].centre[-_STREET_POINTS:])
                yield [first, *path[1:], replace(after, centre=after.centre[:_STREET_POINTS])]


def _junction_path(lanes: list[Lane]) -> _JunctionPath:
    """Return the smooth line of a path through a junction."""
    travel, line = joined_line(lanes, step_m=_STEP_M)
    return _JunctionPath(
        line=smoothed_line(line, sigma=CORNER_SIGMA_M / travel[1]),
        step_m=float(travel[1]),
        lanes=np.array([lane.id for lane in lanes[1:-1]]),
        ends_m=np.cumsum([lane.length_m for lane in lanes[:-1]]),
    )


def _places(
    path: _JunctionPath, length_m: float
) -> tuple[NDArray[np.float64], NDArray[np.float64], NDArray[np.intp]]:
    """Return midpoints (P, 2), yaws (P,) and lanes (P,) of a body in a junction, about 1 m apart.

    At the smallest radii a corner swings out at most 2 cm further between two of them.
    """
    half = max(round(AXLE_SHARE * length_m / path.step_m), 1)
    if len(path.line) <= 2 * half:
        return np.zeros((0, 2)), np.zeros(0), np.zeros(0, dtype=np.intp)
    middle, yaw = chords(path.line, half)
    at = path.step_m * (half + np.arange(len(middle)))
    within = (at > path.ends_m[0] - length_m / 2) & (at < path.ends_m[-1] + length_m / 2)
    lane = path.lanes[np.searchsorted(path.ends_m[1:-1], at[within])]
    return middle[within][::_EVERY], yaw[within][::_EVERY], lane[::_EVERY]


def _outlines(
    middle: NDArray[np.float64], yaw: NDArray[np.float64], length_m: float, width_m: float
) -> NDArray[np.object_]:
    """Return rectangles (P,) about `middle` (P, 2), `length_m` along `yaw` (P,)."""
    ahead = np.stack([np.cos(yaw), np.sin(yaw)], axis=-1)[:, None] * length_m / 2
    left = np.stack([-np.sin(yaw), np.cos(yaw)], axis=-1)[:, None] * width_m / 2
    along, aside = np.array([[1.0, -1.0, -1.0, 1.0], [1.0, 1.0, -1.0, -1.0]])[..., None]
    return np.asarray(shapely.polygons(middle[:, None] + along * ahead + aside * left))
