"""Car following: the vehicle ahead of each vehicle, and the acceleration that it allows.

The model is the intelligent driver model, IDM (Treiber, Hennecke & Helbing, Phys. Rev. E 62, 2000).
"""

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

NO_LANE = -2
"""Stands for a lane id where there is none."""
FAR_M = 1e4
"""Stands for the distance to a vehicle or lane where there is none [m]."""
MAX_ACCELERATION_MPS2 = 1.6
"""Maximum acceleration a of the model [m/s^2]."""

_EMPTY_SLOT = -3
_HEADWAY_S = 1.4
_STANDSTILL_M = 2.5
_BRAKE_COMFORT_MPS2 = 2.0
_TAIL_M = 1.5


class Leaders(NamedTuple):
    """The leaders of V vehicles.

    Attributes:
        gap_m: Distance to the leader, bumper to bumper (V,) [m].
        speed_mps: Speed of the leader (V,) [m/s].
        ahead_m: Distance of the column's vehicle ahead of the row's along the path of the latter, centre to
            centre (V, V) [m]; `FAR_M` if it is not ahead.
    """

    gap_m: NDArray[np.float64]
    speed_mps: NDArray[np.float64]
    ahead_m: NDArray[np.float64]


def lane_starts(
    queue: NDArray[np.intp], station_m: NDArray[np.float64], lane_length_m: NDArray[np.float64]
) -> NDArray[np.float64]:
    """Return the distance from each vehicle to the beginning of each of its next lanes.

    Args:
        queue: Ids of the present and the next lanes of each vehicle (V, Q).
        station_m: Distance of each vehicle along its lane (V,) [m].
        lane_length_m: Length of each lane (N,) [m].

    Returns:
        Distances from the centre of the vehicle (V, Q) [m], negative for the present lane.
    """
    lengths = np.where(queue == NO_LANE, FAR_M, lane_length_m[queue])
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
    """Find the nearest vehicle ahead of each vehicle on its next lanes.

    A vehicle that has just left a lane still counts there, as long as its tail is on it.

    Args:
        queue: Ids of the present and the next lanes of each vehicle (V, Q).
        starts_m: Distances to the beginnings of these lanes (V, Q) [m], see `lane_starts`.
        before: Id of the lane that each vehicle left last (V,).
        station_m: Distance of each vehicle along its lane (V,) [m].
        speed_mps: Speeds (V,) [m/s].
        length_m: Lengths of the vehicles (V,) [m].
        lane_length_m: Length of each lane (N,) [m].

    Returns:
        The leaders.
    """
    count = len(station_m)
    tail = np.where(station_m < length_m / 2 + _TAIL_M, before, NO_LANE)
    lane = np.concatenate([queue[:, 0], tail])
    lane[lane == NO_LANE] = _EMPTY_SLOT
    behind = np.where(tail == NO_LANE, 0.0, lane_length_m[tail])
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


def idm_acceleration(
    speed_mps: NDArray[np.float64], gap_m: NDArray[np.float64], closing_mps: NDArray[np.float64]
) -> NDArray[np.float64]:
    """Return the acceleration that an obstacle ahead allows.

    a (1 - (s* / s)^2) with s* = s0 + v T + v dv / (2 sqrt(a b)): equations 3 and 4 of Treiber et al. 2000,
    without the free-road term.

    Args:
        speed_mps: Own speed v (M,) [m/s].
        gap_m: Distance to the obstacle s (M,) [m].
        closing_mps: Closing speed dv (M,) [m/s].

    Returns:
        Acceleration (M,) [m/s^2].
    """
    dynamic = speed_mps * _HEADWAY_S + speed_mps * closing_mps / (
        2 * np.sqrt(MAX_ACCELERATION_MPS2 * _BRAKE_COMFORT_MPS2)
    )
    wanted = _STANDSTILL_M + np.maximum(dynamic, 0.0)
    return MAX_ACCELERATION_MPS2 * (1 - (wanted / np.maximum(gap_m, 0.1)) ** 2)


def can_accelerate(gap_m: NDArray[np.float64], closing_mps: NDArray[np.float64]) -> NDArray[np.bool_]:
    """Return which vehicles can be pushed on without hitting the one ahead.

    Args:
        gap_m: Distance to the vehicle ahead (M,) [m].
        closing_mps: Closing speed (M,) [m/s].

    Returns:
        Whether there is enough distance (M,).
    """
    return gap_m > _STANDSTILL_M + np.maximum(closing_mps, 0.0) ** 2 / 8.0
