"""True boxes of moving objects at the time when the rotating beam passes each of them.

A scan shows each object where it is when its azimuth is swept, up to half a revolution from mid-scan. The
ground truth holds its box at that time.
"""

import math
from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from echoscape.sim.datasets.polar_scan import ScanTruth


@dataclass(frozen=True, kw_only=True)
class ObservedBox:
    """The box of a moving object at the time when the beam passes it.

    Attributes:
        instance: Number of the object.
        class_id: Number of its class.
        forward_m: Position of its centre, ahead of the car as it is at that azimuth [m].
        right_m: The same, to the right of the car [m].
        heading_rad: Heading of the object relative to the car's, clockwise [rad].
        x_m: Position of its centre in the world at mid-scan [m].
        y_m: Position of its centre in the world at mid-scan [m].
        yaw_rad: Heading in the world, counter-clockwise from the x axis [rad].
        length_m: Length [m].
        width_m: Width [m].
        height_m: Height [m].
        speed_m_s: Speed over ground [m/s].
    """

    instance: int
    class_id: int
    forward_m: float
    right_m: float
    heading_rad: float
    x_m: float
    y_m: float
    yaw_rad: float
    length_m: float
    width_m: float
    height_m: float
    speed_m_s: float

    def corners_m(self) -> NDArray[np.float64]:
        """Return the corners (4, 2) of the box on the scan: right of and ahead of the car [m]."""
        half = np.array([(0.5, 0.5), (0.5, -0.5), (-0.5, -0.5), (-0.5, 0.5)])
        along, across = (half * [self.length_m, self.width_m]).T
        cosine, sine = math.cos(self.heading_rad), math.sin(self.heading_rad)
        forward = self.forward_m + cosine * along - sine * across
        right = self.right_m + sine * along + cosine * across
        return np.stack([right, forward], axis=1)


def observed_boxes(truth: ScanTruth, *, motion_distortion: float = 1.0) -> Iterator[ObservedBox]:
    """Yield the moving objects near the radar where the scan shows them.

    Args:
        truth: Ground truth of the scan.
        motion_distortion: Share of the revolution's time over which the azimuths were simulated, as in
            `sim.settings.artefacts.Artefacts`; 0 if all were simulated at mid-scan.

    Yields:
        One box for each object.
    """
    boxes = truth.boxes
    for i in range(len(boxes.instance)):
        centre, velocity = boxes.centre[i], boxes.velocity[i]
        pose, position, yaw = _met(truth, i, motion_distortion)
        forward, right = _in_car_frame(pose, position)
        length, width, height = (round(float(value), 2) for value in boxes.extent[i])
        yield ObservedBox(
            instance=int(boxes.instance[i]),
            class_id=int(boxes.class_id[i]),
            forward_m=round(forward, 2),
            right_m=round(right, 2),
            heading_rad=round(math.remainder(float(pose[3]) - yaw, 2 * math.pi), 3),
            x_m=round(float(centre[0]), 2),
            y_m=round(float(centre[1]), 2),
            yaw_rad=round(float(boxes.yaw[i]), 3),
            length_m=length,
            width_m=width,
            height_m=height,
            speed_m_s=round(float(np.hypot(velocity[0], velocity[1])), 2),
        )


def _met(truth: ScanTruth, index: int, share: float) -> tuple[NDArray, NDArray, float]:
    """Return the car's pose (4,), a box's centre (3,) and its yaw [rad] at the azimuth that meets the box."""
    boxes = truth.boxes
    return _pose_at(truth, int(boxes.row[index]), share), boxes.row_centre[index], float(boxes.row_yaw[index])


def _pose_at(truth: ScanTruth, azimuth: int, share: float) -> NDArray[np.float64]:
    """Return the car's pose (4,) at an azimuth, for azimuths spread over a share of the revolution's time."""
    middle = (len(truth.pose) - 1) / 2
    return truth.pose[round(middle + share * (azimuth - middle))] if share else truth.middle_pose


def _in_car_frame(pose: NDArray, position: NDArray) -> tuple[float, float]:
    """Return forward and right [m] of a position in the world, for a car at `pose`."""
    east, north = float(position[0] - pose[0]), float(position[1] - pose[1])
    cosine, sine = math.cos(pose[3]), math.sin(pose[3])
    return cosine * east + sine * north, sine * east - cosine * north
