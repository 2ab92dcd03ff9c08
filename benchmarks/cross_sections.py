"""Radar cross-sections of the road users by aspect and range, for the table of docs/scenes.md.

    python -m benchmarks.cross_sections

Each object stands in free space on a circle about a radar at 1 m of height (bumper-mounted radars and ranges
for such measurements stand at 0.5-1 m) with an elevation beam so wide that it covers all of it. Its mean
power, without speckle, is summed over the azimuths that receive it and divided by that of a point of 1 m^2 at
the same range. Each value is the mean over aspects within 3 deg of it, as in published measurements. Paths of
one bounce count: those of more add 0.3 dB within a car, and mirror images of the neighbours on the circle.
"""

import argparse
import math
from collections.abc import Sequence
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from echoscape.scenes.assets.vehicles import vehicle_prototypes
from echoscape.scenes.core.lane_graph import RoadGraph
from echoscape.scenes.core.scene import CLASSES, Placements, Prototype, Scene
from echoscape.scenes.core.target_meshes import with_targets
from echoscape.scenes.core.targets import Target
from echoscape.scenes.core.trajectory import Trajectory
from echoscape.sim.sensor.antenna_pattern import directivity_db
from echoscape.sim.sensor.cts350x import CTS350X
from echoscape.sim.sensor.sensor import Sensor
from echoscape.sim.settings.artefacts import Artefacts
from echoscape.sim.settings.tracing import TraceSettings
from echoscape.sim.simulator import Simulator

ASPECTS_DEG = tuple(range(0, 181, 10))
RANGES_M = (10.0, 20.0, 40.0, 80.0)
HEIGHT_M = 1.0
_AROUND_DEG = (-3.0, -1.5, 0.0, 1.5, 3.0)
_EDGE_DEG = 1.5
"""Width over which the beam's gain falls above and below the object [deg]."""
_SPACING_M = 2.5
"""Least free space between neighbours on the circle [m]."""


class _Standing:
    """A drive of a radar that stands at the origin, looking along x."""

    trajectory = Trajectory(time_s=np.array([0.0, 10.0]), state=np.zeros((2, 4)), rate=np.zeros((2, 4)))


def measuring_radar(range_m: float, height_m: float = 2.5) -> Sensor:
    """Return a radar that covers objects of a height at a range evenly.

    Args:
        range_m: Distance of the objects [m].
        height_m: Height of the objects [m].

    Returns:
        The sensor: as CTS350-X, at 1 m, with a beam of even gain from the ground to the top.
    """
    up = math.degrees(math.atan((height_m + 0.3 - HEIGHT_M) / range_m))
    down = -math.degrees(math.atan((HEIGHT_M + 0.2) / range_m))
    pattern = (
        (-90.0, -60.0),
        (down - _EDGE_DEG, -30.0),
        (down, 0.0),
        (up, 0.0),
        (up + _EDGE_DEG, -30.0),
        (90.0, -60.0),
    )
    gain = directivity_db(CTS350X.azimuth_pattern_db, pattern)
    return replace(
        CTS350X,
        rotation_jitter_s=1e-9,
        rotation_hz=0.01,
        mount_height_m=HEIGHT_M,
        mount_tilt_deg=0.0,
        elevation_pattern_db=pattern,
        antenna_gain_db=gain,
    )


def circle_of(prototype: Prototype, aspects_rad: NDArray[np.float64], range_m: float) -> Scene:
    """Return a scene of one object at many aspects on a circle about the origin, instance ids from 1.

    Args:
        prototype: The object.
        aspects_rad: Angle from the object's front to the radar, positive to its left (N,) [rad].
        range_m: Radius of the circle [m].

    Returns:
        The scene; nothing else is in it.
    """
    count = len(aspects_rad)
    bearing = 2 * math.pi * np.arange(count) / max(count, 1)
    place = np.stack([range_m * np.cos(bearing), range_m * np.sin(bearing), np.zeros(count)], axis=1)
    return Scene(
        preset="circle",
        seed=0,
        static={},
        prototypes=(prototype,),
        placements=Placements(
            prototype=np.zeros(count, np.uint32),
            instance=np.arange(1, count + 1, dtype=np.uint32),
            position=place,
            yaw=bearing + math.pi - aspects_rad,
            scale=np.ones(count),
        ),
        instance_class=np.array([0] + [CLASSES.index(prototype.class_name)] * count, np.uint8),
        roads=RoadGraph(lanes=(), junctions=np.zeros((0, 2))),
        bounds_m=(-range_m - 20, -range_m - 20, range_m + 20, range_m + 20),
    )


def summed_power_w(scene: Scene, sensor: Sensor, *, rays: int, bounces: int) -> NDArray[np.float64]:
    """Return the mean power of each instance, summed over the azimuths (I,) [W]."""
    simulator = Simulator(
        scene,
        _Standing(),
        (),
        seed=5,
        sensor=sensor,
        settings=TraceSettings(rays=rays, max_bounces=bounces, floor_db=-60.0),
        artefacts=Artefacts(),
    )
    echoes = simulator.echoes(0)
    power = np.zeros(len(scene.instance_class))
    np.add.at(power, echoes.instance, echoes.mean_power)
    return power


def cross_sections_m2(
    prototype: Prototype,
    aspects_deg: Sequence[float] = ASPECTS_DEG,
    *,
    range_m: float,
    rays: int = 256,
    bounces: int = 1,
) -> NDArray[np.float64]:
    """Return the mean radar cross-section of an object around each aspect.

    Args:
        prototype: The object.
        aspects_deg: Aspects, 0 is from the front, 90 from the left (A,) [deg].
        range_m: Distance to the object's centre [m].
        rays: Rays an azimuth.
        bounces: Most surfaces that a path meets.

    Returns:
        Cross-sections (A,) [m^2].
    """
    sensor = measuring_radar(range_m, prototype.extent_m[2])
    point = Target(kind="point", position_m=(range_m, 0.0, HEIGHT_M))
    empty = circle_of(prototype, np.zeros(0), range_m)
    unit_w = summed_power_w(with_targets(empty, [point]), sensor, rays=16, bounces=1)[1]
    aspect = np.radians(np.add.outer(np.array(aspects_deg, float), np.array(_AROUND_DEG)).ravel())
    room = math.hypot(*prototype.extent_m[:2]) + _SPACING_M
    most = max(1, int(2 * math.pi * range_m / room))
    groups = np.array_split(aspect, math.ceil(len(aspect) / most))
    powers = [
        summed_power_w(circle_of(prototype, group, range_m), sensor, rays=rays, bounces=bounces)[1:]
        for group in groups
    ]
    return np.concatenate(powers).reshape(len(aspects_deg), -1).mean(axis=1) / unit_w


def main() -> None:
    """Print a table of cross-sections by aspect and range."""
    parser = argparse.ArgumentParser(description="Radar cross-sections by aspect and range.")
    parser.add_argument("names", nargs="*", help="names of prototypes; none for all")
    parser.add_argument("--rays", type=int, default=256)
    parser.add_argument("--bounces", type=int, default=1)
    args = parser.parse_args()
    print("| object | range | " + " | ".join(f"{aspect}" for aspect in ASPECTS_DEG) + " | mean |")
    print("|" + "---|" * (len(ASPECTS_DEG) + 3))
    for prototype in vehicle_prototypes():
        if args.names and prototype.name not in args.names:
            continue
        for range_m in RANGES_M:
            sigma = cross_sections_m2(prototype, range_m=range_m, rays=args.rays, bounces=args.bounces)
            cells = [f"{each:.0f}" for each in 10 * np.log10(np.append(sigma, sigma.mean()))]
            print(f"| {prototype.name} | {range_m:g} m | " + " | ".join(cells) + " |", flush=True)


if __name__ == "__main__":
    main()
