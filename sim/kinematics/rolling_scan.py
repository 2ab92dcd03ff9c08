"""When each azimuth of a scan is measured, and where the antenna and the moving objects are then.

Vehicle and radar share a heading. Azimuth grows clockwise from straight ahead, so in the world (z up, yaw
counter-clockwise) azimuth i looks along yaw - `Sensor.azimuth_rad[i]`, tilted with the body. The time of an
azimuth is the middle of its sweep.
"""

import math
from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from echoscape.scenes.core.attitude import body_axes
from echoscape.scenes.core.scene import Mover
from echoscape.scenes.core.trajectory import Trajectory
from echoscape.sim.sensor.sensor import Sensor

LONGEST_DEVIATION = 2.5
"""Standard deviations of the duration of a revolution at which its distribution is cut off."""
TILT_CENTRE_M = 0.5
"""Height about which the body pitches and rolls: between the roll centre, near the ground, and the centre of
mass of a passenger car (Gillespie, Fundamentals of Vehicle Dynamics, 1992, ch. 6-7) [m]."""


@dataclass(frozen=True, kw_only=True)
class Revolution:
    """The times of one scan, which is one revolution of the antenna.

    Attributes:
        start_s: Time of the first azimuth [s].
        azimuth_period_s: Time from one azimuth to the next [s].
        azimuths: Number of azimuths.
    """

    start_s: float
    azimuth_period_s: float
    azimuths: int

    @property
    def times_s(self) -> NDArray[np.float64]:
        """Times of the azimuths (azimuths,) [s]."""
        return self.start_s + self.azimuth_period_s * np.arange(self.azimuths, dtype=np.float64)

    @property
    def middle_s(self) -> float:
        """Time that the pose of the scan refers to: half way between first and last azimuth [s]."""
        return self.start_s + self.azimuth_period_s * (self.azimuths - 1) / 2


def revolutions(sensor: Sensor, *, scans: int, rng: np.random.Generator) -> list[Revolution]:
    """Draw the times of successive scans, the first of which starts at 0 s.

    The duration of each revolution is drawn independently. The first n scans do not depend on `scans`.

    Args:
        sensor: The radar, which gives the mean and the standard deviation of the duration.
        scans: Number of scans.
        rng: Draws the durations.

    Returns:
        The revolutions, in order.
    """
    nominal = 1 / sensor.rotation_hz
    draws = np.clip(rng.standard_normal(scans), -LONGEST_DEVIATION, LONGEST_DEVIATION)
    durations = nominal + draws * sensor.rotation_jitter_s
    starts = np.append(0.0, np.cumsum(durations)[:-1])
    return [
        Revolution(
            start_s=float(start),
            azimuth_period_s=float(duration) / sensor.azimuths,
            azimuths=sensor.azimuths,
        )
        for start, duration in zip(starts, durations, strict=True)
    ]


@dataclass(frozen=True, kw_only=True)
class AzimuthPoses:
    """The motion of the antenna through one scan, in the world frame.

    Attributes:
        position: Position at each azimuth (A, 3) float64 [m].
        yaw: Heading of the vehicle at each azimuth (A,) float64 [rad].
        tilt: Pitch, nose up, and roll, right side down, at each azimuth (A, 2) float64 [rad].
        velocity: Velocity at each azimuth (A, 3) float64 [m/s].
        azimuth_period_s: Time from one azimuth to the next [s], 0 where all stand for mid-scan.
    """

    position: NDArray[np.float64]
    yaw: NDArray[np.float64]
    tilt: NDArray[np.float64]
    velocity: NDArray[np.float64]
    azimuth_period_s: float

    @cached_property
    def axes(self) -> NDArray[np.float64]:
        """Axes of the antenna: forward, to the right and up at each azimuth (A, 3, 3), in the world."""
        return body_axes(self.yaw, self.tilt)


def sweep_times(revolution: Revolution, distortion: float) -> NDArray[np.float64]:
    """Return the times at which the azimuths are measured, contracted towards mid-scan.

    Args:
        revolution: The times of the scan.
        distortion: Share of the duration of the scan over which the azimuths spread, 0 to 1.

    Returns:
        Times (azimuths,) [s].
    """
    if distortion == 1:
        return revolution.times_s
    return revolution.middle_s + distortion * (revolution.times_s - revolution.middle_s)


def azimuth_poses(
    track: Trajectory,
    revolution: Revolution,
    *,
    height_m: float,
    distortion: float = 1.0,
    attitude: float = 1.0,
) -> AzimuthPoses:
    """Return the motion of the antenna through one scan.

    The velocity stays when `distortion` is 0, and with it the Doppler shift. An antenna above `TILT_CENTRE_M`
    sways with the body.

    Args:
        track: Motion of the vehicle.
        revolution: The times of the scan.
        height_m: Height of the antenna above the road [m].
        distortion: Share of the duration of the scan over which the azimuths spread; at 0 the antenna keeps
            its mid-scan pose.
        attitude: Factor on pitch and roll.

    Returns:
        Position, attitude and velocity of the antenna at each azimuth.
    """
    times = sweep_times(revolution, distortion)
    pose, rate = track.pose(times), track.velocity(times)
    tilt, tilt_rate = attitude * track.tilt(times), attitude * track.tilt_rate(times)
    sway, sway_rate = _sway(pose[:, 3], rate[:, 3], tilt, tilt_rate, arm_m=height_m - TILT_CENTRE_M)
    return AzimuthPoses(
        position=pose[:, :3] + [0.0, 0.0, height_m] + sway,
        yaw=pose[:, 3],
        tilt=tilt,
        velocity=rate[:, :3] + sway_rate,
        azimuth_period_s=revolution.azimuth_period_s * distortion,
    )


def _sway(
    yaw: NDArray[np.float64],
    yaw_rate: NDArray[np.float64],
    tilt: NDArray[np.float64],
    tilt_rate: NDArray[np.float64],
    *,
    arm_m: float,
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Return how far the end of an upright arm is moved by the tilt (A, 3) [m], and its derivative [m/s]."""
    (sin_pitch, sin_roll), (cos_pitch, cos_roll) = np.sin(tilt).T, np.cos(tilt).T
    pitch_rate, roll_rate = tilt_rate.T
    ahead, right, up = -sin_pitch * cos_roll, sin_roll, cos_pitch * cos_roll - 1
    ahead_rate = -cos_pitch * cos_roll * pitch_rate + sin_pitch * sin_roll * roll_rate
    right_rate = cos_roll * roll_rate
    up_rate = -sin_pitch * cos_roll * pitch_rate - cos_pitch * sin_roll * roll_rate
    level = body_axes(yaw, np.zeros_like(tilt))
    # In a left turn the axis ahead moves to the left and the right one ahead.
    turned = (ahead_rate + yaw_rate * right, right_rate - yaw_rate * ahead, up_rate)
    moved, moving = (
        arm_m * (np.stack(parts, axis=1)[..., None] * level).sum(axis=1)
        for parts in ((ahead, right, up), turned)
    )
    return moved, moving


@dataclass(frozen=True, kw_only=True)
class MoverStates:
    """The moving objects near the radar, at each azimuth of a scan.

    Attributes:
        movers: The M objects.
        state: x, y, z [m] and yaw [rad] of each at each azimuth (M, A, 4) float64.
        rate: Time derivative of `state` (M, A, 4) float64 [m/s, rad/s].
    """

    movers: tuple[Mover, ...]
    state: NDArray[np.float64]
    rate: NDArray[np.float64]


def mover_states(
    movers: Sequence[Mover],
    revolution: Revolution,
    *,
    near: NDArray[np.float64],
    reach_m: float,
    distortion: float = 1.0,
) -> MoverStates:
    """Return the states of the moving objects that are near a point at mid-scan.

    Args:
        movers: All moving objects.
        revolution: The times of the scan.
        near: The point (2 or more,), of which x and y count [m].
        reach_m: Largest horizontal distance from the point [m].
        distortion: Share of the duration of the scan over which the azimuths spread.

    Returns:
        The objects within `reach_m` and their states, in the order of `movers`.
    """
    close = [
        mover
        for mover in movers
        if math.dist(mover.track.pose(np.float64(revolution.middle_s))[:2], near[:2]) <= reach_m
    ]
    times = sweep_times(revolution, distortion)
    shape = (len(close), revolution.azimuths, 4)
    return MoverStates(
        movers=tuple(close),
        state=np.array([mover.track.pose(times) for mover in close]).reshape(shape),
        rate=np.array([mover.track.velocity(times) for mover in close]).reshape(shape),
    )
