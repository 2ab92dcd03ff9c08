"""Pitch and roll of a car on its springs against the textbook, for the cars that carry the radar."""

import math

import numpy as np
from scipy.special import k1

from echoscape.scenes.core.trajectory import Trajectory
from echoscape.scenes.driving.body_motion import with_body_motion
from tests.physics.laws import LawRecorder

SECTION = "Motion"


def driven(
    duration_s: float, speed_mps: float, *, ahead_mps2: float = 0.0, yaw_rate_rps: float = 0.0
) -> Trajectory:
    time_s = np.linspace(0.0, duration_s, round(duration_s * 20) + 1)
    speed, yaw = speed_mps + ahead_mps2 * time_s, yaw_rate_rps * time_s
    still = np.zeros_like(time_s)
    rate = np.stack([speed * np.cos(yaw), speed * np.sin(yaw), still, still + yaw_rate_rps], axis=1)
    steps = (rate[1:] + rate[:-1]) / 2 * np.diff(time_s)[:, None]
    state = np.concatenate([np.zeros((1, 4)), np.cumsum(steps, axis=0)])
    return Trajectory(time_s=time_s, state=state, rate=rate)


def test_dive(law: LawRecorder) -> None:
    track = with_body_motion(driven(6.0, 20.0, ahead_mps2=-3.0), seed=1, roughness_m3=0.0)
    law(
        "Pitch of a car that brakes at 3 m/s^2 on a smooth road",
        source="mass on springs: m h a over m k^2 w^2; h = 0.5 m, k = 1.3 m, 1.2 Hz (Gillespie 1992)",
        expected=-math.degrees(3.0 * 0.5 / (1.3 * 2 * math.pi * 1.2) ** 2),
        simulated=math.degrees(track.tilt(5.9)[0]),
        tolerance=0.01,
        unit="deg",
        why="settled after 6 s to exp(-13)",
    )


def test_lean(law: LawRecorder) -> None:
    track = with_body_motion(driven(8.0, 10.0, yaw_rate_rps=0.2), seed=1, roughness_m3=0.0)
    law(
        "Roll in a left bend of 50 m at 10 m/s on a smooth road, right side down",
        source="mass on springs: v^2 / R = 2 m/s^2; h = 0.48 m, k = 0.75 m, 1.5 Hz (Gillespie 1992)",
        expected=math.degrees(2.0 * 0.48 / (0.75 * 2 * math.pi * 1.5) ** 2),
        simulated=math.degrees(track.tilt(7.5)[1]),
        tolerance=0.01,
        unit="deg",
        why="the acceleration is the difference of velocities 20 ms apart",
    )


def test_rough_road(law: LawRecorder) -> None:
    track = with_body_motion(driven(3000.0, 12.0), seed=6, roughness_m3=256e-6)
    found = np.degrees(np.std(track.tilt(np.arange(60.0, 3000.0, 0.05)), axis=0))
    n = np.geomspace(1e-4, 3.0, 20_000)
    slope = (2 * np.pi * 0.1) ** 2 * 256e-6 * n**2 / (n**2 + 0.01**2)
    x, axles = 2 * np.pi * n * 1.55, np.pi * n * 2.7
    both = (1 + x * k1(x)) / 2 * (np.sin(axles) / axles) ** 2
    across = 2 * (1 - x * k1(x)) / x**2 * np.cos(axles) ** 2
    for number, (name, share, hertz) in enumerate((("Pitch", both, 1.2), ("Roll", across, 1.5))):
        r = n * 12.0 / hertz
        gain = (1 + (0.56 * r) ** 2) / ((1 - r**2) ** 2 + (0.56 * r) ** 2)
        law(
            f"{name} on a road of class C at 12 m/s, standard deviation",
            source="ISO 8608 and isotropic tracks (Dodds & Robson 1973) through springs and dampers",
            expected=math.degrees(math.sqrt(np.trapezoid(slope * share * gain, n))),
            simulated=float(found[number]),
            tolerance=0.02,
            unit="deg",
            why="36 km of stretches of unlike roughness: 3 %; coherence as a rational function: 4 %",
        )
