"""What a layout of data set folders decides: where scans lie, what their names mean, how motion is written.

Besides its own files, every simulated data set has ground truth, named after the image of its scan.
"""

from abc import ABC, abstractmethod
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import ClassVar

import numpy as np
from numpy.typing import NDArray

from echoscape.sim.datasets.files.atomic_write import DatasetError
from echoscape.sim.datasets.files.navtech_png import read_png, write_png
from echoscape.sim.datasets.polar_scan import PolarScan
from echoscape.sim.sensor.sensor import Sensor


@dataclass(frozen=True, kw_only=True)
class ScanRecord:
    """What the files that list scans need to know about one.

    Attributes:
        stem: Name of its image, without the suffix.
        middle_us: Mid-scan [us].
        middle_pose: World pose of the car at mid-scan (4,): x, y, z [m], yaw [rad].
        pose: World pose of the car at each azimuth (azimuths, 4).
    """

    stem: str
    middle_us: int
    middle_pose: NDArray[np.float64]
    pose: NDArray[np.float64]


class Layout(ABC):
    """A layout of data set folders."""

    name: ClassVar[str]
    scans_folders: ClassVar[tuple[str, ...]]
    """Folders of the images: written to the first of them, read from the first that exists."""
    other_folders: ClassVar[tuple[str, ...]] = ()
    """Further folders that its files need."""
    ticks_per_us: ClassVar[int] = 1
    """Unit of the time stamps in images and in their names, per microsecond."""

    @abstractmethod
    def stem(self, azimuth_us: NDArray[np.int64]) -> str:
        """Name a scan.

        Args:
            azimuth_us: Times of its azimuths (azimuths,) [us].

        Returns:
            Name of its image, without the suffix.
        """

    @abstractmethod
    def write_motion(self, folder: Path, records: Sequence[ScanRecord], sensor: Sensor) -> None:
        """Write the files that list the scans and the motion of the car.

        Args:
            folder: Folder of the data set.
            records: The scans, in order of time.
            sensor: The radar.
        """

    @abstractmethod
    def read_poses(self, folder: Path, stems: Sequence[str], sensor: Sensor) -> NDArray[np.float64] | None:
        """Read the poses of the car.

        Args:
            folder: Folder of the data set.
            stems: Names of the N scans, in order of time.
            sensor: The radar.

        Returns:
            World poses at mid-scan (N, 4): x, y, z [m], yaw [rad], NaN for scans without a pose; None where
            the folder has no poses.

        Raises:
            DatasetError: A file of poses is not valid; the message names it.
        """

    @property
    def folders(self) -> tuple[str, ...]:
        """Folders to make for a data set."""
        return (self.scans_folders[0], *self.other_folders)

    def time_us(self, stem: str) -> int:
        """Convert the name of a scan to its time.

        Args:
            stem: Name of its image.

        Returns:
            The time [us].
        """
        return int(stem) // self.ticks_per_us

    def scan_path(self, folder: Path, stem: str) -> Path:
        """Name the file of a scan.

        Args:
            folder: Folder of the data set.
            stem: Name of the image.

        Returns:
            Path of the image.
        """
        return folder / self.scans_folders[0] / f"{stem}.png"

    def stems(self, folder: Path) -> list[str]:
        """List the scans of a data set that was written in this layout.

        Args:
            folder: Folder of the data set.

        Returns:
            Names of the images, in order of time.
        """
        return sorted((path.stem for path in (folder / self.scans_folders[0]).glob("*.png")), key=int)

    def write_scan(self, path: Path, scan: PolarScan) -> None:
        """Write the image of a scan, whole or not at all.

        Args:
            path: File to write.
            scan: The scan.
        """
        write_png(path, scan, ticks_per_us=self.ticks_per_us)

    def read_scan(self, path: Path, sensor: Sensor) -> PolarScan:
        """Read the image of a scan.

        Args:
            path: The file.
            sensor: The radar that took it.

        Returns:
            The scan, without truth.

        Raises:
            DatasetError: The file is absent, cut short, or no scan of this sensor; the message names it.
        """
        return read_png(path, sensor=sensor, ticks_per_us=self.ticks_per_us)


def numbers(path: Path, lines: Sequence[str], *, count: int, first: int) -> NDArray[np.float64]:
    """Parse lines of numbers that are separated by commas.

    Args:
        path: File of the lines, for messages.
        lines: N lines of `count` or more numbers.
        count: Numbers that are taken of each line.
        first: Number of the first line in its file.

    Returns:
        The numbers (N, count).

    Raises:
        DatasetError: A line is not such a row; the message names the file and the line.
    """
    rows = np.empty((len(lines), count))
    for i, line in enumerate(lines):
        try:
            rows[i] = [float(word) for word in line.split(",")[:count]]
        except ValueError as error:
            raise DatasetError(
                f"{path}: line {first + i} is not a row of {count} numbers: {line!r}"
            ) from error
    return rows


def interpolated(times: NDArray, poses: NDArray[np.float64], at: NDArray) -> NDArray[np.float64]:
    """Interpolate poses linearly in time.

    Args:
        times: Ascending times (T,), integers.
        poses: Poses at these times (T, 4): x, y, z [m], yaw [rad].
        at: Times (N,) in the same unit.

    Returns:
        Poses (N, 4), NaN before the first and after the last time.
    """
    yaw = np.unwrap(poses[:, 3])
    columns = [poses[:, 0], poses[:, 1], poses[:, 2], yaw]
    origin = times[0]  # time stamps in nanoseconds do not fit a float
    known, wanted = (times - origin).astype(np.float64), (np.asarray(at) - origin).astype(np.float64)
    return np.stack([np.interp(wanted, known, each, left=np.nan, right=np.nan) for each in columns], axis=1)
