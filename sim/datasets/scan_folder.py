"""Folders of scans, real or simulated: Oxford, MulRan, Boreas and Boreas-RT, read as the same `PolarScan`.

A simulated folder is described by its echoscape.json; a real one is recognised by its files, the width of its
first image and the unit of its time stamps (docs/conventions.md). Images are read one at a time.
"""

import operator
from collections.abc import Iterator
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path
from typing import SupportsIndex, overload

import numpy as np
from numpy.typing import NDArray

from echoscape.sim.datasets.beat_signal import BeatSignal
from echoscape.sim.datasets.files.atomic_write import DatasetError
from echoscape.sim.datasets.files.beat_npz import read_beat
from echoscape.sim.datasets.files.metadata import FILE_NAME, read_manifest, sensor_of
from echoscape.sim.datasets.files.navtech_png import grey_pixels
from echoscape.sim.datasets.files.truth_npz import read_truth
from echoscape.sim.datasets.layouts.boreas import RT_OFFSET_M
from echoscape.sim.datasets.layouts.layout import Layout
from echoscape.sim.datasets.layouts.recognition import (
    is_time,
    layout_by_image,
    scans_folder,
    sensor_by_image,
)
from echoscape.sim.datasets.layouts.registry import layout_named, layout_of
from echoscape.sim.datasets.polar_scan import PolarScan, ScanTruth
from echoscape.sim.datasets.se2 import from_world, relative
from echoscape.sim.sensor.registry import SENSORS
from echoscape.sim.sensor.sensor import Sensor


@dataclass(frozen=True, kw_only=True)
class ScanFolder:
    """A folder of scans; `len`, iteration, indexes and `read` give them in order of time.

    Attributes:
        folder: Folder of the data set.
        layout: Its layout, recognised or given.
        sensor: Its radar, recognised or given.
        paths: Paths of its images.
        simulated: Whether it was simulated, and so has ground truth.
        range_offset_m: Offset to add to the ranges of bins, (k + 1/2) bin_m, for true ranges [m].
    """

    folder: Path
    layout: Layout
    sensor: Sensor
    paths: tuple[Path, ...]
    simulated: bool
    range_offset_m: float = 0.0

    def __len__(self) -> int:
        """Return the number of scans."""
        return len(self.paths)

    def __iter__(self) -> Iterator[PolarScan]:
        """Read one scan after the other, without truth."""
        return (self.read(index) for index in range(len(self)))

    @overload
    def __getitem__(self, index: SupportsIndex) -> PolarScan: ...

    @overload
    def __getitem__(self, index: slice) -> list[PolarScan]: ...

    def __getitem__(self, index: SupportsIndex | slice) -> PolarScan | list[PolarScan]:
        """Read a scan, or those of a slice, without truth.

        Args:
            index: Number of the scan in order of time, negative ones from the end, or a slice of numbers.

        Returns:
            The scan, or a list of scans.

        Raises:
            IndexError: There is no such scan.
            TypeError: The index is neither an integer nor a slice.
            DatasetError: A file is cut short or has another width; the message names it.
        """
        if isinstance(index, slice):
            return [self.read(number) for number in range(*index.indices(len(self)))]
        return self.read(index)

    def read(self, index: SupportsIndex) -> PolarScan:
        """Read a scan, without its truth.

        Args:
            index: Number of the scan in order of time, negative ones from the end.

        Returns:
            The scan.

        Raises:
            IndexError: There is no such scan.
            TypeError: The index is no integer.
            DatasetError: Its file is cut short or has another width; the message names it.
        """
        return self.layout.read_scan(self._path(index), self.sensor)

    def truth(self, index: SupportsIndex) -> ScanTruth | None:
        """Read the ground truth of a scan.

        Args:
            index: Number of the scan in order of time, negative ones from the end.

        Returns:
            The truth, None in a folder that was not simulated.

        Raises:
            IndexError: There is no such scan.
            TypeError: The index is no integer.
            DatasetError: The folder was simulated and its truth is gone, or a file of it is damaged; the
                message names it.
        """
        path = self._path(index)
        if not self.simulated:
            return None
        if not (self.folder / "truth").is_dir():
            raise DatasetError(f"{self.folder}: the folder holds no truth: it has no folder truth/")
        return read_truth(self.folder / "truth" / f"{path.stem}.npz")

    def beat(self, index: SupportsIndex) -> BeatSignal | None:
        """Read the beat signal of a scan.

        Args:
            index: Number of the scan in order of time, negative ones from the end.

        Returns:
            The beat signal, None where none was kept.

        Raises:
            IndexError: There is no such scan.
            TypeError: The index is no integer.
            DatasetError: Its beat file is absent or damaged; the message names it.
        """
        path = self.folder / "beat" / f"{self._path(index).stem}.npz"
        return read_beat(path, sensor=self.sensor) if path.parent.is_dir() else None

    def _path(self, index: SupportsIndex) -> Path:
        return self.paths[number_of(index, len(self))]

    @cached_property
    def stems(self) -> tuple[str, ...]:
        """Names of the scans in the layout, which are those of their files unless these are no times."""
        if all(is_time(path.stem) for path in self.paths):
            return tuple(path.stem for path in self.paths)
        return tuple(self.layout.stem(scan.timestamp_us) for scan in self)

    @property
    def timestamps_us(self) -> NDArray[np.int64]:
        """Times that name the scans (N,) [us]: first (Oxford), last (MulRan) or middle azimuth (Boreas)."""
        return np.array([self.layout.time_us(stem) for stem in self.stems], np.int64)

    def poses(self) -> NDArray[np.float64] | None:
        """Read the poses of the car.

        Returns:
            World poses at mid-scan (N, 4): x, y, z [m], yaw [rad], z up and yaw counter-clockwise; for Oxford
            in the world of the first scan. NaN for scans without a pose; None where the folder has no poses.

        Raises:
            DatasetError: A file of poses is not valid; the message names it.
        """
        return self.layout.read_poses(self.folder, self.stems, self.sensor)

    def motion(self) -> NDArray[np.float64] | None:
        """Compute the motion from each scan to the next.

        Returns:
            Poses of the later scan in the frame of the earlier one (N - 1, 4): x forward, y right, z down
            [m], yaw clockwise [rad]; None where the folder has no poses.

        Raises:
            DatasetError: A file of poses is not valid; the message names it.
        """
        poses = self.poses()
        if poses is None:
            return None
        planar, down_m = from_world(poses), -poses[:, 2]
        x, y, yaw = relative(planar[:-1], planar[1:]).T
        return np.stack([x, y, np.diff(down_m), yaw], axis=-1)


def number_of(index: SupportsIndex, count: int) -> int:
    """Return the number, 0 or more, of one of several scans.

    Args:
        index: Its index; negative ones count from the end.
        count: Number of scans.

    Returns:
        The number.

    Raises:
        IndexError: There is no such scan.
        TypeError: The index is no integer.
    """
    number = operator.index(index)
    if not -count <= number < count:
        raise IndexError(f"index must be between {-count} and {count - 1}, got {number}")
    return number % count


def open_folder(folder: Path | str, *, layout: str | None = None, sensor: Sensor | None = None) -> ScanFolder:
    """Open a folder of scans.

    Args:
        folder: Folder of a data set, or of images alone.
        layout: Name of its layout, recognised by default.
        sensor: Its radar, recognised by default.

    Returns:
        The folder, whose scans are not read yet.

    Raises:
        DatasetError: It is no folder, has no scans, or cannot be recognised; the message names it.
        ValueError: There is no layout of this name.
    """
    folder = Path(folder)
    if not folder.is_dir():
        raise DatasetError(f"{folder}: no such folder")
    wanted = None if layout is None else layout_named(layout)
    simulated = (folder / FILE_NAME).is_file()
    if simulated:
        content = read_manifest(folder)
        wanted, sensor = wanted or layout_of(content), sensor or sensor_of(content)
    found, place = scans_folder(folder, wanted)
    paths = _images(place)
    image = grey_pixels(paths[0])
    wanted = wanted or found or layout_by_image(image)
    offset_m = 0.0
    if sensor is None:
        sensor = sensor_by_image(paths[0], image, wanted)
        if sensor.bins == SENSORS["cir304_rt"].bins:
            offset_m = RT_OFFSET_M - sensor.bin_m / 2
    return ScanFolder(
        folder=folder,
        layout=wanted,
        sensor=sensor,
        paths=paths,
        simulated=simulated,
        range_offset_m=offset_m,
    )


def _images(place: Path) -> tuple[Path, ...]:
    """Return the images in a folder by number."""
    paths = [path for path in place.glob("*.png") if not path.name.startswith(".")]
    if not paths:
        raise DatasetError(f"{place}: no scans (PNG files)")
    return tuple(sorted(paths, key=lambda path: (len(path.stem), path.stem)))
