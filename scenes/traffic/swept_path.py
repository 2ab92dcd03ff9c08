"""Which lanes long vehicles can take: what a rigid body sweeps in bends against its width and its kerbs.

With both axles on the line, half a chord before and behind, the middle of a body is inside the line by
half the integral of curvature times distance to the nearer axle; the bend 1 / R gives (L / 2)^2 / (2 R). Its
front swings out by a like amount, for which junctions have room at some kerbs and not at others.
"""

from collections.abc import Iterator
from dataclasses import replace
from typing import NamedTuple

import numpy as np
import shapely
from numpy.typing import NDArray
from scipy.ndimage import convolve1d

from echoscape.scenes.core.lane_graph import Lane
from echoscape.scenes.driving.lane_path import CORNER_M, joined_line, smoothed_line
from echoscape.scenes.driving.route import LaneNetwork

AXLE_SHARE = 0.3
KERB_M = 0.4

_STEP_M = 0.5
_OVERHANG_M = 0.05
_MIRROR_M = 0.1  # what of a width may hang over a kerb: posts stand that far behind it (scenes.dressing)
_APART_M = 20.0
_SMALLEST_SHARE = 0.15
_STREET_POINTS = 51
_EVERY = 2


class SweptPaths:
    """What the lanes of a network ask of a body's length and width."""

    def __init__(self, network: LaneNetwork) -> None:
        """Tabulate the bends of the lanes within junctions; those of streets are gentle."""
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
        self._ways = [_way(lanes) for lanes in _ways(network)] if stretches else []

    def loop(self, length_m: float, width_m: float) -> NDArray[np.bool_]:
        """Return the lanes (N,) that a body of `length_m` x `width_m` can drive along for ever.

        None where that is less than a seventh or so of the streets. A junction's lane has room for half its
        width and 0.4 m on either side, as carriageways have, and no kerb where the body's corners swing; a
        street's must be as wide as the body.
        """
        usable = width_m <= self._lane_m
        if self._inside:
            inward = np.maximum.reduceat(self._inward(length_m), self._offset)
            usable[[lane.id for lane in self._inside]] = width_m / 2 + inward <= self._half_m + _OVERHANG_M
        usable[self._over_kerbs(length_m, width_m, usable)] = False
        loop = self._network.loop_within(usable)
        return loop if self._street_m @ loop > _SMALLEST_SHARE * self._street_m.sum() else loop & False

    def _over_kerbs(self, length_m: float, width_m: float, usable: NDArray[np.bool_]) -> NDArray[np.intp]:
        """Return those lanes (K,) of ways that are `usable` (N,) where a body's outline crosses a kerb."""
        places = [_places(way, length_m) for way in self._ways if usable[way.lanes].all()]
        if not places:
            return np.zeros(0, dtype=np.intp)
        middle, yaw, lane = (np.concatenate(rows) for rows in zip(*places, strict=True))
        shape = _outlines(middle, yaw, length_m - 2 * _OVERHANG_M, width_m - 2 * _MIRROR_M)
        crossing, _ = self._kerbs.query(shape, predicate="intersects")
        return np.unique(lane[crossing])

    def _inward(self, length_m: float) -> NDArray[np.float64]:
        """Return how far (S,) [m] the middle of a body is inside the line."""
        half_m = AXLE_SHARE * length_m
        reach = np.arange(-int(half_m / _STEP_M), int(half_m / _STEP_M) + 1) * _STEP_M
        chord = convolve1d(self._bends, (half_m - np.abs(reach)) / 2 * _STEP_M, mode="constant")
        return np.abs(chord) + CORNER_M**2 / 2 * np.abs(self._bends)


def _curvature(lane: Lane) -> NDArray[np.float64]:
    """Return the curvature (S,) [1/m] along a lane, then of a straight as long as no chord is."""
    step = np.diff(lane.centre, axis=0)
    length = np.hypot(*step.T)
    heading = np.unwrap(np.arctan2(step[:, 1], step[:, 0]))
    station = np.cumsum(length) - length / 2
    grid = _STEP_M * np.arange(-1, max(int(length.sum() / _STEP_M), 1) + 2)
    bend = np.diff(np.interp(grid, station, heading)) / _STEP_M
    return np.concatenate([bend, np.zeros(int(_APART_M / _STEP_M))])


# ---------------------------------------------------------------------- bodies on their ways


def chords(line: NDArray[np.float64], half: int) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Return middles (S - 2 half, 2) [m] and headings [rad] of chords `half` samples to either side."""
    chord = line[2 * half :] - line[: -2 * half]
    return (line[2 * half :] + line[: -2 * half]) / 2, np.unwrap(np.arctan2(chord[:, 1], chord[:, 0]))


class _Way(NamedTuple):
    """A way through a junction: its smooth line (S, 2) every `step_m`, from and to streets.

    `lanes` are those within the junction, `ends_m` where the first begins and each ends.
    """

    line: NDArray[np.float64]
    step_m: float
    lanes: NDArray[np.intp]
    ends_m: NDArray[np.float64]


def _ways(network: LaneNetwork) -> Iterator[list[Lane]]:
    """Yield every way from a street through a junction to the next, ends of the two streets included."""
    grow = [[lane] for lane in network.lanes if lane.kind == "street"]
    while grow:
        way = grow.pop()
        for after in (network.lanes[number] for number in way[-1].successors):
            if after.kind != "street" and all(after.id != lane.id for lane in way):
                grow.append([*way, after])
            elif after.kind == "street" and len(way) > 1:
                first = replace(way[0], centre=way[0].centre[-_STREET_POINTS:])
                yield [first, *way[1:], replace(after, centre=after.centre[:_STREET_POINTS])]


def _way(lanes: list[Lane]) -> _Way:
    travel, line = joined_line(lanes, step_m=_STEP_M)
    return _Way(
        line=smoothed_line(line, sigma=CORNER_M / travel[1]),
        step_m=float(travel[1]),
        lanes=np.array([lane.id for lane in lanes[1:-1]]),
        ends_m=np.cumsum([lane.length_m for lane in lanes[:-1]]),
    )


def _places(way: _Way, length_m: float) -> tuple[NDArray[np.float64], NDArray[np.float64], NDArray[np.intp]]:
    """Return where a body is in the junction, middles (P, 2) and yaws (P,), and which lane (P,) it is on.

    Some 1 m apart: at the smallest radii a corner is out by 2 cm less than between two of them.
    """
    half = max(round(AXLE_SHARE * length_m / way.step_m), 1)
    if len(way.line) <= 2 * half:
        return np.zeros((0, 2)), np.zeros(0), np.zeros(0, dtype=np.intp)
    middle, yaw = chords(way.line, half)
    at = way.step_m * (half + np.arange(len(middle)))
    within = (at > way.ends_m[0] - length_m / 2) & (at < way.ends_m[-1] + length_m / 2)
    lane = way.lanes[np.searchsorted(way.ends_m[1:-1], at[within])]
    return middle[within][::_EVERY], yaw[within][::_EVERY], lane[::_EVERY]


def _outlines(
    middle: NDArray[np.float64], yaw: NDArray[np.float64], length_m: float, width_m: float
) -> NDArray[np.object_]:
    """Return rectangles (P,) about `middle` (P, 2), `length_m` along `yaw` (P,)."""
    ahead = np.stack([np.cos(yaw), np.sin(yaw)], axis=-1)[:, None] * length_m / 2
    left = np.stack([-np.sin(yaw), np.cos(yaw)], axis=-1)[:, None] * width_m / 2
    along, aside = np.array([[1.0, -1.0, -1.0, 1.0], [1.0, 1.0, -1.0, -1.0]])[..., None]
    return np.asarray(shapely.polygons(middle[:, None] + along * ahead + aside * left))
