"""Who drives before whom, and how hard one brakes for it.

Car-following is the intelligent driver model (Treiber, Hennecke & Helbing, Phys. Rev. E 62, 2000).
"""

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

NOTHING = -2
FAR_M = 1e4
SPEED_UP_MPS2 = 1.6

_NOWHERE = -3
_HEADWAY_S = 1.4
_STANDSTILL_M = 2.5
_BRAKE_COMFORT_MPS2 = 2.0
_TAIL_M = 1.5


class Leaders(NamedTuple):
    """What is before each of V vehicles: gap_m (V,) from bumper to bumper, speed_mps (V,) of that one.

    ahead_m (V, V): how far ahead of the row's vehicle the column's is on the row's way, middle to middle.
    """

    gap_m: NDArray[np.float64]
    speed_mps: NDArray[np.float64]
    ahead_m: NDArray[np.float64]


def lane_starts(
    queue: NDArray[np.intp], station_m: NDArray[np.float64], lane_length_m: NDArray[np.float64]
) -> NDArray[np.float64]:
    """Return how far ahead (V, Q) [m] of each vehicle's middle the lanes of its `queue` (V, Q) begin."""
    lengths = np.where(queue == NOTHING, FAR_M, lane_length_m[queue])
    ends = np.cumsum(lengths, axis=1)
    return np.column_stack([np.zeros(len(queue)), ends[:, :-1]]) - station_m[:, None]


def leaders(
    queue: NDArray[np.intp],
    starts_m: NDArray[np.float64],
    before: NDArray[np.intp],
    station_m: NDArray[np.float64],
    speed_mps: NDArray[np.float64],
    length_m: NDArray[np.float64],
    lane_length_m: NDArray[np.float64],
) -> Leaders:
    """Find the nearest vehicle on the lanes ahead (V, Q) of each of V vehicles.

    A vehicle that has just come from lane `before` (V,) still has its tail there, and counts there as well.
    """
    count = len(station_m)
    tail = np.where(station_m < length_m / 2 + _TAIL_M, before, NOTHING)
    lane = np.concatenate([queue[:, 0], tail])
    lane[lane == NOTHING] = _NOWHERE
    behind = np.where(tail == NOTHING, 0.0, lane_length_m[tail])
    place = np.concatenate([station_m, station_m + behind])
    distance = np.where(queue[:, :, None] == lane, starts_m[:, :, None] + place, FAR_M)  # (V, Q, 2 V)
    distance[distance <= 0] = FAR_M
    ahead = distance.min(axis=1)
    rows = np.arange(count)
    ahead[rows, rows] = ahead[rows, rows + count] = FAR_M
    nearest = ahead.argmin(axis=1)
    leader = nearest % count
    gap = ahead[rows, nearest] - (length_m + length_m[leader]) / 2
    return Leaders(gap, speed_mps[leader], ahead[:, :count])


def interaction(
    speed_mps: NDArray[np.float64], gap_m: NDArray[np.float64], closing_mps: NDArray[np.float64]
) -> NDArray[np.float64]:
    """Return the acceleration (M,) [m/s2] that something `gap_m` ahead, nearing at `closing_mps`, allows.

    a (1 - (s* / s)^2) with s* = s0 + v T + v dv / (2 sqrt(a b)), equations 3 and 4 of the source.
    """
    dynamic = speed_mps * _HEADWAY_S + speed_mps * closing_mps / (
        2 * np.sqrt(SPEED_UP_MPS2 * _BRAKE_COMFORT_MPS2)
    )
    wanted = _STANDSTILL_M + np.maximum(dynamic, 0.0)
    return SPEED_UP_MPS2 * (1 - (wanted / np.maximum(gap_m, 0.1)) ** 2)


def room_to_push(gap_m: NDArray[np.float64], closing_mps: NDArray[np.float64]) -> NDArray[np.bool_]:
    """Tell (M,) who may be hurried on without running into the vehicle before it."""
    return gap_m > _STANDSTILL_M + np.maximum(closing_mps, 0.0) ** 2 / 8.0
