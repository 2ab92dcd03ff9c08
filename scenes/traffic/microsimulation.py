"""Simulates vehicles in the lanes: they follow, slow down for bends, wait, and avoid the ego vehicle.

The drive of the ego vehicle is given. The others brake behind it, leave junctions free at its times, and
ahead of it drive fast enough not to be caught up.
"""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from echoscape.scenes.core.lane_graph import RoadGraph
from echoscape.scenes.driving.ego_drive import EGO_EXTENT_M, EgoDrive
from echoscape.scenes.traffic.car_following import (
    FAR_M,
    MAX_ACCELERATION_MPS2,
    NO_LANE,
    can_accelerate,
    idm_acceleration,
    lane_starts,
    leaders,
)
from echoscape.scenes.traffic.lane_arrays import BRAKE_MPS2, LaneArrays
from echoscape.scenes.traffic.right_of_way import EgoSchedule, Reservations, conflicting_lanes, ego_crossings

_AHEAD = 5
_BRAKE_HARD_MPS2 = 6.0
_SETTLE_S = 0.8
_LONG_M, _WIDE_M = 7.0, 9.0


@dataclass(frozen=True, kw_only=True)
class Fleet:
    """M vehicles at the start of the simulation, on N lanes.

    Attributes:
        lane: Lane of each vehicle (M,).
        station_m: Distance along the lane (M,) [m].
        length_m: Length (M,) [m].
        max_speed_mps: Highest speed of the vehicle (M,) [m/s].
        speed_factor: Speed that the driver wants relative to the lane's speed cap (M,).
        lane_weight: Relative probability of each lane where a vehicle chooses its path (N,).
        may_use: Lanes that each vehicle can use without ever getting stuck (M, N).
    """

    lane: NDArray[np.intp]
    station_m: NDArray[np.float64]
    length_m: NDArray[np.float64]
    max_speed_mps: NDArray[np.float64]
    speed_factor: NDArray[np.float64]
    lane_weight: NDArray[np.float64]
    may_use: NDArray[np.bool_]


@dataclass(frozen=True, kw_only=True)
class TrafficRecord:
    """Motion of M vehicles in T time steps.

    Attributes:
        time_s: Times (T,) [s].
        travel_m: Distance from the beginning of the vehicle's first lane (T, M) [m].
        speed_mps: Speeds (T, M) [m/s].
        lanes: Ids of the lanes of each vehicle in the order driven.
    """

    time_s: NDArray[np.float64]
    travel_m: NDArray[np.float64]
    speed_mps: NDArray[np.float64]
    lanes: tuple[tuple[int, ...], ...]


def simulate_traffic(
    roads: RoadGraph, drive: EgoDrive, fleet: Fleet, *, step_s: float, rng: np.random.Generator
) -> TrafficRecord:
    """Simulate vehicles for the duration of a drive.

    Args:
        roads: The road graph.
        drive: The drive of the ego vehicle.
        fleet: The vehicles at the start.
        step_s: Time step [s].
        rng: Random generator, for the paths of the vehicles.

    Returns:
        The motion of the vehicles.
    """
    state = _TrafficState(roads, drive, fleet, step_s=step_s, rng=rng)
    travel, speed = [state.travel()], [state.speed[:-1].copy()]
    for _ in range(state.steps):
        state.advance()
        travel.append(state.travel())
        speed.append(state.speed[:-1].copy())
    return TrafficRecord(
        time_s=step_s * np.arange(state.steps + 1, dtype=np.float64),
        travel_m=np.array(travel),
        speed_mps=np.array(speed),
        lanes=tuple(tuple(done + ahead) for done, ahead in zip(state.done, state.ahead, strict=True)),
    )


class _TrafficState:
    """State of the simulation: M vehicles and, in the last row of every array, the ego vehicle."""

    def __init__(
        self, roads: RoadGraph, drive: EgoDrive, fleet: Fleet, *, step_s: float, rng: np.random.Generator
    ) -> None:
        self.tables = LaneArrays(roads)
        self.rng = rng
        self.step_s = step_s
        self.steps = int(np.ceil(drive.duration_s / step_s))
        self.now = 0
        conflict = conflicting_lanes(roads)
        ego = ego_crossings(drive, roads, conflict, length_m=EGO_EXTENT_M[0])
        self.crossings = Reservations(conflict, ego)
        self.length = np.append(fleet.length_m, EGO_EXTENT_M[0])
        self.fleet = fleet
        self.count = len(fleet.lane)
        self.station = np.append(fleet.station_m, 0.0)
        self.done: list[list[int]] = [[] for _ in range(self.count)]
        self.ahead = [[int(lane)] for lane in fleet.lane]
        self.queue = np.full((self.count + 1, _AHEAD), NO_LANE, dtype=np.intp)
        self.before = np.full(self.count + 1, NO_LANE, dtype=np.intp)
        self.passed_m = np.zeros(self.count)
        self.ego = EgoSchedule(drive, steps=self.steps, step_s=step_s, lookahead=_AHEAD)
        for vehicle in range(self.count):
            self._plan(vehicle)
        cap = self.tables.cap_mps(self.queue[:-1, 0], self.station[:-1])
        self.speed = np.append(0.8 * self._wish(cap), 0.0)
        self._place_ego()

    def travel(self) -> NDArray[np.float64]:
        """Return the distance of each vehicle from the beginning of its first lane (M,) [m]."""
        return self.passed_m + self.station[:-1]

    def advance(self) -> None:
        """Advance by one time step."""
        lane_length = self.tables.length_m
        starts = lane_starts(self.queue, self.station, lane_length)
        lead = leaders(self.queue, starts, self.before, self.station, self.speed, self.length, lane_length)
        gap, closing = lead.gap_m[:-1], (self.speed - lead.speed_mps)[:-1]
        before_ego = lead.ahead_m[-1, :-1]
        pressed = self._pressed(before_ego)
        self._request_junctions(starts, pressed)
        acceleration = self._acceleration(starts, gap, closing)
        acceleration = self._keep_before_ego(acceleration, before_ego, can_accelerate(gap, closing))
        old = self.speed[:-1]
        new = np.maximum(old + self.step_s * acceleration, 0.0)
        self.station[:-1] += self.step_s * (old + new) / 2
        self.speed[:-1] = new
        self.now += 1
        self._place_ego()
        self._change_lanes()

    # ------------------------------------------------------------------ the ego vehicle

    def _place_ego(self) -> None:
        """Set the last row to the ego vehicle at the present step."""
        self.queue[-1], self.before[-1] = self.ego.lanes(self.now)
        self.station[-1], self.speed[-1] = self.ego.station_m[self.now], self.ego.speed_mps[self.now]

    def _pressed(self, before_ego: NDArray[np.float64]) -> NDArray[np.bool_]:
        """Return vehicles (M,) close ahead of the ego vehicle; they take its path where possible."""
        pressed = before_ego < 6.0 * self.speed[-1] + 15.0
        for vehicle in np.flatnonzero(pressed).tolist():
            lane = self.ahead[vehicle][0]
            if self.tables.inside[lane] or self.crossings.holds(vehicle, lane):
                continue
            path = self.ego.lanes_from(lane, self.now)
            if path and self.fleet.may_use[vehicle, path].all():
                self.ahead[vehicle] = path
                self._plan(vehicle)
        return pressed

    def _keep_before_ego(
        self, acceleration: NDArray[np.float64], before_ego: NDArray[np.float64], room: NDArray[np.bool_]
    ) -> NDArray[np.float64]:
        """Raise accelerations so that vehicles ahead of the ego vehicle are as fast as it will be."""
        reach, speed = self.ego.look_ahead(self.now)
        order = np.argsort(before_ego)
        column = np.empty(self.count)  # space for the vehicles between it and the ego vehicle
        column[order] = np.cumsum(self.length[order] + 4.0) - self.length[order] / 2
        spare = before_ego - self.length[-1] / 2 - reach - column + 2.0
        wanted = speed + 0.5 * (3.0 - spare)
        push = np.clip((wanted - self.speed[:-1]) / _SETTLE_S, -_BRAKE_HARD_MPS2, 3.0)
        near = (spare < 6.0) & room & ~self._waiting()
        return np.where(near, np.maximum(acceleration, push), acceleration)

    # ------------------------------------------------------------------ speed

    def _wish(self, cap_mps: NDArray[np.float64]) -> NDArray[np.float64]:
        """Return the speed that each driver wants (M,) [m/s]."""
        return np.minimum(self.fleet.speed_factor * cap_mps, self.fleet.max_speed_mps)

    def _waiting(self) -> NDArray[np.bool_]:
        """Return which vehicles (M,) may not pass the end of their lane."""
        lanes = self.queue[:-1, 0].tolist()
        holds = np.array([self.crossings.holds(*row) for row in enumerate(lanes)], dtype=bool)
        inside = self.tables.inside[self.queue[:-1, :2]]
        return ~inside[:, 0] & inside[:, 1] & ~holds

    def _acceleration(
        self, starts: NDArray[np.float64], gap: NDArray[np.float64], closing: NDArray[np.float64]
    ) -> NDArray[np.float64]:
        """Return each driver's acceleration (M,) [m/s^2]: desired speed, bends, vehicle ahead, stop line."""
        speed = self.speed[:-1]
        wish = self._wish(self.tables.cap_mps(self.queue[:-1, 0], self.station[:-1]))
        for place in (1, 2, 3):
            begin = self._wish(self.tables.entry_cap_mps[self.queue[:-1, place]])
            room = np.maximum(starts[:-1, place], 0.0)
            wish = np.minimum(wish, np.sqrt(begin**2 + 2 * BRAKE_MPS2 * room))
        free = np.clip((wish - speed) / _SETTLE_S, -3.0, MAX_ACCELERATION_MPS2)
        line = np.where(self._waiting(), starts[:-1, 1] - self.length[:-1] / 2 - 0.5, FAR_M)
        wanted = np.minimum.reduce(
            [free, idm_acceleration(speed, gap, closing), idm_acceleration(speed, line, speed)]
        )
        return np.maximum(wanted, -_BRAKE_HARD_MPS2)

    # ------------------------------------------------------------------ lanes and junctions

    def _plan(self, vehicle: int) -> None:
        """Extend the path of a vehicle to a street beyond the next junction."""
        ahead = self.ahead[vehicle]
        lane_weight, may_use = self.fleet.lane_weight, self.fleet.may_use[vehicle]
        while len(ahead) < _AHEAD or self.tables.inside[ahead[-1]]:
            ahead.append(self.tables.choose(ahead, lane_weight=lane_weight, may_use=may_use, rng=self.rng))
        self.queue[vehicle] = ahead[:_AHEAD]

    def _change_lanes(self) -> None:
        """Move vehicles at the end of their lane to the next; release junctions that they have left."""
        length = self.tables.length_m[self.queue[:-1, 0]]
        for vehicle in np.flatnonzero(self.station[:-1] >= length).tolist():
            lane = self.ahead[vehicle].pop(0)
            self.done[vehicle].append(lane)
            self.before[vehicle] = lane
            self.passed_m[vehicle] += length[vehicle]
            self.station[vehicle] -= length[vehicle]
            self._plan(vehicle)
        out = ~self.tables.inside[self.queue[:-1, 0]] & (self.station[:-1] > self.length[:-1] / 2 + 1.0)
        for vehicle in np.flatnonzero(out):
            self.crossings.release_passed(int(vehicle), int(self.queue[vehicle, 0]))

    def _request_junctions(self, starts: NDArray[np.float64], pressed: NDArray[np.bool_]) -> None:
        """Let the first waiting vehicle of each lane that is near its stop line request the junction."""
        speed = self.speed[:-1]
        to_line = starts[:-1, 1] - self.length[:-1] / 2
        reach = speed**2 / (2 * BRAKE_MPS2) + 1.5 * speed + 6.0
        reach = np.where(self.tables.yields[self.queue[:-1, 0]] & ~pressed, np.minimum(reach, 14.0), reach)
        waiting = np.flatnonzero(self._waiting())
        lane = self.queue[waiting, 0]
        # Only the first vehicle that waits in a lane may request: one behind it that held the junction would
        # block it for good.
        order = waiting[np.lexsort((to_line[waiting], lane))]
        foremost = order[np.append(True, np.diff(self.queue[order, 0]) != 0)] if len(order) else order
        asking = foremost[to_line[foremost] < reach[foremost]]
        for vehicle in sorted(asking.tolist(), key=lambda row: (not pressed[row], to_line[row])):
            self._request_junction(vehicle, max(float(to_line[vehicle]), 0.0))

    def _request_junction(self, vehicle: int, to_line_m: float) -> None:
        """Request the junction ahead for as long as the vehicle needs to cross it."""
        approach, *rest = self.ahead[vehicle]
        count = next(i for i, lane in enumerate(rest) if not self.tables.inside[lane])
        run, after = tuple(rest[:count]), rest[count]
        if not self._has_room(vehicle, after):
            return
        lanes = list(run)
        speed, top = float(self.speed[vehicle]), float(self.fleet.max_speed_mps[vehicle])
        across = float(self.tables.length_m[lanes].sum() + self.length[vehicle] + 3.0)
        pace = min(max(float(self.tables.entry_cap_mps[lanes].min()) * 0.8, 2.5), top)
        needed = to_line_m / max(speed, 3.0) + across / pace + (2.0 if speed < pace / 2 else 0.5)
        now = self.now * self.step_s
        compact = bool(self.length[vehicle] < _LONG_M or self.tables.min_radius_m[lanes].min() > _WIDE_M)
        self.crossings.request(vehicle, approach, run, now_s=now, until_s=now + needed, compact=compact)

    def _has_room(self, vehicle: int, lane: int) -> bool:
        """Return whether a vehicle can enter `lane` without stopping with its tail in the junction."""
        there = self.queue[:, 0] == lane
        there[vehicle] = False
        tail = np.where(there, self.station - self.length / 2, FAR_M)
        return bool(((tail > self.length[vehicle] + 5.0) | (self.speed > 3.0)).all())
