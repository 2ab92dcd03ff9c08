"""Everybody else on the road: vehicles in the lanes and people on the pavements while the radar car drives.

Vehicles start at free places near the drive, `scenes.flow` moves them, and whoever could not keep clear of
the others in the end is taken out.
"""

import logging
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.interpolate import CubicSpline
from scipy.spatial import KDTree

from echoscape.scenes.collisions import EGO, overlaps
from echoscape.scenes.drive import EGO_EXTENT_M, Drive
from echoscape.scenes.flow import Fleet, flow
from echoscape.scenes.path import joined_line, smoothed_line
from echoscape.scenes.pedestrians import pedestrian_tracks
from echoscape.scenes.roads import RoadGraph
from echoscape.scenes.route import LaneNetwork
from echoscape.scenes.trajectory import Trajectory
from echoscape.scenes.vehicles import vehicle_prototypes
from echoscape.scenes.world import Mover, Prototype, Town

_LOG = logging.getLogger(__name__)

_SHARES = {"car": 0.64, "van": 0.13, "truck": 0.05, "bus": 0.05, "cyclist": 0.13}
_TOP_MPS = {"car": 40.0, "van": 38.0, "truck": 24.0, "bus": 22.0, "cyclist": 6.5}
_PLACE, _KIND, _WAY, _WALK = range(200, 204)
_FAST_MPS = 17.0
_FAR_LIKING = 0.05
_SAMPLE_M = 0.5
_CORNER_M = 1.0
_APART_M = 14.0
_CELL_M = 50.0


@dataclass(frozen=True, kw_only=True)
class TrafficSettings:
    """How much traffic there is: per square kilometre within `near_m` of the drive.

    `step_s` is the simulation's step and the clock of the tracks.
    """

    vehicles_per_km2: float = 70.0
    pedestrians_per_km2: float = 60.0
    near_m: float = 250.0
    step_s: float = 0.2


def plan_traffic(
    town: Town,
    drive: Drive,
    *,
    seed: int,
    settings: TrafficSettings | None = None,
    prototypes: tuple[Prototype, ...] | None = None,
) -> tuple[Mover, ...]:
    """Return everybody who moves while `drive` lasts; nobody's box ever touches another's or the radar car's.

    Instance ids go on from the town's. `prototypes` replaces `vehicle_prototypes()`.
    """
    settings = settings or TrafficSettings()
    kinds: dict[str, list[Prototype]] = {}
    for prototype in vehicle_prototypes() if prototypes is None else prototypes:
        kinds.setdefault(prototype.class_name, []).append(prototype)
    drivers = _drivers(town.roads, drive, kinds, seed=seed, settings=settings)
    walkers = _walkers(town.roads, drive, kinds, seed=seed, settings=settings)
    cast = [Mover(instance=0, prototype=kind, track=track) for kind, track in [*drivers, *walkers]]
    cast = _without_collisions(cast, drive)
    first = len(town.instance_class)
    return tuple(
        Mover(instance=first + number, prototype=mover.prototype, track=mover.track)
        for number, mover in enumerate(cast)
    )


def _stage_rng(seed: int, stage: int) -> np.random.Generator:
    return np.random.default_rng(np.random.SeedSequence([seed, stage]))


# ---------------------------------------------------------------------- where the drive passes


def _passed(drive: Drive) -> NDArray[np.float64]:
    """Return places (N, 2) [m] along the drive."""
    time = np.linspace(0.0, drive.duration_s, max(int(drive.length_m / 20.0), 1) + 1)
    return drive.pose(time)[:, :2]


def _near_km2(passed: NDArray[np.float64], near_m: float) -> float:
    """Return the area [km2] within `near_m` of the places `passed`."""
    axes = [
        np.arange(low - near_m, high + near_m, _CELL_M)
        for low, high in zip(passed.min(0), passed.max(0), strict=True)
    ]
    cells = np.stack(np.meshgrid(*axes), axis=-1).reshape(-1, 2)
    distance, _ = KDTree(passed).query(cells, distance_upper_bound=near_m)
    return float(np.isfinite(distance).sum() * _CELL_M**2 / 1e6)


# ---------------------------------------------------------------------- vehicles


def _drivers(
    roads: RoadGraph,
    drive: Drive,
    kinds: dict[str, list[Prototype]],
    *,
    seed: int,
    settings: TrafficSettings,
) -> list[tuple[Prototype, Trajectory]]:
    passed = _passed(drive)
    count = round(settings.vehicles_per_km2 * _near_km2(passed, settings.near_m))
    fast = np.median([lane.speed_limit_mps for lane in roads.lanes if lane.kind == "street"]) > _FAST_MPS
    names = [name for name in _SHARES if name in kinds and not (fast and name == "cyclist")]
    places = _free_places(roads, drive, passed, count, near_m=settings.near_m, rng=_stage_rng(seed, _PLACE))
    if not names or not len(places):
        return []
    rng = _stage_rng(seed, _KIND)
    share = np.array([_SHARES[name] for name in names])
    chosen = [names[k] for k in rng.choice(len(names), size=len(places), p=share / share.sum())]
    prototypes = [kinds[name][int(rng.integers(len(kinds[name])))] for name in chosen]
    fleet = Fleet(
        lane=places[:, 0].astype(np.intp),
        station_m=places[:, 1],
        length_m=np.array([prototype.extent_m[0] for prototype in prototypes]),
        top_mps=np.array([_TOP_MPS[name] for name in chosen]) * rng.uniform(0.75, 1.0, len(places)),
        zeal=rng.uniform(0.8, 1.0, len(places)),
        liking=_liking(roads, passed, settings.near_m),
    )
    record = flow(roads, drive, fleet, step_s=settings.step_s, rng=_stage_rng(seed, _WAY))
    return [
        (
            prototype,
            vehicle_track(
                roads,
                lanes,
                record.time_s,
                record.travel_m[:, row],
                record.speed_mps[:, row],
                length_m=prototype.extent_m[0],
            ),
        )
        for row, (prototype, lanes) in enumerate(zip(prototypes, record.lanes, strict=True))
    ]


def _free_places(
    roads: RoadGraph,
    drive: Drive,
    passed: NDArray[np.float64],
    count: int,
    *,
    near_m: float,
    rng: np.random.Generator,
) -> NDArray[np.float64]:
    """Draw up to `count` places (N, 2): lane and station [m], near the drive and clear of one another."""
    endless = LaneNetwork(roads).endless
    rows = []
    for lane in roads.lanes:
        if lane.kind == "street" and endless[lane.id]:
            along = np.arange(8.0, lane.length_m - 8.0, 4.0)
            points = lane.centre[np.linspace(0, len(lane.centre) - 1, len(along) + 2).astype(int)[1:-1]]
            rows.append(np.column_stack([np.full(len(along), lane.id), along, points]))
    places = np.concatenate(rows)
    distance, _ = KDTree(passed).query(places[:, 2:], distance_upper_bound=near_m)
    start = drive.pose(np.zeros(1))[0, :2]
    clear = np.isfinite(distance) & (np.linalg.norm(places[:, 2:] - start, axis=-1) > 2 * _APART_M)
    places = rng.permutation(places[clear])
    taken: list[NDArray[np.float64]] = []
    for place in places:
        if len(taken) >= count:
            break
        if all(np.hypot(*(place[2:] - other[2:])) > _APART_M for other in taken if other[0] == place[0]):
            taken.append(place)
    return np.array(taken).reshape(-1, 4)[:, :2]


def _liking(roads: RoadGraph, passed: NDArray[np.float64], near_m: float) -> NDArray[np.float64]:
    """Return weights (N,) of the lanes that keep traffic where the drive passes."""
    ends = np.array([lane.centre[-1] for lane in roads.lanes])
    distance, _ = KDTree(passed).query(ends)
    weight = np.where(distance < near_m, 1.0, _FAR_LIKING)
    return np.array([weight[[lane.id, *lane.successors]].min() for lane in roads.lanes])


def vehicle_track(
    roads: RoadGraph,
    lanes: tuple[int, ...],
    time_s: NDArray[np.float64],
    travel_m: NDArray[np.float64],
    speed_mps: NDArray[np.float64],
    *,
    length_m: float,
) -> Trajectory:
    """Put a vehicle of `length_m` on its `lanes`: both axles on the centre line, its middle between them."""
    used = np.cumsum([0.0, *(roads.lanes[lane].length_m for lane in lanes)])
    count = int(np.searchsorted(used, travel_m[-1] + length_m)) + 1
    uniform, line = joined_line([roads.lanes[lane] for lane in lanes[:count]], step_m=_SAMPLE_M)
    line = smoothed_line(line, sigma=_CORNER_M / uniform[1])
    half = max(round(0.3 * length_m / uniform[1]), 1)
    padded = np.pad(line, ((half, half), (0, 0)), mode="reflect", reflect_type="odd")
    chord = padded[2 * half :] - padded[: -2 * half]
    yaw = np.unwrap(np.arctan2(chord[:, 1], chord[:, 0]))
    middle = (padded[2 * half :] + padded[: -2 * half]) / 2
    spline = CubicSpline(uniform, np.column_stack([middle, np.zeros_like(yaw), yaw]))
    return Trajectory(time_s=time_s, state=spline(travel_m), rate=spline(travel_m, nu=1) * speed_mps[:, None])


# ---------------------------------------------------------------------- people


def _walkers(
    roads: RoadGraph,
    drive: Drive,
    kinds: dict[str, list[Prototype]],
    *,
    seed: int,
    settings: TrafficSettings,
) -> list[tuple[Prototype, Trajectory]]:
    if "pedestrian" not in kinds or not roads.walks:
        return []
    passed = _passed(drive)
    tree = KDTree(passed)
    near = tuple(
        walk
        for walk in roads.walks
        if np.isfinite(tree.query(walk, distance_upper_bound=settings.near_m)[0]).any()
    )
    count = round(settings.pedestrians_per_km2 * _near_km2(passed, settings.near_m))
    rng = _stage_rng(seed, _WALK)
    tracks = pedestrian_tracks(near, count, duration_s=drive.duration_s, rng=rng)
    return [(kinds["pedestrian"][int(rng.integers(len(kinds["pedestrian"])))], track) for track in tracks]


# ---------------------------------------------------------------------- the last check


def _without_collisions(cast: list[Mover], drive: Drive) -> list[Mover]:
    """Take out whoever touches the radar car, then of the others whoever touches most, people first."""
    found = overlaps(drive, cast, ego_extent_m=EGO_EXTENT_M, duration_s=drive.duration_s)
    pairs = {(int(a), int(b)) for a, b in zip(found.first, found.second, strict=True)}
    out = {b for a, b in pairs if a == EGO}
    while left := [pair for pair in pairs if EGO not in pair and not out & set(pair)]:
        touches = np.bincount(np.array(left).ravel(), minlength=len(cast)).astype(float)
        touches += [0.5 * (mover.prototype.class_name == "pedestrian") for mover in cast] * (touches > 0)
        out.add(int(touches.argmax()))
    if out:
        _LOG.info("took out %d of %d movers that could not keep clear", len(out), len(cast))
    return [mover for number, mover in enumerate(cast) if number not in out]
