"""The folder of the MulRan data set: scans named after their end in nanoseconds, and the car's poses.

Kim et al., "MulRan: Multimodal Range Dataset for Urban Place Recognition", ICRA 2020, its file player and
loaders: images with time and encoder in `sensor_data/radar/polar_oxford_form`, `global_pose.csv` with rows
of a time [ns] and the 3 x 4 pose of the car's frame (x forward, y left, z up) in the world, row by row.
"""

import math
from collections.abc import Sequence
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from echoscape.sim.datasets.files.atomic_write import DatasetError, read_text, write_atomic
from echoscape.sim.datasets.layouts.layout import Layout, ScanRecord, interpolated, numbers
from echoscape.sim.sensor.sensor import Sensor

_NS = 1000
"""Nanoseconds in a microsecond."""


class MulRan(Layout):
    """`sensor_data/radar/polar_oxford_form/<time of the last azimuth, ns>.png`, `global_pose.csv`, stamps."""

    name = "mulran"
    scans_folders = ("sensor_data/radar/polar_oxford_form", "radar/polar_oxford_form", "polar_oxford_form")
    other_folders = ("sensor_data",)
    ticks_per_us = _NS

    def stem(self, azimuth_us: NDArray[np.int64]) -> str:
        """Name a scan after the time of its last azimuth [ns].

        Args:
            azimuth_us: Times of its azimuths (azimuths,) [us].

        Returns:
            Name of its image, without the suffix.
        """
        return str(int(azimuth_us[-1]) * _NS)

    def write_motion(self, folder: Path, records: Sequence[ScanRecord], sensor: Sensor) -> None:
        """Write the stamps, and `global_pose.csv` with the pose at the middle and the end of every scan.

        Args:
            folder: Folder of the data set.
            records: The scans, in order of time.
            sensor: The radar.
        """
        lines = []
        for record in records:
            if not lines:  # so that nothing lies before the first pose
                start_us = 2 * record.middle_us - self.time_us(record.stem)
                lines.append(_pose_line(start_us * _NS, record.pose[0]))
            lines.append(_pose_line(record.middle_us * _NS, record.middle_pose))
            lines.append(_pose_line(int(record.stem), record.pose[-1]))
        stems = [record.stem for record in records]
        sensors = folder / "sensor_data"
        write_atomic(folder / "global_pose.csv", "".join(lines).encode())
        write_atomic(sensors / "navtech_top_stamp.csv", "".join(f"{stem}\n" for stem in stems).encode())
        write_atomic(sensors / "data_stamp.csv", "".join(f"{stem},radar\n" for stem in stems).encode())

    def read_poses(self, folder: Path, stems: Sequence[str], sensor: Sensor) -> NDArray[np.float64] | None:
        """Interpolate `global_pose.csv` to the middle of each scan, half a revolution before its name's time.

        Args:
            folder: Folder of the data set.
            stems: Names of the N scans, in order of time.
            sensor: The radar.

        Returns:
            World poses at mid-scan (N, 4): x, y, z [m], yaw [rad], NaN outside the file's times; None without
            the file.

        Raises:
            DatasetError: The file is not valid; the message names it.
        """
        path = folder / "global_pose.csv"
        if not path.is_file():
            return None
        times_ns, poses = read_global_poses(path)
        return interpolated(times_ns, poses, _middle_ns(stems, sensor))


def read_global_poses(path: Path) -> tuple[NDArray[np.int64], NDArray[np.float64]]:
    """Read a `global_pose.csv`.

    Args:
        path: The file.

    Returns:
        Times (T,) int64 [ns] and poses (T, 4): x, y, z [m], yaw [rad].

    Raises:
        DatasetError: The file is absent, empty, out of order, or a line is not a pose; the message names it.
    """
    lines = read_text(path).splitlines()
    if not lines:
        raise DatasetError(f"{path}: no poses")
    try:
        times = np.array([int(line.split(",", 1)[0]) for line in lines], np.int64)
    except (ValueError, OverflowError) as error:
        raise DatasetError(f"{path}: a line begins with no time in nanoseconds ({error})") from error
    if (np.diff(times) <= 0).any():
        raise DatasetError(f"{path}: the times do not increase from line to line")
    matrix = numbers(path, lines, count=13, first=1)[:, 1:].reshape(-1, 3, 4)
    yaw = np.arctan2(matrix[:, 1, 0], matrix[:, 0, 0])
    return times, np.column_stack([matrix[:, :, 3], yaw])


def _pose_line(time_ns: int, pose: NDArray[np.float64]) -> str:
    """Return a line of `global_pose.csv`: a time and the 3 x 4 matrix of x, y, z, yaw."""
    x, y, z, yaw = (float(value) for value in pose)
    cosine, sine = math.cos(yaw), math.sin(yaw)
    matrix = (cosine, -sine, 0.0, x, sine, cosine, 0.0, y, 0.0, 0.0, 1.0, z)
    return f"{time_ns}," + ",".join(f"{value + 0.0:.9f}" for value in matrix) + "\n"


def _middle_ns(stems: Sequence[str], sensor: Sensor) -> NDArray[np.int64]:
    """Return the middles (N,) of scans named after their end [ns].

    A revolution lasts from one end to the next; the nominal time is taken for the first scan and after a gap.
    """
    ends = np.array([int(stem) for stem in stems], np.int64)
    nominal = 1e9 / sensor.rotation_hz
    revolution = np.diff(ends, prepend=ends[:1]).astype(np.float64)
    revolution = np.where(np.abs(revolution - nominal) < 0.1 * nominal, revolution, nominal)
    back = revolution * (sensor.azimuths - 1) / (2 * sensor.azimuths)
    return ends - np.rint(back).astype(np.int64)
