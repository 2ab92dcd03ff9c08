"""The drive of the ego vehicle, which carries the radar: route, smooth path, speed, and pose at any time.

The car follows a single-track model: its rear axle, `rear_axle_m` behind the middle, does not slip, so the
middle moves slightly sideways in bends (Rajamani, Vehicle Dynamics and Control, 2012, section 2.2).
"""

from dataclasses import dataclass, field, replace

import numpy as np
from numpy.typing import NDArray
from scipy.interpolate import CubicHermiteSpline
from scipy.optimize import root_scalar

from echoscape.scenes.core import portable_math
from echoscape.scenes.core.checks import check_between, check_whole
from echoscape.scenes.core.lane_graph import RoadGraph
from echoscape.scenes.core.scene import Scene
from echoscape.scenes.core.trajectory import Trajectory
from echoscape.scenes.driving.body_motion import with_body_motion
from echoscape.scenes.driving.lane_path import LanePath, smooth_path
from echoscape.scenes.driving.route import Route, RouteSettings, plan_route
from echoscape.scenes.driving.speed_profile import (
    SpeedSettings,
    Stops,
    Timing,
    speed_caps,
    speed_profile,
    timing,
)

LENGTH_RANGE_M = (10.0, 20_000.0)
"""Shortest and longest drive [m]."""
DURATION_RANGE_S = (0.5, 7_200.0)
"""Shortest and longest drive [s]."""
EGO_EXTENT_M = (4.8, 2.0, 1.5)
"""Length, width and height of the ego vehicle [m]."""
ROUGHNESS_M3 = {"street": 400e-6, "fast": 256e-6}
"""Degree of roughness (ISO 8608) of streets, and of roads outside towns: both class C. Calibrated to the
pitch and roll of real cars on flat roads (docs/physics.md); includes manholes, ramps and crossfall [m^3]."""

_STEP_M = 0.25
_SPARE_M = 80.0
_ROUTE, _WANDER, _CAPS, _STOPS, _ACCELERATION = range(100, 105)


@dataclass(frozen=True, kw_only=True)
class DriveSettings:
    """Settings of a drive."""

    route: RouteSettings = field(default_factory=RouteSettings)
    """Choice of streets."""
    speed: SpeedSettings = field(default_factory=SpeedSettings)
    """Speed along them."""
    knot_s: float = 0.05
    """Time step of the trajectory [s]."""
    corner_m: float = 1.0
    """Standard deviation of the Gaussian along the path that smooths corners [m]."""
    wander_m: float = 0.08
    """Lateral deviation within the lane, rms [m]."""
    wander_length_m: float = 12.0
    """Correlation length of the lateral deviation, standard deviation of its Gaussian [m]."""
    rear_axle_m: float = 0.9
    """Distance of the rear axle, which does not slip, behind the car's middle [m]."""
    stop_line_m: float = 4.4
    """Distance from the middle of a stopped car to the end of its lane [m]."""
    free_start_m: float = 25.0
    """Distance from the start within which the car does not stop [m]."""
    road_roughness: float = 1.0
    """Roughness of all roads relative to the default [1]: 0 is smooth, 12 gives the pitch and roll measured
    on a campus with speed bumps."""

    def __post_init__(self) -> None:
        """Check the ranges of the fields.

        Raises:
            ValueError: A field is out of range; the message names it.
        """
        check_between(
            self,
            knot_s=(0.005, 0.5),
            corner_m=(0.05, 20),
            wander_m=(0, 2),
            wander_length_m=(0.1, 1000),
            road_roughness=(0, 64),
        )


@dataclass(frozen=True, kw_only=True)
class EgoDrive:
    """A planned drive.

    Attributes:
        trajectory: Pose of the car over time.
        route: Lanes driven.
        travel_m: Distance along the route's lanes at the knots of the trajectory (K,) [m], see
            `Route.locate`.
        duration_s: Duration [s].
        length_m: Length of the path driven [m].
    """

    trajectory: Trajectory
    route: Route
    travel_m: NDArray[np.float64]
    duration_s: float
    length_m: float

    def pose(self, time_s: NDArray[np.float64]) -> NDArray[np.float64]:
        """Interpolate the pose of the car's centre on the ground.

        Args:
            time_s: Times (...) [s].

        Returns:
            x, y, z [m] and yaw [rad] (..., 4).
        """
        return self.trajectory.pose(time_s)

    def velocity(self, time_s: NDArray[np.float64]) -> NDArray[np.float64]:
        """Interpolate the velocity in the world frame.

        Args:
            time_s: Times (...) [s].

        Returns:
            vx, vy, vz [m/s] and yaw rate [rad/s] (..., 4).
        """
        return self.trajectory.velocity(time_s)

    def travel(self, time_s: NDArray[np.float64]) -> NDArray[np.float64]:
        """Interpolate the distance along the lanes of the route.

        Args:
            time_s: Times (...) [s].

        Returns:
            Distance from the beginning of the first lane (...) [m].
        """
        return np.interp(time_s, self.trajectory.time_s, self.travel_m)


def plan_ego_drive(
    scene: Scene | RoadGraph,
    *,
    seed: int,
    duration_s: float | None = None,
    length_m: float | None = None,
    settings: DriveSettings | None = None,
) -> EgoDrive:
    """Plan a drive of given duration or length through the lanes of a scene.

    Args:
        scene: The scene or its road graph.
        seed: Seed of everything that is drawn.
        duration_s: Duration [s], within `DURATION_RANGE_S`.
        length_m: Length [m], within `LENGTH_RANGE_M`.
        settings: Settings of the drive; None for the default.

    Returns:
        The drive.

    Raises:
        ValueError: Not exactly one of `duration_s` and `length_m` is given, or it is out of range; or the
            seed is no whole number of 0 or more.
    """
    check_whole(seed=seed)
    _check_span(duration_s, length_m)
    settings = settings or DriveSettings()
    roads = scene.roads if isinstance(scene, Scene) else scene
    furthest = length_m or (duration_s or 0.0) * max(lane.speed_limit_mps for lane in roads.lanes)
    rng = {stage: _stage_rng(seed, stage) for stage in (_ROUTE, _WANDER, _CAPS, _STOPS, _ACCELERATION)}
    spare = _SPARE_M + 0.05 * furthest
    route = plan_route(roads, length_m=furthest + spare, rng=rng[_ROUTE], settings=settings.route)
    path = smooth_path(
        [roads.lanes[lane] for lane in route.lanes],
        from_m=route.start_m,
        step_m=_STEP_M,
        sigma_m=settings.corner_m,
        wander_m=settings.wander_m,
        wander_length_m=settings.wander_length_m,
        rng=rng[_WANDER],
    )
    limit = np.array([roads.lanes[lane].speed_limit_mps for lane in route.lanes])[
        route.locate(path.travel_m)[0]
    ]
    speed = settings.speed
    caps = speed_caps(path.curvature, limit, step_m=_STEP_M, settings=speed, rng=rng[_CAPS])
    stops = _stops(roads, route, path, settings=settings, rng=rng[_STOPS])
    profile = speed_profile(caps, stops, step_m=_STEP_M, settings=speed, rng=rng[_ACCELERATION])
    clock = timing(profile, stops, step_m=_STEP_M, settings=speed, clock_s=settings.knot_s)
    drive = _driven(route, path, clock, duration_s=duration_s, length_m=length_m, settings=settings)
    limit = np.interp(drive.travel_m, path.travel_m, limit)
    street, fast = ROUGHNESS_M3["street"], ROUGHNESS_M3["fast"]
    rough = settings.road_roughness * np.where(limit > speed.open_limit_mps, fast, street)
    return replace(drive, trajectory=with_body_motion(drive.trajectory, seed=seed, roughness_m3=rough))


def _check_span(duration_s: float | None, length_m: float | None) -> None:
    """Check that exactly one of duration and length is given and within its range."""
    if (duration_s is None) == (length_m is None):
        raise ValueError(
            f"exactly one of duration_s and length_m must be given, got {duration_s} and {length_m}"
        )
    for name, value, (low, high) in (
        ("duration_s", duration_s, DURATION_RANGE_S),
        ("length_m", length_m, LENGTH_RANGE_M),
    ):
        if value is not None and not low <= value <= high:
            raise ValueError(f"{name} must be in [{low:g}, {high:g}], got {value}")


def _stage_rng(seed: int, stage: int) -> np.random.Generator:
    return np.random.default_rng(np.random.SeedSequence([seed, stage]))


def _stops(
    roads: RoadGraph, route: Route, path: LanePath, *, settings: DriveSettings, rng: np.random.Generator
) -> Stops:
    """Draw stops at the ends of street lanes, as for traffic signals and traffic with the right of way."""
    speed = settings.speed
    lanes = [roads.lanes[lane] for lane in route.lanes]
    chance = np.array([speed.yield_chance if lane.yields else speed.stop_chance for lane in lanes])
    chance[[lane.kind != "street" for lane in lanes]] = 0.0
    halts = rng.random(len(lanes)) < chance
    dwell = np.clip(rng.exponential(speed.stop_s, len(lanes)), *speed.stop_range_s)
    at = np.maximum(route.ends_m - settings.stop_line_m, route.begins_m)
    arc = np.interp(at, path.travel_m, _STEP_M * np.arange(len(path.xy)))
    halts &= (arc > settings.free_start_m) & (at < path.travel_m[-1])
    return Stops(arc_m=arc[halts], dwell_s=dwell[halts])


def _driven(
    route: Route,
    path: LanePath,
    clock: Timing,
    *,
    duration_s: float | None,
    length_m: float | None,
    settings: DriveSettings,
) -> EgoDrive:
    """Cut the timing to the duration or length asked for and put the car on the path at every knot."""
    course = CubicHermiteSpline(clock.time_s, clock.arc_m, clock.speed_mps)
    if duration_s is None:
        duration_s = _when(course, length_m or 0.0)
    time = np.linspace(0.0, duration_s, max(int(np.ceil(duration_s / settings.knot_s)), 1) + 1)
    arc, speed = course(time), course(time, nu=1)
    trajectory = _on_path(path, time, arc, speed, rear_axle_m=settings.rear_axle_m)
    travel = np.interp(arc, path.step_m * np.arange(len(path.xy)), path.travel_m)
    count = int(np.searchsorted(route.ends_m, travel[-1])) + 1
    driven = Route(
        lanes=route.lanes[:count],
        ends_m=route.ends_m[:count],
        start_m=route.start_m,
        length_m=float(travel[-1] - route.start_m),
    )
    return EgoDrive(
        trajectory=trajectory,
        route=driven,
        travel_m=travel,
        duration_s=duration_s,
        length_m=float(arc[-1] - arc[0]),
    )


def _when(course: CubicHermiteSpline, arc_m: float) -> float:
    """Return the first time [s] at which the non-decreasing `course` reaches `arc_m`."""
    late = int(np.argmax(course(course.x) >= arc_m))
    bracket = (course.x[max(late - 1, 0)], course.x[late])
    return float(root_scalar(lambda time: course(time) - arc_m, bracket=bracket, xtol=1e-12).root)


def _on_path(
    path: LanePath,
    time: NDArray[np.float64],
    arc: NDArray[np.float64],
    speed: NDArray[np.float64],
    *,
    rear_axle_m: float,
) -> Trajectory:
    """Return the trajectory through arc lengths `arc` (K,) [m] at speeds `speed` (K,) [m/s]."""
    yaw = trailing_yaw(path, rear_axle_m=rear_axle_m)
    yaw_slope = (path.heading - yaw) / rear_axle_m
    samples = path.step_m * np.arange(len(path.xy))
    flat = np.zeros_like(samples)
    place = np.stack([*path.xy.T, flat, yaw], axis=-1)
    slope = np.stack([np.cos(path.heading), np.sin(path.heading), flat, yaw_slope], axis=-1)
    spline = CubicHermiteSpline(samples, place, slope)
    return Trajectory(time_s=time, state=spline(arc), rate=spline(arc, nu=1) * speed[:, None])


def trailing_yaw(path: LanePath, *, rear_axle_m: float) -> NDArray[np.float64]:
    """Return the yaw of the car along a path, from the single-track model.

    d yaw / d arc = (heading - yaw) / rear_axle_m for small slip angles, solved exactly for a heading that is
    linear between samples (Rajamani 2012, section 2.2).

    Args:
        path: Path of the car's middle, S samples.
        rear_axle_m: Distance of the rear axle behind the middle [m].

    Returns:
        Yaw (S,) [rad].
    """
    from scipy.signal import lfilter  # slow to import; a drive that is known needs none

    ratio = path.step_m / rear_axle_m
    decay = portable_math.exp(-ratio)
    mean = (1 - decay) / ratio
    start = path.heading[0] - rear_axle_m * path.curvature[0]
    yaw, _ = lfilter(
        [1 - mean, mean - decay],
        [1.0, -decay],
        path.heading[1:],
        zi=[decay * start + (mean - decay) * path.heading[0]],
    )
    return np.concatenate([[start], yaw])
