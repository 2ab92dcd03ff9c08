"""The folder of the Boreas and Boreas-RT data sets: scans named after their middle, and the radar's poses.

Burnett et al., "Boreas: A Multi-Season Autonomous Driving Dataset", IJRR 2023, its guide and loaders
(pyboreas): `radar/<time of azimuth 199, us>.png` and `applanix/radar_poses.csv`. The radar's frame has x
forward, y right and z down (its roll is about pi), the world x east, y north, z up.
"""

import math
from collections.abc import Sequence
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from echoscape.sim.datasets.files.atomic_write import DatasetError, read_text, write_atomic
from echoscape.sim.datasets.files.track_csv import read_car_track
from echoscape.sim.datasets.layouts.layout import Layout, ScanRecord, numbers
from echoscape.sim.sensor.sensor import Sensor

POSES_HEADER = (
    "GPSTime,easting,northing,altitude,vel_east,vel_north,vel_up,"
    "roll,pitch,heading,angvel_z,angvel_y,angvel_x"
)

UPDATED_US = 1_632_182_400_000_000
"""Time of the radar's update [us]: bins of 0.0596 m up to it, of `UPDATED_BIN_M` after it (pyboreas)."""
UPDATED_BIN_M = 0.04381
RT_OFFSET_M = -0.31
"""Offset that the guide of Boreas-RT adds to `bin number x bin size` for the range [m]."""


class Boreas(Layout):
    """`radar/<time of the middle azimuth, us>.png` and `applanix/radar_poses.csv`."""

    name = "boreas"
    scans_folders = ("radar",)
    other_folders = ("applanix",)

    def stem(self, azimuth_us: NDArray[np.int64]) -> str:
        """Name a scan after the time of azimuth `floor(azimuths / 2) - 1` [us].

        Args:
            azimuth_us: Times of its azimuths (azimuths,) [us].

        Returns:
            Name of its image, without the suffix.
        """
        return str(azimuth_us[_middle_azimuth(len(azimuth_us))])

    def write_motion(self, folder: Path, records: Sequence[ScanRecord], sensor: Sensor) -> None:
        """Write `applanix/radar_poses.csv` with the radar's pose at the time in each name.

        Args:
            folder: Folder of the data set, which holds tracks.csv.
            records: The scans, in order of time.
            sensor: The radar.
        """
        stamps = np.array([int(record.stem) for record in records], np.int64)
        velocity = read_car_track(folder / "tracks.csv").velocity(stamps)
        lines = [POSES_HEADER]
        for record, (east, north, turning) in zip(records, velocity, strict=True):
            x, y, z, yaw = record.pose[_middle_azimuth(len(record.pose))]
            heading = math.remainder(yaw, 2 * math.pi)
            pose = (x, y, z + sensor.mount_height_m, east, north, 0.0, math.pi, 0.0, heading)
            # About the radar's own axes, of which z points down.
            row = (*pose, -turning, 0.0, 0.0)
            lines.append(f"{record.stem}," + ",".join(f"{value + 0.0:.9f}" for value in row))
        write_atomic(folder / "applanix" / "radar_poses.csv", ("\n".join(lines) + "\n").encode())

    def read_poses(self, folder: Path, stems: Sequence[str], sensor: Sensor) -> NDArray[np.float64] | None:
        """Look up the scans in `applanix/radar_poses.csv`; the car's pose is below the radar's mount.

        Args:
            folder: Folder of the data set.
            stems: Names of the N scans, in order of time.
            sensor: The radar.

        Returns:
            World poses (N, 4): x, y, z [m], yaw [rad], NaN for scans that are not listed; None without the
            file.

        Raises:
            DatasetError: The file is not valid; the message names it.
        """
        path = folder / "applanix" / "radar_poses.csv"
        if not path.is_file():
            return None
        known = read_radar_poses(path)
        poses = np.array([known.get(stem, np.full(4, np.nan)) for stem in stems]).reshape(-1, 4)
        return poses - [0.0, 0.0, sensor.mount_height_m, 0.0]


def read_radar_poses(path: Path) -> dict[str, NDArray[np.float64]]:
    """Read a `radar_poses.csv`.

    The yaw is that of the radar's x axis in the world, from `C_enu_radar = C1(roll) C2(pitch) C3(heading)`
    with the principal rotations of Barfoot, "State Estimation for Robotics", as in pyboreas.

    Args:
        path: The file.

    Returns:
        Poses of the radar (4,): x, y, z [m], yaw [rad], by the names of the scans.

    Raises:
        DatasetError: The file is absent, has another header, or a line is not a pose; the message names it.
    """
    lines = read_text(path).splitlines()
    if not lines or not lines[0].replace(" ", "").startswith(POSES_HEADER):
        raise DatasetError(f"{path}: the header does not begin with {POSES_HEADER}")
    rows = numbers(path, lines[1:], count=13, first=2)
    roll, pitch, heading = rows[:, 7:10].T
    east = np.cos(pitch) * np.cos(heading)
    north = np.sin(roll) * np.sin(pitch) * np.cos(heading) - np.cos(roll) * np.sin(heading)
    poses = np.column_stack([rows[:, 1:4], np.arctan2(north, east)])
    return {line.split(",", 1)[0].strip(): pose for line, pose in zip(lines[1:], poses, strict=True)}


def _middle_azimuth(azimuths: int) -> int:
    """Return the azimuth after which Boreas names a scan."""
    return max(azimuths // 2 - 1, 0)
