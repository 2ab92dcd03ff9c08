"""De-skewing: where the cells of a rolling scan lie in the frame of the car at mid-scan.

Each row is seen from its own pose, and a sawtooth sweep moves what stands still by beta times the radial
speed (Burnett et al., "Do We Need to Compensate for Motion Distortion and Doppler Effects in Spinning Radar
Navigation?", RA-L 2021); with the poses and velocities of the rows both are undone.
"""

import math

import numpy as np
from numpy.typing import ArrayLike, NDArray

from echoscape.sim.sensor.sensor import Sensor


def deskewed(
    row: ArrayLike,
    range_m: ArrayLike,
    *,
    pose: NDArray[np.float64],
    middle_pose: NDArray[np.float64],
    velocity: NDArray[np.float64] | None = None,
    sensor: Sensor | None = None,
) -> NDArray[np.float64]:
    """Return positions (C, 2), x forward and y right of the car at mid-scan, of cells of a scan [m].

    row (C,): their rows; range_m (C,): their ranges [m]; pose (A, 4): x, y, z, yaw of the car in the world at
    each row; middle_pose (4,): the same at mid-scan, as truth files have them. Given `velocity` (A, 2 or 3)
    of the car in the world [m/s] and the `sensor`, ranges lose their Doppler shift as well; that is right
    for what stands still.

    Raises ValueError for poses of another shape, rows that do not exist, or one of velocity and sensor alone.
    """
    rows, ranges = np.asarray(row), np.asarray(range_m, np.float64)
    _check(rows, ranges, pose, middle_pose)
    if (velocity is None) != (sensor is None):
        raise ValueError("velocity and sensor must be given together or not at all")
    heading = pose[rows, 3] - rows * (2 * math.pi / len(pose))  # azimuth is clockwise
    beam = np.stack([np.cos(heading), np.sin(heading)], axis=-1)  # (C, 2)
    if velocity is not None and sensor is not None:
        if velocity.shape not in ((len(pose), 2), (len(pose), 3)):
            raise ValueError(f"velocity must have a row for each pose ({len(pose)}), got {velocity.shape}")
        closing_mps = np.sum(velocity[rows, :2] * beam, axis=-1)
        ranges = ranges - sensor.doppler_shift_s[rows] * closing_mps
    away = pose[rows, :2] + ranges[:, None] * beam - middle_pose[:2]
    cosine, sine = math.cos(middle_pose[3]), math.sin(middle_pose[3])
    return away @ np.array([[cosine, sine], [sine, -cosine]])


def _check(
    rows: NDArray, ranges: NDArray[np.float64], pose: NDArray[np.float64], middle_pose: NDArray[np.float64]
) -> None:
    """Raise ValueError unless the cells and the poses fit each other."""
    if pose.ndim != 2 or pose.shape[1] != 4 or not np.isfinite(pose).all():
        raise ValueError(f"pose must be finite (rows, 4), got {pose.shape}")
    if middle_pose.shape != (4,) or not np.isfinite(middle_pose).all():
        raise ValueError(f"middle_pose must be finite (4,), got {middle_pose.shape}")
    if rows.shape != ranges.shape or rows.ndim != 1:
        raise ValueError(f"row and range_m must be (cells,) alike, got {rows.shape} and {ranges.shape}")
    if rows.size and (rows.dtype.kind not in "iu" or rows.min() < 0 or rows.max() >= len(pose)):
        raise ValueError(f"row must be whole numbers of 0 to {len(pose) - 1}")
