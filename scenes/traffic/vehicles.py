"""Draws the vehicles at the start, and converts their simulated motion to trajectories.

Vehicles start at free places near the ego drive; long ones keep to lanes that are wide enough for their swept
path.
"""

import numpy as np
from numpy.typing import NDArray
from scipy.interpolate import CubicSpline
from scipy.spatial import KDTree

from echoscape.scenes.core.lane_graph import RoadGraph
from echoscape.scenes.core.scene import Prototype
from echoscape.scenes.core.trajectory import Trajectory
from echoscape.scenes.driving.ego_drive import EgoDrive
from echoscape.scenes.driving.lane_path import CORNER_SIGMA_M, joined_line, smoothed_line
from echoscape.scenes.driving.route import LaneNetwork
from echoscape.scenes.traffic.microsimulation import Fleet, simulate_traffic
from echoscape.scenes.traffic.swept_path import AXLE_SHARE, SweptPaths, chords

_SHARES = {"car": 0.64, "van": 0.13, "truck": 0.05, "bus": 0.05, "cyclist": 0.13}
_TOP_MPS = {"car": 40.0, "van": 38.0, "truck": 24.0, "bus": 22.0, "cyclist": 6.5}
_PLACE, _KIND, _WAY = range(200, 203)
_FAST_MPS = 17.0
_FAR_WEIGHT = 0.05
_SAMPLE_M = 0.5
_APART_M = 14.0
_LONG_M = 7.0


def vehicle_tracks(
    roads: RoadGraph,
    drive: EgoDrive,
    drive_points: NDArray[np.float64],
    kinds: dict[str, list[Prototype]],
    *,
    count: int,
    near_m: float,
    step_s: float,
    seed: int,
) -> list[tuple[Prototype, Trajectory]]:
    """Draw vehicles near the drive and simulate them.

    Args:
        roads: The road graph.
        drive: The drive of the ego vehicle.
        drive_points: Points along the drive (P, 2) [m].
        kinds: Prototypes by class.
        count: Largest number of vehicles.
        near_m: Distance from the drive within which vehicles start [m].
        step_s: Time step of the simulation [s].
        seed: Seed of everything that is drawn.

    Returns:
        Prototype and trajectory of each vehicle.
    """
    network = LaneNetwork(roads)
    places = _free_places(network, drive, drive_points, count, near_m=near_m, rng=_stage_rng(seed, _PLACE))
    rng = _stage_rng(seed, _KIND)
    served, chosen = _drawn_vehicles(network, places[:, 0].astype(np.intp), kinds, rng)
    if not chosen:
        return []
    places = places[served]
    prototypes = [prototype for prototype, _ in chosen]
    top = np.array([_TOP_MPS[prototype.class_name] for prototype in prototypes])
    fleet = Fleet(
        lane=places[:, 0].astype(np.intp),
        station_m=places[:, 1],
        length_m=np.array([prototype.extent_m[0] for prototype in prototypes]),
        max_speed_mps=top * rng.uniform(0.75, 1.0, len(places)),
        speed_factor=rng.uniform(0.8, 1.0, len(places)),
        lane_weight=_preference(roads, drive_points, near_m),
        may_use=np.array([may_use for _, may_use in chosen]),
    )
    record = simulate_traffic(roads, drive, fleet, step_s=step_s, rng=_stage_rng(seed, _WAY))
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


def _stage_rng(seed: int, stage: int) -> np.random.Generator:
    return np.random.default_rng(np.random.SeedSequence([seed, stage]))


def _free_places(
    network: LaneNetwork,
    drive: EgoDrive,
    drive_points: NDArray[np.float64],
    count: int,
    *,
    near_m: float,
    rng: np.random.Generator,
) -> NDArray[np.float64]:
    """Draw up to `count` places (N, 2), lane and station [m], near the drive and apart from each other."""
    rows = []
    for lane in network.lanes:
        if lane.kind == "street" and network.connected[lane.id]:
            along = np.arange(8.0, lane.length_m - 8.0, 4.0)
            points = lane.centre[np.linspace(0, len(lane.centre) - 1, len(along) + 2).astype(int)[1:-1]]
            rows.append(np.column_stack([np.full(len(along), lane.id), along, points]))
    places = np.concatenate(rows)
    distance, _ = KDTree(drive_points).query(places[:, 2:], distance_upper_bound=near_m)
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


def _drawn_vehicles(
    network: LaneNetwork,
    lanes: NDArray[np.intp],
    kinds: dict[str, list[Prototype]],
    rng: np.random.Generator,
) -> tuple[NDArray[np.bool_], list[tuple[Prototype, NDArray[np.bool_]]]]:
    """Return in which of `lanes` (M,) a vehicle can start, and vehicles with the lanes (N,) they may use.

    The prototypes of a class that fit a lane share the probability of the class.
    """
    fast = np.median([lane.speed_limit_mps for lane in network.lanes if lane.kind == "street"]) > _FAST_MPS
    names = [name for name in _SHARES if name in kinds and not (fast and name == "cyclist")]
    swept = SweptPaths(network)
    if not names or not len(lanes):
        return np.zeros(len(lanes), dtype=bool), []
    choice = [
        (name, kind, _may_use(kind, network.connected, swept)) for name in names for kind in kinds[name]
    ]
    fits = np.array([may_use[lanes] for _, _, may_use in choice]).reshape(len(choice), len(lanes))
    alike = np.array([[name == other for name, _, _ in choice] for other, _, _ in choice], dtype=float)
    share = np.array([_SHARES[name] for name, _, _ in choice])
    odds = np.cumsum(share[:, None] * fits / np.maximum(alike @ fits, 1), axis=0)
    served = odds[-1] > 0
    rows = (odds <= rng.random(len(lanes)) * odds[-1]).sum(axis=0)[served]
    return served, [choice[row][1:] for row in rows.tolist()]


def _may_use(kind: Prototype, connected: NDArray[np.bool_], swept: SweptPaths) -> NDArray[np.bool_]:
    """Return the lanes (N,) that a prototype may use."""
    length, width, _ = kind.extent_m
    return swept.drivable_lanes(length, width) if length > _LONG_M else connected


def _preference(roads: RoadGraph, drive_points: NDArray[np.float64], near_m: float) -> NDArray[np.float64]:
    """Return weights (N,) of the lanes that keep traffic near the drive."""
    ends = np.array([lane.centre[-1] for lane in roads.lanes])
    distance, _ = KDTree(drive_points).query(ends)
    weight = np.where(distance < near_m, 1.0, _FAR_WEIGHT)
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
    """Return the trajectory of a vehicle whose axles follow the centre line of its lanes.

    Args:
        roads: The road graph.
        lanes: Ids of the lanes in the order driven.
        time_s: Times (T,) [s].
        travel_m: Distance from the beginning of the first lane (T,) [m].
        speed_mps: Speed (T,) [m/s].
        length_m: Length of the vehicle [m].

    Returns:
        The trajectory of its centre.
    """
    used = np.cumsum([0.0, *(roads.lanes[lane].length_m for lane in lanes)])
    count = int(np.searchsorted(used, travel_m[-1] + length_m)) + 1
    uniform, line = joined_line([roads.lanes[lane] for lane in lanes[:count]], step_m=_SAMPLE_M)
    line = smoothed_line(line, sigma=CORNER_SIGMA_M / uniform[1])
    half = max(round(AXLE_SHARE * length_m / uniform[1]), 1)
    padded = np.pad(line, ((half, half), (0, 0)), mode="reflect", reflect_type="odd")
    middle, yaw = chords(padded, half)
    spline = CubicSpline(uniform, np.column_stack([middle, np.zeros_like(yaw), yaw]))
    return Trajectory(time_s=time_s, state=spline(travel_m), rate=spline(travel_m, nu=1) * speed_mps[:, None])
