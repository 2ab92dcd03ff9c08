"""What a layout of dataset folders decides: where scans lie, what their names mean, how motion is written.

Beside what a layout has of its own, every dataset has our truth, named after its scan's picture.
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
    """What the files that list scans need of one.

    stem: name of its picture; middle_us: mid-scan [us]; middle_pose (4,), pose (A, 4): x, y, z [m], yaw [rad]
    of the car in the world at mid-scan and at every row.
    """

    stem: str
    middle_us: int
    middle_pose: NDArray[np.float64]
    pose: NDArray[np.float64]


class Layout(ABC):
    """A layout of dataset folders."""

    name: ClassVar[str]
    scans_folders: ClassVar[tuple[str, ...]]
    """Where scans lie: written to the first of them, read from whichever is there."""
    other_folders: ClassVar[tuple[str, ...]] = ()
    """Further folders that its files need."""
    ticks_per_us: ClassVar[int] = 1
    """Unit of the time stamps in pictures and in their names."""

    @abstractmethod
    def stem(self, row_us: NDArray[np.int64]) -> str:
        """Return the name of a scan's picture from the times of its rows (A,) [us]."""

    @abstractmethod
    def write_motion(self, folder: Path, records: Sequence[ScanRecord], sensor: Sensor) -> None:
        """Write the files that list the scans and say how the car moved."""

    @abstractmethod
    def read_poses(self, folder: Path, stems: Sequence[str], sensor: Sensor) -> NDArray[np.float64] | None:
        """Return the poses (N, 4) of the car at mid-scan: x, y, z [m], yaw [rad], world axes z up.

        A row is NaN where the folder has none for that scan; None where it has none at all.

        Raises:
            DatasetError: a file is not what it should be; the message names it.
        """

    @property
    def folders(self) -> tuple[str, ...]:
        """Folders to make for a dataset."""
        return (self.scans_folders[0], *self.other_folders)

    def time_us(self, stem: str) -> int:
        """Return the time that a picture's name says [us]."""
        return int(stem) // self.ticks_per_us

    def scan_path(self, folder: Path, stem: str) -> Path:
        """Return where a scan's picture is written."""
        return folder / self.scans_folders[0] / f"{stem}.png"

    def stems(self, folder: Path) -> list[str]:
        """Return the names of the pictures in a dataset written in this layout, by time."""
        return sorted((path.stem for path in (folder / self.scans_folders[0]).glob("*.png")), key=int)

    def write_scan(self, path: Path, scan: PolarScan) -> None:
        """Write a scan's picture, whole or not at all."""
        write_png(path, scan, ticks_per_us=self.ticks_per_us)

    def read_scan(self, path: Path, sensor: Sensor) -> PolarScan:
        """Read a scan's picture; for errors see `read_png`."""
        return read_png(path, sensor=sensor, ticks_per_us=self.ticks_per_us)


def numbers(path: Path, lines: Sequence[str], *, count: int, first: int) -> NDArray[np.float64]:
    """Return `lines` of `count` or more numbers with commas as an array (N, count); `first` is their number.

    Raises:
        DatasetError: a line is no such row; the message names the file and the line.
    """
    rows = np.empty((len(lines), count))
    for i, line in enumerate(lines):
        try:
            rows[i] = [float(word) for word in line.split(",")[:count]]
        except ValueError as error:
            raise DatasetError(f"{path}: line {first + i} is no row of {count} numbers: {line!r}") from error
    return rows


def interpolated(times: NDArray, poses: NDArray[np.float64], at: NDArray) -> NDArray[np.float64]:
    """Return poses (N, 4) at times `at` (N,) linearly between those (T, 4) at `times` (T,), NaN outside."""
    yaw = np.unwrap(poses[:, 3])
    columns = [poses[:, 0], poses[:, 1], poses[:, 2], yaw]
    origin = times[0]  # time stamps in nanoseconds do not fit a float
    clock, ask = (times - origin).astype(np.float64), (np.asarray(at) - origin).astype(np.float64)
    return np.stack([np.interp(ask, clock, each, left=np.nan, right=np.nan) for each in columns], axis=1)
