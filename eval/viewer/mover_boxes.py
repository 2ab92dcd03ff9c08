"""Movers where a scan shows them: the beam turns, so each is seen at another time than mid-scan.

A row's pose and time are those of the truth; between mid-scan and its row a mover goes on as it goes.
"""

import math
from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from echoscape.sim.datasets.polar_scan import PolarScan, ScanTruth

_SIGHTINGS = 3
"""Rounds to find the row that met a mover: the beam turns some 50 times faster than movers pass."""


@dataclass(frozen=True, kw_only=True)
class Box:
    """A mover where the turning beam met it.

    forward, right [m], turn [rad] clockwise: seen from the car at that row; x, y [m], yaw [rad]: in the world
    at mid-scan; length, width, height [m]; speed [m/s].
    """

    instance: int
    class_id: int
    forward: float
    right: float
    turn: float
    x: float
    y: float
    yaw: float
    length: float
    width: float
    height: float
    speed: float


def observed_boxes(scan: PolarScan, truth: ScanTruth) -> Iterator[Box]:
    """Yield the movers near the radar where the beam of `scan` met them."""
    boxes = truth.boxes
    for i in range(len(boxes.instance)):
        centre, velocity, yaw = boxes.centre[i], boxes.velocity[i], float(boxes.yaw[i])
        forward, right, heading = _met(scan, truth, centre, velocity)
        length, width, height = (round(float(value), 2) for value in boxes.extent[i])
        yield Box(
            instance=int(boxes.instance[i]),
            class_id=int(boxes.class_id[i]),
            forward=round(forward, 2),
            right=round(right, 2),
            turn=round(math.remainder(heading - yaw, 2 * math.pi), 3),
            x=round(float(centre[0]), 2),
            y=round(float(centre[1]), 2),
            yaw=round(yaw, 3),
            length=length,
            width=width,
            height=height,
            speed=round(float(np.hypot(velocity[0], velocity[1])), 2),
        )


def _met(scan: PolarScan, truth: ScanTruth, centre: NDArray, velocity: NDArray) -> tuple[float, float, float]:
    """Return forward, right [m] of a mover and the car's yaw [rad] at the row in which the beam met it.

    centre (3,) [m] is the mover's place at mid-scan, velocity (3,) [m/s]; car and mover go on while the beam
    turns to it.
    """
    azimuths = len(truth.pose)
    pose, place = truth.middle_pose, centre
    for _ in range(_SIGHTINGS):
        forward, right = _seen(pose, place)
        row = round(math.atan2(right, forward) / (2 * math.pi) * azimuths) % azimuths
        pose = truth.pose[row]
        place = centre + velocity * (float(scan.timestamp_us[row] - truth.middle_us) / 1e6)
    return *_seen(pose, place), float(pose[3])


def _seen(pose: NDArray, place: NDArray) -> tuple[float, float]:
    """Return forward and right [m] of a place in the world from a pose of the car."""
    east, north = float(place[0] - pose[0]), float(place[1] - pose[1])
    cosine, sine = math.cos(pose[3]), math.sin(pose[3])
    return cosine * east + sine * north, sine * east - cosine * north
