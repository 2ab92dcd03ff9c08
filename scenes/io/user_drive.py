"""Custom drives: timed poses, or way-points at constant speed, both interpolated smoothly.

The car pitches and rolls as on a road of the class given, or as its poses say.

Poses are interpolated by modified Akima splines, with which a stationary car stays stationary (scipy's
"makima"); way-points by a natural cubic spline over chord length, driven at constant speed with the heading
along the curve.
"""

import math
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray
from scipy.integrate import cumulative_simpson
from scipy.interpolate import Akima1DInterpolator, CubicSpline

from echoscape.scenes.core.attitude import STEEPEST_RAD, Attitude
from echoscape.scenes.core.headings import unwrapped_headings
from echoscape.scenes.core.trajectory import Trajectory
from echoscape.scenes.driving.body_motion import with_body_motion
from echoscape.scenes.driving.road_profile import ROUGHNESS_M3
from echoscape.scenes.io.strict_toml import SceneError, Table

POSE = ("t_s", "x_m", "y_m", "heading_deg")
ATTITUDE = ("pitch_deg", "roll_deg")
FASTEST_MPS = 100.0
HIGHEST_M = 10_000.0
"""Largest height of the ground below the car above or below 0 [m], that of mesh vertices."""

_KEYS = ("poses", "waypoints", "speed_mps", "z_m", "attitude", "road_class")

_KNOT_S = 0.05
_SAMPLE_M = 0.05
_MIN_DISTANCE_M = 0.01


@dataclass(frozen=True, kw_only=True)
class DrivePlan:
    """Description of a drive: poses or way-points.

    Attributes:
        poses: Rows of t [s], x, y [m] and yaw [deg], counter-clockwise from world x.
        waypoints: Rows of x, y [m].
        speed_mps: Speed along the way-points [m/s], 0 with poses.
        z_m: Height of the ground below the car [m], between -HIGHEST_M and HIGHEST_M.
        attitude: Rows of pitch, nose up, and roll, right side down [deg], one a pose; none for that of a car
            on its springs.
        road_class: Class of the road's roughness (ISO 8608), "A" the smoothest, or "smooth".
    """

    poses: tuple[tuple[float, ...], ...] = ()
    waypoints: tuple[tuple[float, ...], ...] = ()
    speed_mps: float = 0.0
    z_m: float = 0.0
    attitude: tuple[tuple[float, ...], ...] = ()
    road_class: str = "C"

    def __post_init__(self) -> None:
        """Check the height.

        Raises:
            ValueError: It is out of range.
        """
        if not abs(self.z_m) <= HIGHEST_M:
            raise ValueError(_height_refused(self.z_m))


@dataclass(frozen=True, kw_only=True)
class UserDrive:
    """A custom drive.

    Attributes:
        trajectory: Pose of the car over time.
        duration_s: Duration [s].
    """

    trajectory: Trajectory
    duration_s: float

    def pose(self, time_s: NDArray[np.float64]) -> NDArray[np.float64]:
        """Interpolate the pose of the car's centre on the ground.

        Args:
            time_s: Times (...) [s].

        Returns:
            x, y, z [m] and yaw [rad] (..., 4).
        """
        return self.trajectory.pose(time_s)


def read_drive_plan(table: Table) -> DrivePlan:
    """Read a `[drive]` table.

    Args:
        table: The table.

    Returns:
        The plan.

    Raises:
        SceneError: It has both poses and way-points or neither, too few of them, times that do not increase
            from 0, coincident points, a speed or height out of range, or an unknown key.
    """
    table.allow_only(_KEYS)
    poses, waypoints = "poses" in table, "waypoints" in table
    if poses == waypoints:
        raise table.error(f"one of poses and waypoints must be given, got {'both' if poses else 'neither'}")
    z_m = table.number("z_m", 0.0)
    if abs(z_m) > HIGHEST_M:
        raise table.error(_height_refused(z_m))
    road_class = table.string("road_class", DrivePlan.road_class, allowed=("smooth", *ROUGHNESS_M3))
    if poses:
        plan = DrivePlan(poses=table.rows("poses", POSE), z_m=z_m, road_class=road_class)
        _check_poses(table, np.array(plan.poses).reshape(-1, 4))
        if "attitude" in table:
            plan = replace(plan, attitude=table.rows("attitude", ATTITUDE))
            _check_attitude(table, plan)
    else:
        speed_mps = table.number("speed_mps")
        waypoints = table.rows("waypoints", ("x_m", "y_m"))
        plan = DrivePlan(waypoints=waypoints, speed_mps=speed_mps, z_m=z_m, road_class=road_class)
        _check_waypoints(table, np.array(plan.waypoints).reshape(-1, 2), speed_mps)
    table.reject_unknown_keys()
    return plan


def make_user_drive(plan: DrivePlan, *, seed: int) -> UserDrive:
    """Make the drive of a plan.

    Args:
        plan: The plan.
        seed: Decides the unevenness of the road.

    Returns:
        The drive.

    Raises:
        SceneError: The curve through the way-points reverses on the spot.
    """
    track = _through_poses(plan) if plan.poses else _along_waypoints(plan)
    roughness_m3 = ROUGHNESS_M3.get(plan.road_class, 0.0)
    track = with_body_motion(track, seed=seed, roughness_m3=roughness_m3)
    return UserDrive(trajectory=track, duration_s=float(track.time_s[-1]))


def _height_refused(z_m: float) -> str:
    """Return the message about a height out of range."""
    return f"z_m must be between -{HIGHEST_M:.0f} and {HIGHEST_M:.0f}, got {z_m:.6g}"


def _check_poses(table: Table, poses: NDArray[np.float64]) -> None:
    """Check number, times and speeds of poses."""
    if len(poses) < 2:
        raise table.error(f"poses must be two or more, got {len(poses)}")
    time = poses[:, 0]
    if time[0] != 0:
        raise table.error(f"poses must begin at t_s = 0, got {time[0]:g}")
    late = np.flatnonzero(np.diff(time) <= 0)
    if len(late):
        raise table.error(
            f"poses must be in order of time; t_s of row {late[0] + 2} is {time[late[0] + 1]:g} "
            f"after {time[late[0]]:g}"
        )
    speed = np.hypot(*np.diff(poses[:, 1:3], axis=0).T) / np.diff(time)
    if speed.max() > FASTEST_MPS:
        row = int(speed.argmax()) + 2
        raise table.error(
            f"poses must be driven at {FASTEST_MPS:g} m/s or less; row {row} is reached at "
            f"{speed.max():.0f} m/s"
        )


def _check_attitude(table: Table, plan: DrivePlan) -> None:
    """Check number and size of pitch and roll."""
    if len(plan.attitude) != len(plan.poses):
        raise table.error(
            f"attitude must have a row for each of the {len(plan.poses)} poses, got {len(plan.attitude)}"
        )
    most = math.degrees(STEEPEST_RAD)
    for number, row in enumerate(plan.attitude, 1):
        if max(map(abs, row)) > most:
            raise table.error(
                f"attitude must be between -{most:.1f} and {most:.1f} deg; row {number} is {list(row)}"
            )


def _check_waypoints(table: Table, points: NDArray[np.float64], speed_mps: float) -> None:
    """Check number, distances and speed of way-points."""
    if len(points) < 2:
        raise table.error(f"waypoints must be two or more, got {len(points)}")
    if not 0 < speed_mps <= FASTEST_MPS:
        raise table.error(f"speed_mps must be above 0 and at most {FASTEST_MPS:g}, got {speed_mps:g}")
    near = np.flatnonzero(np.hypot(*np.diff(points, axis=0).T) < _MIN_DISTANCE_M)
    if len(near):
        raise table.error(
            f"waypoints must be {_MIN_DISTANCE_M:g} m apart or more; row {near[0] + 2} is nearer"
        )


def _through_poses(plan: DrivePlan) -> Trajectory:
    """Return the trajectory through poses."""
    time, x, y, heading = np.array(plan.poses).T
    z = np.full_like(time, plan.z_m)
    state = np.stack([x, y, z, np.unwrap(np.deg2rad(heading))], axis=-1)
    attitude = None
    if plan.attitude:
        angle = np.deg2rad(plan.attitude)
        attitude = Attitude(time_s=time, angle_rad=angle, rate_rps=_smooth_rate(time, angle))
    return Trajectory(time_s=time, state=state, rate=_smooth_rate(time, state), attitude=attitude)


def _smooth_rate(time: NDArray[np.float64], values: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return the derivative of values (K, ...) at their times by modified Akima splines."""
    return Akima1DInterpolator(time, values, axis=0, method="makima")(time, nu=1)


def _along_waypoints(plan: DrivePlan) -> Trajectory:
    """Return the trajectory along a spline through way-points."""
    points = np.array(plan.waypoints)
    chord = np.append(0.0, np.cumsum(np.hypot(*np.diff(points, axis=0).T)))
    curve = CubicSpline(chord, points, bc_type="natural")
    fine = np.linspace(0.0, chord[-1], int(np.ceil(chord[-1] / _SAMPLE_M)) + 2)
    pace = np.hypot(*curve(fine, nu=1).T)
    if pace.min() < 1e-3:
        raise SceneError("waypoints: the path through them turns back on the spot; give points on the turn")
    arc = cumulative_simpson(pace, x=fine, initial=0.0)
    duration_s = float(arc[-1] / plan.speed_mps)
    time = np.linspace(0.0, duration_s, int(np.ceil(duration_s / _KNOT_S)) + 1)
    at = np.interp(time * plan.speed_mps, arc, fine)
    first, second = curve(at, nu=1), curve(at, nu=2)
    pace = np.hypot(*first.T)
    turn = (first[:, 0] * second[:, 1] - first[:, 1] * second[:, 0]) / pace**2
    flat = np.zeros_like(time)
    yaw = unwrapped_headings(first)
    state = np.stack([*curve(at).T, flat + plan.z_m, yaw], axis=-1)
    rate = np.stack([*first.T, flat, turn], axis=-1) * (plan.speed_mps / pace)[:, None]
    rate[:, 2] = 0.0
    return Trajectory(time_s=time, state=state, rate=rate)
