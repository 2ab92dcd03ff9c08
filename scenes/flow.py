"""Traffic in the lanes, step by step: vehicles follow, slow for bends, wait at junctions and keep clear of the ego.

Car-following is the intelligent driver model (Treiber, Hennecke & Helbing, Phys. Rev. E 62, 2000). The radar car's
drive is given: others brake behind it, leave it the junctions at its times, and do not dawdle before it.
"""

import logging
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from echoscape.scenes.crossings import Reservations, conflicting_lanes, ego_crossings
from echoscape.scenes.drive import EGO_EXTENT_M, Drive
from echoscape.scenes.lane_tables import BRAKE_MPS2, LaneTables
from echoscape.scenes.roads import RoadGraph

_LOG = logging.getLogger(__name__)

_AHEAD = 5
_HEADWAY_S = 1.4
_STANDSTILL_M = 2.5
_SPEED_UP_MPS2 = 1.6
_BRAKE_COMFORT_MPS2 = 2.0
_BRAKE_HARD_MPS2 = 6.0
_SETTLE_S = 0.8
_NOTHING, _NOWHERE = -2, -3
_FAR_M = 1e4


@dataclass(frozen=True, kw_only=True)
class Fleet:
    """M vehicles at the start: lane (M,), station_m (M,) along it, length_m (M,), top_mps (M,), zeal (M,).

    `zeal` is the share of the lanes' speed that a driver goes at.
    """

    lane: NDArray[np.intp]
    station_m: NDArray[np.float64]
    length_m: NDArray[np.float64]
    top_mps: NDArray[np.float64]
    zeal: NDArray[np.float64]


@dataclass(frozen=True, kw_only=True)
class FlowRecord:
    """What T steps made of M vehicles: time_s (T,), travel_m and speed_mps (T, M), and each one's lanes.

    Travel counts from the beginning of a vehicle's first lane.
    """

    time_s: NDArray[np.float64]
    travel_m: NDArray[np.float64]
    speed_mps: NDArray[np.float64]
    lanes: tuple[tuple[int, ...], ...]


def flow(
    roads: RoadGraph, drive: Drive, fleet: Fleet, *, step_s: float, rng: np.random.Generator
) -> FlowRecord:
    """Simulate `fleet` for as long as `drive` lasts, in steps of `step_s` [s]."""
    state = _Flow(roads, drive, fleet, step_s=step_s, rng=rng)
    travel, speed = [state.travel()], [state.speed[:-1].copy()]
    for _ in range(state.steps):
        state.advance()
        travel.append(state.travel())
        speed.append(state.speed[:-1].copy())
    return FlowRecord(
        time_s=step_s * np.arange(state.steps + 1),
        travel_m=np.array(travel),
        speed_mps=np.array(speed),
        lanes=tuple(tuple(done + ahead) for done, ahead in zip(state.done, state.ahead, strict=True)),
    )


class _Flow:
    """The moving state: M vehicles and, in the last row of every array, the radar car."""

    def __init__(
        self, roads: RoadGraph, drive: Drive, fleet: Fleet, *, step_s: float, rng: np.random.Generator
    ) -> None:
        self.tables = LaneTables(roads)
        self.rng = rng
        self.step_s = step_s
        self.steps = int(np.ceil(drive.duration_s / step_s))
        self.now = 0
        conflict = conflicting_lanes(roads)
        self.crossings = Reservations(
            conflict, ego_crossings(drive, roads, conflict, length_m=EGO_EXTENT_M[0])
        )
        self.length = np.append(fleet.length_m, EGO_EXTENT_M[0])
        self.fleet = fleet
        self.count = len(fleet.lane)
        self.station = np.append(fleet.station_m, 0.0)
        self.done: list[list[int]] = [[] for _ in range(self.count)]
        self.ahead = [[int(lane)] for lane in fleet.lane]
        self.queue = np.full((self.count + 1, _AHEAD), _NOTHING, dtype=np.intp)
        self.before = np.full(self.count + 1, _NOTHING, dtype=np.intp)
        self.passed_m = np.zeros(self.count)
        self._follow_drive(drive)
        for vehicle in range(self.count):
            self._plan(vehicle)
        cap = self.tables.cap_mps(self.queue[:-1, 0], self.station[:-1])
        self.speed = np.append(0.8 * self._wish(cap), 0.0)
        self._place_ego()

    def travel(self) -> NDArray[np.float64]:
        """Return the travel (M,) [m] of every vehicle."""
        return self.passed_m + self.station[:-1]

    def advance(self) -> None:
        """Move everybody by one step."""
        starts = self._starts()
        gap, lead_speed, before_ego = self._leaders(starts)
        pressed = self._pressed(before_ego)
        self._ask_for_crossings(starts, pressed)
        acceleration = self._acceleration(starts, gap, lead_speed)
        acceleration = self._keep_before_ego(acceleration, before_ego, gap)
        old = self.speed[:-1]
        new = np.maximum(old + self.step_s * acceleration, 0.0)
        self.station[:-1] += self.step_s * (old + new) / 2
        self.speed[:-1] = new
        self.now += 1
        self._place_ego()
        self._change_lanes()

    # ------------------------------------------------------------------ the radar car

    def _follow_drive(self, drive: Drive) -> None:
        time = self.step_s * np.arange(self.steps + 1 + int(4.0 / self.step_s))
        self.ego_travel = drive.travel(time)
        velocity = drive.velocity(np.minimum(time, drive.duration_s))
        self.ego_speed = np.hypot(velocity[:, 0], velocity[:, 1])
        self.ego_place, self.ego_station = drive.route.locate(self.ego_travel)
        self.ego_lanes = np.concatenate([drive.route.lanes, np.full(_AHEAD, _NOTHING)]).astype(np.intp)

    def _place_ego(self) -> None:
        place = self.ego_place[self.now]
        self.queue[-1] = self.ego_lanes[place : place + _AHEAD]
        self.before[-1] = self.ego_lanes[place - 1] if place else _NOTHING
        self.station[-1] = self.ego_station[self.now]
        self.speed[-1] = self.ego_speed[self.now]

    def _pressed(self, before_ego: NDArray[np.float64]) -> NDArray[np.bool_]:
        """Return which vehicles (M,) the radar car is close behind; those take the same way, in good time."""
        pressed = before_ego < 6.0 * self.speed[-1] + 15.0
        for vehicle in np.flatnonzero(pressed):
            lane = self.ahead[vehicle][0]
            if self.tables.inside[lane] or self.crossings.holds(vehicle):
                continue
            coming = self.ego_lanes[self.ego_place[self.now] :][: 2 * _AHEAD].tolist()
            if lane in coming:
                way = coming[coming.index(lane) :]
                self.ahead[vehicle] = way[: way.index(_NOTHING)] if _NOTHING in way else way
                self._plan(vehicle)
        return pressed

    def _keep_before_ego(
        self, acceleration: NDArray[np.float64], before_ego: NDArray[np.float64], gap: NDArray[np.float64]
    ) -> NDArray[np.float64]:
        """Let nobody before the radar car be slower than it will be at that place a little later."""
        later = self.now + int(2.5 / self.step_s)
        reach = self.ego_travel[later] - self.ego_travel[self.now]
        spare = before_ego - (self.length[:-1] + self.length[-1]) / 2 - reach - 2.0
        wanted = self.ego_speed[later] + 0.5 * (3.0 - spare)
        push = np.clip((wanted - self.speed[:-1]) / _SETTLE_S, -_BRAKE_HARD_MPS2, 3.0)
        near = (spare < 6.0) & (gap > _STANDSTILL_M) & ~self._waiting()
        return np.where(near, np.maximum(acceleration, push), acceleration)

    # ------------------------------------------------------------------ following

    def _starts(self) -> NDArray[np.float64]:
        """Return how far ahead (V, Q) [m] of each vehicle's middle the lanes of its queue begin."""
        lengths = np.where(self.queue == _NOTHING, _FAR_M, self.tables.length_m[self.queue])
        starts = np.empty(self.queue.shape)
        starts[:, 0] = -self.station
        starts[:, 1:] = np.cumsum(lengths[:, :-1], axis=1) - self.station[:, None]
        return starts

    def _leaders(
        self, starts: NDArray[np.float64]
    ) -> tuple[NDArray[np.float64], NDArray[np.float64], NDArray[np.float64]]:
        """Return each vehicle's gap (M,) [m] to what is before it, that one's speed (M,), and its lead on the ego.

        A vehicle that has just changed lanes still has its tail in the lane before, and counts there as well.
        """
        everyone = len(self.station)
        tail = np.where(self.station < self.length / 2 + 1.5, self.before, _NOTHING)
        lane = np.concatenate([self.queue[:, 0], tail])
        lane[lane == _NOTHING] = _NOWHERE
        behind = np.where(tail == _NOTHING, 0.0, self.tables.length_m[tail])
        place = np.concatenate([self.station, self.station + behind])
        distance = np.where(
            self.queue[:, :, None] == lane, starts[:, :, None] + place, _FAR_M
        )  # (V, Q, 2 V)
        distance[distance <= 0] = _FAR_M
        distance = distance.min(axis=1)
        rows = np.arange(everyone)
        distance[rows, rows] = distance[rows, rows + everyone] = _FAR_M
        leader = distance.argmin(axis=1)
        gap = distance[rows, leader] - (self.length + self.length[leader % everyone]) / 2
        return gap[:-1], self.speed[leader[:-1] % everyone], distance[-1, : self.count]

    def _wish(self, cap_mps: NDArray[np.float64]) -> NDArray[np.float64]:
        return np.minimum(self.fleet.zeal * cap_mps, self.fleet.top_mps)

    def _waiting(self) -> NDArray[np.bool_]:
        """Return which vehicles (M,) may not pass the end of their lane."""
        holds = np.array([self.crossings.holds(vehicle) for vehicle in range(self.count)], dtype=bool)
        inside = self.tables.inside[self.queue[:-1, :2]]
        return ~inside[:, 0] & inside[:, 1] & ~holds

    def _acceleration(
        self, starts: NDArray[np.float64], gap: NDArray[np.float64], lead_speed: NDArray[np.float64]
    ) -> NDArray[np.float64]:
        speed = self.speed[:-1]
        wish = self._wish(self.tables.cap_mps(self.queue[:-1, 0], self.station[:-1]))
        for place in (1, 2, 3):
            begin = self._wish(self.tables.start_cap_mps[self.queue[:-1, place]])
            room = np.maximum(starts[:-1, place], 0.0)
            wish = np.minimum(wish, np.sqrt(begin**2 + 2 * BRAKE_MPS2 * room))
        free = np.clip((wish - speed) / _SETTLE_S, -3.0, _SPEED_UP_MPS2)
        line = np.where(self._waiting(), starts[:-1, 1] - self.length[:-1] / 2 + 1.5, _FAR_M)
        return np.maximum.reduce(
            [
                np.minimum.reduce([free, _idm(speed, gap, speed - lead_speed), _idm(speed, line, speed)]),
                np.full_like(speed, -_BRAKE_HARD_MPS2),
            ]
        )

    # ------------------------------------------------------------------ lanes and junctions

    def _plan(self, vehicle: int) -> None:
        """Extend the lanes ahead of `vehicle` up to a street beyond the next junction."""
        ahead = self.ahead[vehicle]
        while len(ahead) < _AHEAD or self.tables.inside[ahead[-1]]:
            ahead.append(
                self.tables.choose(ahead[-1], long=bool(self.fleet.length_m[vehicle] > 7.0), rng=self.rng)
            )
        self.queue[vehicle] = ahead[:_AHEAD]

    def _change_lanes(self) -> None:
        length = self.tables.length_m[self.queue[:-1, 0]]
        for vehicle in np.flatnonzero(self.station[:-1] >= length):
            lane = self.ahead[vehicle].pop(0)
            self.done[vehicle].append(lane)
            self.before[vehicle] = lane
            self.passed_m[vehicle] += length[vehicle]
            self.station[vehicle] -= length[vehicle]
            self._plan(vehicle)
        out = ~self.tables.inside[self.queue[:-1, 0]] & (self.station[:-1] > self.length[:-1] / 2 + 1.0)
        for vehicle in np.flatnonzero(out):
            self.crossings.release_behind(int(vehicle), int(self.queue[vehicle, 0]))

    def _ask_for_crossings(self, starts: NDArray[np.float64], pressed: NDArray[np.bool_]) -> None:
        speed = self.speed[:-1]
        to_line = starts[:-1, 1] - self.length[:-1] / 2
        reach = speed**2 / (2 * BRAKE_MPS2) + 1.5 * speed + 6.0
        reach = np.where(self.tables.yields[self.queue[:-1, 0]] & ~pressed, np.minimum(reach, 14.0), reach)
        asking = np.flatnonzero(self._waiting() & (to_line < reach))
        for vehicle in sorted(asking.tolist(), key=lambda row: (not pressed[row], to_line[row])):
            self._ask(vehicle, max(float(to_line[vehicle]), 0.0))

    def _ask(self, vehicle: int, to_line_m: float) -> None:
        approach, *rest = self.ahead[vehicle]
        count = next(i for i, lane in enumerate(rest) if not self.tables.inside[lane])
        run, after = tuple(rest[:count]), rest[count]
        if not self._has_room(vehicle, after):
            return
        lanes = list(run)
        speed, top = float(self.speed[vehicle]), float(self.fleet.top_mps[vehicle])
        across = float(self.tables.length_m[lanes].sum() + self.length[vehicle] + 3.0)
        pace = min(max(float(self.tables.start_cap_mps[lanes].min()) * 0.8, 2.5), top)
        needed = to_line_m / max(speed, 3.0) + across / pace + (2.0 if speed < pace / 2 else 0.5)
        now = self.now * self.step_s
        self.crossings.ask(vehicle, approach, run, now_s=now, until_s=now + needed)

    def _has_room(self, vehicle: int, lane: int) -> bool:
        """Tell whether a vehicle that goes to `lane` will not have to stop with its tail in the junction."""
        there = self.queue[:, 0] == lane
        there[vehicle] = False
        tail = np.where(there, self.station - self.length / 2, _FAR_M)
        return bool(((tail > self.length[vehicle] + 5.0) | (self.speed > 3.0)).all())


def _idm(
    speed: NDArray[np.float64], gap: NDArray[np.float64], closing: NDArray[np.float64]
) -> NDArray[np.float64]:
    """Return the interaction part of the intelligent driver model (M,) [m/s2]."""
    dynamic = speed * _HEADWAY_S + speed * closing / (2 * np.sqrt(_SPEED_UP_MPS2 * _BRAKE_COMFORT_MPS2))
    wanted = _STANDSTILL_M + np.maximum(dynamic, 0.0)
    return _SPEED_UP_MPS2 * (1 - (wanted / np.maximum(gap, 0.1)) ** 2)
