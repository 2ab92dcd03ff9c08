"""Which lanes long vehicles can take: what a rigid body sweeps in bends against the width of the way.

With both axles on the line, half a chord before and behind, the middle of a body is inside the line by
half the integral of curvature times distance to the nearer axle; the bend 1 / R gives (L / 2)^2 / (2 R).
"""

import numpy as np
from numpy.typing import NDArray
from scipy.ndimage import convolve1d

from echoscape.scenes.path import CORNER_M
from echoscape.scenes.roads import Lane
from echoscape.scenes.route import LaneNetwork

AXLE_SHARE = 0.3
KERB_M = 0.4

_STEP_M = 0.5
_OVERHANG_M = 0.05
_APART_M = 20.0
_SMALLEST_SHARE = 0.15


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

    def loop(self, length_m: float, width_m: float) -> NDArray[np.bool_]:
        """Return the lanes (N,) that a body of `length_m` x `width_m` can drive along for ever.

        None where that is less than a seventh or so of the streets. A junction's lane has room for half its
        width and 0.4 m on either side, as carriageways have; a street's must be as wide as the body.
        """
        usable = width_m <= self._lane_m
        if self._inside:
            inward = np.maximum.reduceat(self._inward(length_m), self._offset)
            usable[[lane.id for lane in self._inside]] = width_m / 2 + inward <= self._half_m + _OVERHANG_M
        loop = self._network.loop_within(usable)
        return loop if self._street_m @ loop > _SMALLEST_SHARE * self._street_m.sum() else loop & False

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
