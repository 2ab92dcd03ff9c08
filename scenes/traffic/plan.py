"""Plans all other road users, vehicles in the lanes and pedestrians on the pavements, for an ego drive.

Those that could not avoid a collision are removed at the end.
"""

import logging
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.spatial import KDTree

from echoscape.scenes.assets.vehicles import vehicle_prototypes
from echoscape.scenes.core.checks import check_between, check_whole
from echoscape.scenes.core.lane_graph import RoadGraph
from echoscape.scenes.core.scene import Mover, Prototype, Scene
from echoscape.scenes.core.trajectory import Trajectory
from echoscape.scenes.driving.ego_drive import EGO_EXTENT_M, EgoDrive
from echoscape.scenes.traffic.collisions import EGO, overlaps
from echoscape.scenes.traffic.pedestrians import pedestrian_tracks
from echoscape.scenes.traffic.vehicles import vehicle_tracks

_LOG = logging.getLogger(__name__)

_WALK = 203
_CELL_M = 50.0


@dataclass(frozen=True, kw_only=True)
class TrafficSettings:
    """Density and extent of the traffic around the drive."""

    vehicles_per_km2: float = 70.0
    """Density of vehicles near the drive, as far as there is space for them [1/km^2]."""
    pedestrians_per_km2: float = 60.0
    """Density of pedestrians near the drive [1/km^2]."""
    near_m: float = 250.0
    """Distance from the drive within which movers start and vehicles prefer to stay [m]."""
    step_s: float = 0.2
    """Time step of the traffic simulation and of the vehicles' trajectories [s]."""

    def __post_init__(self) -> None:
        """Check the ranges of the fields.

        Raises:
            ValueError: A field is out of range; the message names it.
        """
        check_between(
            self,
            vehicles_per_km2=(0, 1000),
            pedestrians_per_km2=(0, 5000),
            near_m=(1, 2000),
            step_s=(0.02, 1),
        )


def plan_traffic(
    scene: Scene,
    drive: EgoDrive,
    *,
    seed: int,
    settings: TrafficSettings | None = None,
    prototypes: tuple[Prototype, ...] | None = None,
) -> tuple[Mover, ...]:
    """Plan all movers for the duration of a drive; no box ever overlaps another or the ego vehicle.

    Args:
        scene: The scene.
        drive: The drive of the ego vehicle.
        seed: Seed of everything that is drawn.
        settings: Density of the traffic; None for the default.
        prototypes: Shapes of the movers; None for `vehicle_prototypes()`.

    Returns:
        The movers; their instance ids follow those of the scene.

    Raises:
        ValueError: The seed is no whole number of 0 or more.
    """
    check_whole(seed=seed)
    settings = settings or TrafficSettings()
    kinds: dict[str, list[Prototype]] = {}
    for prototype in vehicle_prototypes() if prototypes is None else prototypes:
        kinds.setdefault(prototype.class_name, []).append(prototype)
    drive_points = _drive_points(drive)
    near_km2 = _near_km2(drive_points, settings.near_m)
    vehicles = vehicle_tracks(
        scene.roads,
        drive,
        drive_points,
        kinds,
        count=round(settings.vehicles_per_km2 * near_km2),
        near_m=settings.near_m,
        step_s=settings.step_s,
        seed=seed,
    )
    pedestrians = _pedestrians(
        scene.roads,
        drive,
        drive_points,
        kinds,
        count=round(settings.pedestrians_per_km2 * near_km2),
        near_m=settings.near_m,
        seed=seed,
    )
    movers = [Mover(instance=0, prototype=kind, track=track) for kind, track in [*vehicles, *pedestrians]]
    movers = _without_collisions(movers, drive)
    first = len(scene.instance_class)
    return tuple(
        Mover(instance=first + number, prototype=mover.prototype, track=mover.track)
        for number, mover in enumerate(movers)
    )


def _drive_points(drive: EgoDrive) -> NDArray[np.float64]:
    """Return points (N, 2) [m] along the drive."""
    time = np.linspace(0.0, drive.duration_s, max(int(drive.length_m / 20.0), 1) + 1)
    return drive.pose(time)[:, :2]


def _near_km2(drive_points: NDArray[np.float64], near_m: float) -> float:
    """Return the area within `near_m` of the points [km^2]."""
    axes = [
        np.arange(low - near_m, high + near_m, _CELL_M)
        for low, high in zip(drive_points.min(0), drive_points.max(0), strict=True)
    ]
    cells = np.stack(np.meshgrid(*axes), axis=-1).reshape(-1, 2)
    distance, _ = KDTree(drive_points).query(cells, distance_upper_bound=near_m)
    return float(np.isfinite(distance).sum() * _CELL_M**2 / 1e6)


def _pedestrians(
    roads: RoadGraph,
    drive: EgoDrive,
    drive_points: NDArray[np.float64],
    kinds: dict[str, list[Prototype]],
    *,
    count: int,
    near_m: float,
    seed: int,
) -> list[tuple[Prototype, Trajectory]]:
    """Draw pedestrians on the footpaths near the drive."""
    if "pedestrian" not in kinds or not roads.footpaths:
        return []
    tree = KDTree(drive_points)
    near = tuple(
        walk
        for walk in roads.footpaths
        if np.isfinite(tree.query(walk, distance_upper_bound=near_m)[0]).any()
    )
    rng = np.random.default_rng(np.random.SeedSequence([seed, _WALK]))
    tracks = pedestrian_tracks(near, count, duration_s=drive.duration_s, rng=rng)
    return [(kinds["pedestrian"][int(rng.integers(len(kinds["pedestrian"])))], track) for track in tracks]


def _without_collisions(movers: list[Mover], drive: EgoDrive) -> list[Mover]:
    """Remove movers that overlap the ego vehicle, then those with the most overlaps, pedestrians first."""
    found = overlaps(drive, movers, ego_extent_m=EGO_EXTENT_M, duration_s=drive.duration_s)
    pairs = {(int(a), int(b)) for a, b in zip(found.first, found.second, strict=True)}
    out = {b for a, b in pairs if a == EGO}
    while left := [pair for pair in pairs if EGO not in pair and not out & set(pair)]:
        touches = np.bincount(np.array(left).ravel(), minlength=len(movers)).astype(float)
        touches += [0.5 * (mover.prototype.class_name == "pedestrian") for mover in movers] * (touches > 0)
        out.add(int(touches.argmax()))
    if out:
        _LOG.info("removed %d of %d movers that could not avoid a collision", len(out), len(movers))
    return [mover for number, mover in enumerate(movers) if number not in out]
