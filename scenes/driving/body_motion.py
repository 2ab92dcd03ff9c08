"""Pitch and roll of a car body on its springs: it dives, squats and leans, and follows an uneven road.

Pitch and roll are oscillators (Gillespie, Fundamentals of Vehicle Dynamics, 1992, ch. 5-7): with the road's
angle r under the wheels and the acceleration a,

    angle'' + 2 zeta w (angle' - r') + w^2 (angle - r) = w^2 g a

where g, the angle per acceleration, is that of a mass on these springs: g = h / (k^2 w^2).
"""

import math
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import ArrayLike, NDArray

from echoscape.scenes.core import portable_math
from echoscape.scenes.core.attitude import Attitude
from echoscape.scenes.core.checks import check_between
from echoscape.scenes.core.trajectory import Trajectory
from echoscape.scenes.driving.road_profile import STEP_M, road_profile

BODY_STAGE = 105
"""Number of the random stage of the road's unevenness; those of the drive precede it."""
GRIP_MPS2 = 9.81
"""Acceleration that tyres can transmit on a dry road [m/s^2]."""

_CLOCK_S = 0.01
_KNOTS = 2


@dataclass(frozen=True, kw_only=True)
class CarBody:
    """A passenger car on its suspension."""

    wheelbase_m: float = 2.7
    """Distance of the axles [m]."""
    track_m: float = 1.55
    """Distance of the wheels of an axle [m]."""
    pitch_hz: float = 1.2
    """Natural frequency of pitch [Hz]; ride frequencies of cars are 1 to 1.5 Hz (Gillespie, ch. 5)."""
    roll_hz: float = 1.5
    """Natural frequency of roll [Hz]."""
    damping: float = 0.28
    """Damping ratio of both; 0.2 to 0.4 in passenger cars (Gillespie, ch. 5)."""
    pitch_arm_m: float = 0.5
    """Height of the centre of mass above the road, less what anti-dive and anti-squat take up [m]."""
    roll_arm_m: float = 0.48
    """Height of the centre of mass above the roll axis [m]."""
    pitch_gyration_m: float = 1.3
    """Radius of gyration in pitch [m]."""
    roll_gyration_m: float = 0.75
    """Radius of gyration in roll, about the roll axis [m]."""

    def __post_init__(self) -> None:
        """Check the ranges of the fields.

        Raises:
            ValueError: A field is out of range; the message names it.
        """
        check_between(
            self,
            wheelbase_m=(1, 10),
            track_m=(0.5, 4),
            pitch_hz=(0.5, 5),
            roll_hz=(0.5, 5),
            damping=(0.05, 1),
            pitch_arm_m=(0, 3),
            roll_arm_m=(0, 3),
            pitch_gyration_m=(0.3, 5),
            roll_gyration_m=(0.3, 5),
        )

    @property
    def pitch_gradient(self) -> float:
        """Steady pitch per longitudinal acceleration [rad per m/s^2]: 0.0040, 2.2 deg per g."""
        return self.pitch_arm_m / (self.pitch_gyration_m * 2 * math.pi * self.pitch_hz) ** 2

    @property
    def roll_gradient(self) -> float:
        """Steady roll per lateral acceleration [rad per m/s^2]: 0.0096, 5.4 deg per g."""
        return self.roll_arm_m / (self.roll_gyration_m * 2 * math.pi * self.roll_hz) ** 2


def with_body_motion(
    track: Trajectory, *, seed: int, roughness_m3: ArrayLike, body: CarBody | None = None
) -> Trajectory:
    """Return a motion with the attitude of a car that is driven like that.

    Args:
        track: The motion of the car on level ground. An attitude that it has already is kept.
        seed: Decides the unevenness of the road.
        roughness_m3: Degree of roughness of the road (ISO 8608) at every knot of `track` (K,), or one for all
            [m^3].
        body: The car; None is a compact saloon.

    Returns:
        The motion with pitch and roll. A car that stands from the start is level.
    """
    if track.attitude is not None:
        return track
    body = body or CarBody()
    count = math.ceil((track.time_s[-1] - track.time_s[0]) / _CLOCK_S / _KNOTS) * _KNOTS + 1
    time_s = track.time_s[0] + _CLOCK_S * np.arange(count)
    ahead, left = _accelerations(track, time_s)
    pitch_road, roll_road = _road_angles(track, time_s, seed=seed, roughness_m3=roughness_m3, body=body)
    motions = (
        _on_springs(pitch_road, body.pitch_gradient * ahead, hertz=body.pitch_hz, damping=body.damping),
        _on_springs(roll_road, body.roll_gradient * left, hertz=body.roll_hz, damping=body.damping),
    )
    angle, rate = (np.stack(parts, axis=-1)[::_KNOTS] for parts in zip(*motions, strict=True))
    return replace(track, attitude=Attitude(time_s=time_s[::_KNOTS], angle_rad=angle, rate_rps=rate))


def _accelerations(
    track: Trajectory, time_s: NDArray[np.float64]
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Return the accelerations ahead and to the left (T,) [m/s^2], as far as tyres transmit them."""
    yaw = track.pose(time_s)[:, 3]
    change = np.gradient(track.velocity(time_s)[:, :2], _CLOCK_S, axis=0)
    ahead = change[:, 0] * np.cos(yaw) + change[:, 1] * np.sin(yaw)
    left = change[:, 1] * np.cos(yaw) - change[:, 0] * np.sin(yaw)
    return np.clip(ahead, -GRIP_MPS2, GRIP_MPS2), np.clip(left, -GRIP_MPS2, GRIP_MPS2)


def _road_angles(
    track: Trajectory, time_s: NDArray[np.float64], *, seed: int, roughness_m3: ArrayLike, body: CarBody
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Return the pitch and roll of the road under the wheels (T,) [rad], 0 where the car starts."""
    speed = np.hypot(*track.velocity(time_s)[:, :2].T)
    arc = np.append(0.0, np.cumsum((speed[1:] + speed[:-1]) * (_CLOCK_S / 2)))
    samples = STEP_M * np.arange(math.ceil(arc[-1] / STEP_M) + 2)
    at_knots = np.interp(track.time_s, time_s, arc)
    rough = np.interp(samples, at_knots, np.broadcast_to(roughness_m3, at_knots.shape))
    rng = np.random.default_rng(np.random.SeedSequence([seed, BODY_STAGE]))
    profile = road_profile(rough, track_m=body.track_m, rng=rng)
    front_mean, front_difference = (np.interp(arc, samples, each) for each in vars(profile).values())
    rear = arc - body.wheelbase_m  # before the start the road is flat
    rear_mean, rear_difference = (np.interp(rear, samples, each) for each in vars(profile).values())
    pitch = (front_mean - rear_mean) / body.wheelbase_m
    roll = (front_difference + rear_difference) / (2 * body.track_m)
    return portable_math.arctan(pitch), portable_math.arctan(roll)


def _on_springs(
    road: NDArray[np.float64], load: NDArray[np.float64], *, hertz: float, damping: float
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Return angle and rate (T,) of the oscillator by the bilinear transform; it starts at rest.

    Args:
        road: Angle of the road (T,) [rad].
        load: Steady angle under the acceleration (T,) [rad].
        hertz: Natural frequency [Hz].
        damping: Damping ratio.
    """
    from scipy.signal import lfilter  # slow to import; a drive that is known needs none

    w = 2 * math.pi * hertz
    damp = 2 * damping * w
    below = _bilinear(1.0, damp, w * w)
    steady = load - load[0]
    # Loads act on the mass alone, the road through springs and dampers.
    parts = (((damp, w * w), road), ((0.0, w * w), steady))
    angle, rate = np.zeros_like(road), np.zeros_like(road)
    for (linear, constant), signal in parts:
        angle += lfilter(_bilinear(0.0, linear, constant), below, signal)
        rate += lfilter(_bilinear(linear, constant, 0.0), below, signal)
    return angle + load[0], rate


def _bilinear(square: float, linear: float, constant: float) -> list[float]:
    """Return the coefficients of square s^2 + linear s + constant in z^-1, over (1 + z^-1)^2."""
    k = 2 / _CLOCK_S
    return [
        square * k * k + linear * k + constant,
        2 * constant - 2 * square * k * k,
        square * k * k - linear * k + constant,
    ]
