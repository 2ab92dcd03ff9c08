"""Everybody else on the road: vehicles in the lanes and people on the pavements while the radar car drives.

`scenes.traffic.vehicles` and `scenes.traffic.pedestrians` make the tracks, and whoever could not keep clear of the others in
the end is taken out.
"""

import logging
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.spatial import KDTree

from echoscape.scenes.assets.vehicles import vehicle_prototypes
from echoscape.scenes.core.checks import check_between
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
    """How much traffic there is about the drive."""

    vehicles_per_km2: float = 70.0
    """Vehicles over the area near the drive, as far as there is room for them [1/km^2]."""
    pedestrians_per_km2: float = 60.0
    """People on foot over the area near the drive [1/km^2]."""
    near_m: float = 250.0
    """Distance from the drive that is near: others start there, and vehicles prefer to stay [m]."""
    step_s: float = 0.2
    """Step of the traffic's simulation and of the vehicles' tracks [s]."""

    def __post_init__(self) -> None:
        """Refuse crowds that no road has room for, naming the field."""
        check_between(
            self,
            vehicles_per_km2=(0, 1000),
            pedestrians_per_km2=(0, 5000),
            near_m=(1, 2000),
            step_s=(0.02, 1),
        )


def plan_traffic(
    town: Scene,
    drive: EgoDrive,
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
    passed = _passed(drive)
    near_km2 = _near_km2(passed, settings.near_m)
    drivers = vehicle_tracks(
        town.roads,
        drive,
        passed,
        kinds,
        count=round(settings.vehicles_per_km2 * near_km2),
        near_m=settings.near_m,
        step_s=settings.step_s,
        seed=seed,
    )
    walkers = _walkers(
        town.roads,
        drive,
        passed,
        kinds,
        count=round(settings.pedestrians_per_km2 * near_km2),
        near_m=settings.near_m,
        seed=seed,
    )
    cast = [Mover(instance=0, prototype=kind, track=track) for kind, track in [*drivers, *walkers]]
    cast = _without_collisions(cast, drive)
    first = len(town.instance_class)
    return tuple(
        Mover(instance=first + number, prototype=mover.prototype, track=mover.track)
        for number, mover in enumerate(cast)
    )


# ---------------------------------------------------------------------- where the drive passes


def _passed(drive: EgoDrive) -> NDArray[np.float64]:
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


# ---------------------------------------------------------------------- people


def _walkers(
    roads: RoadGraph,
    drive: EgoDrive,
    passed: NDArray[np.float64],
    kinds: dict[str, list[Prototype]],
    *,
    count: int,
    near_m: float,
    seed: int,
) -> list[tuple[Prototype, Trajectory]]:
    if "pedestrian" not in kinds or not roads.walks:
        return []
    tree = KDTree(passed)
    near = tuple(
        walk for walk in roads.walks if np.isfinite(tree.query(walk, distance_upper_bound=near_m)[0]).any()
    )
    rng = np.random.default_rng(np.random.SeedSequence([seed, _WALK]))
    tracks = pedestrian_tracks(near, count, duration_s=drive.duration_s, rng=rng)
    return [(kinds["pedestrian"][int(rng.integers(len(kinds["pedestrian"])))], track) for track in tracks]


# ---------------------------------------------------------------------- the last check


def _without_collisions(cast: list[Mover], drive: EgoDrive) -> list[Mover]:
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
