"""The folder of the Oxford Radar RobotCar data set: its scans, their times, and the motion between them.

Barnes et al., "The Oxford Radar RobotCar Dataset", ICRA 2020, and the files and loaders published with it.
docs/conventions.md relates its axes and times to those of simulated worlds.
"""

import csv
from collections.abc import Sequence
from dataclasses import dataclass
from itertools import pairwise
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from echoscape.sim.datasets.files.atomic_write import DatasetError, read_text, write_atomic
from echoscape.sim.datasets.layouts.layout import Layout, ScanRecord
from echoscape.sim.datasets.se2 import compose, from_world, relative_from_world, to_world
from echoscape.sim.sensor.sensor import Sensor

ODOMETRY_HEADER = (
    "source_timestamp",
    "destination_timestamp",
    "x",
    "y",
    "z",
    "roll",
    "pitch",
    "yaw",
    "source_radar_timestamp",
    "destination_radar_timestamp",
)

# ---------------------------------------------------------------------- time stamps


def write_timestamps(path: Path, stamps_us: Sequence[int]) -> None:
    """Write `radar.timestamps`: the time of each scan's first azimuth, which names its file, and 1 for valid.

    Args:
        path: File to write.
        stamps_us: The times [us].
    """
    write_atomic(path, "".join(f"{stamp} 1\n" for stamp in stamps_us).encode())


def read_timestamps(path: Path) -> list[int]:
    """Read `radar.timestamps`.

    Args:
        path: The file.

    Returns:
        The time stamps [us].

    Raises:
        DatasetError: The file is absent or a line of it is not `<timestamp> <valid>`; the message names both.
    """
    stamps = []
    for number, line in enumerate(read_text(path).splitlines(), 1):
        words = line.split()
        if len(words) != 2 or not all(word.isdecimal() for word in words):
            raise DatasetError(f"{path}: line {number} is not '<timestamp> <valid>': {line!r}")
        stamps.append(int(words[0]))
    return stamps


# ---------------------------------------------------------------------- the motion between scans


@dataclass(frozen=True, kw_only=True)
class OdometryRow:
    """The pose of the later frame (source) in the earlier one's (destination), mid-scan to mid-scan.

    Attributes:
        source_us: Mid-scan of the later scan [us].
        destination_us: Mid-scan of the earlier scan [us].
        x: Forward [m].
        y: Right [m].
        z: Down [m].
        roll: Rotation about x [rad].
        pitch: Rotation about y [rad].
        yaw: Rotation about z, clockwise seen from above [rad].
        source_radar_us: Time that names the file of the later scan [us].
        destination_radar_us: Time that names the file of the earlier scan [us].
    """

    source_us: int
    destination_us: int
    x: float
    y: float
    z: float
    roll: float
    pitch: float
    yaw: float
    source_radar_us: int
    destination_radar_us: int


def write_odometry(path: Path, rows: Sequence[OdometryRow]) -> None:
    """Write `gt/radar_odometry.csv` with the data set's header and six decimals.

    Args:
        path: File to write.
        rows: A row for each pair of successive scans.
    """
    lines = [",".join(ODOMETRY_HEADER)]
    for row in rows:
        motion = ",".join(f"{value:.6f}" for value in (row.x, row.y, row.z, row.roll, row.pitch, row.yaw))
        files = f"{row.source_radar_us},{row.destination_radar_us}"
        lines.append(f"{row.source_us},{row.destination_us},{motion},{files}")
    write_atomic(path, ("\n".join(lines) + "\n").encode())


def read_odometry(path: Path) -> list[OdometryRow]:
    """Read a `radar_odometry.csv`.

    Args:
        path: The file.

    Returns:
        A row for each pair of scans.

    Raises:
        DatasetError: The file is absent, has another header, or a row is not valid; the message names both.
    """
    lines = list(csv.reader(read_text(path).splitlines()))
    if not lines or tuple(lines[0]) != ODOMETRY_HEADER:
        raise DatasetError(f"{path}: the header is not {','.join(ODOMETRY_HEADER)}")
    rows = []
    for number, words in enumerate(lines[1:], 2):
        try:
            times = [int(word) for word in (*words[:2], *words[8:])]
            x, y, z, roll, pitch, yaw = (float(word) for word in words[2:8])
            source, destination, source_radar, destination_radar = times
        except ValueError as error:
            raise DatasetError(f"{path}: line {number} is not a row of odometry ({error})") from error
        rows.append(
            OdometryRow(
                source_us=source,
                destination_us=destination,
                x=x,
                y=y,
                z=z,
                roll=roll,
                pitch=pitch,
                yaw=yaw,
                source_radar_us=source_radar,
                destination_radar_us=destination_radar,
            )
        )
    return rows


# ---------------------------------------------------------------------- the folder


class Oxford(Layout):
    """`radar/<time of the first azimuth, us>.png`, `radar.timestamps`, `gt/radar_odometry.csv`."""

    name = "oxford"
    scans_folders = ("radar",)
    other_folders = ("gt",)

    def stem(self, azimuth_us: NDArray[np.int64]) -> str:
        """Name a scan after the time of its first azimuth [us].

        Args:
            azimuth_us: Times of its azimuths (azimuths,) [us].

        Returns:
            Name of its image, without the suffix.
        """
        return str(azimuth_us[0])

    def write_motion(self, folder: Path, records: Sequence[ScanRecord], sensor: Sensor) -> None:
        """Write `radar.timestamps` and the odometry from scan to scan.

        Args:
            folder: Folder of the data set.
            records: The scans, in order of time.
            sensor: The radar.
        """
        rows = [_odometry_row(*pair) for pair in pairwise(records)]
        write_odometry(folder / "gt" / "radar_odometry.csv", rows)
        write_timestamps(folder / "radar.timestamps", [int(record.stem) for record in records])

    def read_poses(self, folder: Path, stems: Sequence[str], sensor: Sensor) -> NDArray[np.float64] | None:
        """Chain the odometry in a world in which the first scan of the chain is at 0.

        Args:
            folder: Folder of the data set.
            stems: Names of the N scans, in order of time.
            sensor: The radar.

        Returns:
            World poses (N, 4): x, y, z [m], yaw [rad], NaN outside the first chain of pairs that have a row;
            None without the file of odometry.

        Raises:
            DatasetError: The file is not valid; the message names it.
        """
        path = folder / "gt" / "radar_odometry.csv"
        if not path.is_file():
            return None
        rows = {(str(row.destination_radar_us), str(row.source_radar_us)): row for row in read_odometry(path)}
        poses = np.full((len(stems), 4), np.nan)
        pairs = list(pairwise(stems))
        first = next((i for i, pair in enumerate(pairs) if pair in rows), len(pairs))
        poses[first : first + 1] = 0.0
        for i, pair in enumerate(pairs[first:], first):
            if pair not in rows:
                break
            row = rows[pair]
            poses[i + 1] = to_world(compose(from_world(poses[i]), [row.x, row.y, row.yaw]))
            poses[i + 1, 2] = poses[i, 2] - row.z
        return poses if pairs[first:] else np.full_like(poses, np.nan)


def _odometry_row(earlier: ScanRecord, later: ScanRecord) -> OdometryRow:
    """Return the motion from one scan to the next."""
    motion = relative_from_world(earlier.middle_pose, later.middle_pose)
    return OdometryRow(
        source_us=later.middle_us,
        destination_us=earlier.middle_us,
        x=motion.x_m,
        y=motion.y_m,
        z=0.0 - float(later.middle_pose[2] - earlier.middle_pose[2]),  # down
        roll=0.0,
        pitch=0.0,
        yaw=motion.yaw_rad,
        source_radar_us=int(later.stem),
        destination_radar_us=int(earlier.stem),
    )
