"""Folders of scans, real or simulated: Oxford, MulRan, Boreas and Boreas-RT, read as the same `PolarScan`.

A simulated folder is described by its echoscape.json; a real one is recognised by its files, the width of its
first image and the unit of its time stamps (docs/conventions.md). Images are read one at a time.
"""

from collections.abc import Iterator
from dataclasses import dataclass, replace
from functools import cached_property
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from echoscape.sim.datasets.beat_signal import BeatSignal
from echoscape.sim.datasets.files.atomic_write import DatasetError
from echoscape.sim.datasets.files.beat_npz import read_beat
from echoscape.sim.datasets.files.metadata import FILE_NAME, read_manifest, sensor_of
from echoscape.sim.datasets.files.navtech_png import HEADER_COLUMNS, azimuth_ticks, grey_pixels
from echoscape.sim.datasets.files.truth_npz import read_truth
from echoscape.sim.datasets.layouts.boreas import RT_OFFSET_M, UPDATED_BIN_M, UPDATED_US
from echoscape.sim.datasets.layouts.layout import Layout
from echoscape.sim.datasets.layouts.registry import LAYOUTS, layout_named, layout_of
from echoscape.sim.datasets.polar_scan import PolarScan, ScanTruth
from echoscape.sim.datasets.se2 import from_world, relative
from echoscape.sim.sensor.registry import SENSORS
from echoscape.sim.sensor.sensor import Sensor

_YEAR_2100_US = 4_102_444_800_000_000
_SHORTEST_TIME = 13
"""Least digits of an image's name that is a time and not a running number."""


@dataclass(frozen=True, kw_only=True)
class ScanFolder:
    """A folder of scans; `len`, iteration and `read` give them in order of time.

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

    def read(self, index: int) -> PolarScan:
        """Read a scan, without its truth.

        Args:
            index: Number of the scan in order of time.

        Returns:
            The scan.

        Raises:
            ValueError: There is no such scan.
            DatasetError: Its file is cut short or has another width; the message names it.
        """
        return self.layout.read_scan(self._path(index), self.sensor)

    def truth(self, index: int) -> ScanTruth | None:
        """Read the ground truth of a scan.

        Args:
            index: Number of the scan in order of time.

        Returns:
            The truth, None in a folder that was not simulated.

        Raises:
            ValueError: There is no such scan.
            DatasetError: Its truth file is absent or damaged; the message names it.
        """
        path = self._path(index)
        return read_truth(self.folder / "truth" / f"{path.stem}.npz") if self.simulated else None

    def beat(self, index: int) -> BeatSignal | None:
        """Read the beat signal of a scan.

        Args:
            index: Number of the scan in order of time.

        Returns:
            The beat signal, None where none was kept.

        Raises:
            ValueError: There is no such scan.
            DatasetError: Its beat file is absent or damaged; the message names it.
        """
        path = self.folder / "beat" / f"{self._path(index).stem}.npz"
        return read_beat(path, sensor=self.sensor) if path.parent.is_dir() else None

    def _path(self, index: int) -> Path:
        if not 0 <= index < len(self):
            raise ValueError(f"index must be between 0 and {len(self) - 1}, got {index}")
        return self.paths[index]

    @cached_property
    def stems(self) -> tuple[str, ...]:
        """Names of the scans in the layout, which are those of their files unless these are no times."""
        if all(_is_time(path.stem) for path in self.paths):
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
    found, place = _scans_folder(folder, wanted)
    paths = _images(place)
    image = grey_pixels(paths[0])
    wanted = wanted or found or _layout_by_first(image)
    offset_m = 0.0
    if sensor is None:
        sensor = _sensor_by_first(paths[0], image, wanted)
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


def _scans_folder(folder: Path, wanted: Layout | None) -> tuple[Layout | None, Path]:
    """Return the folder of the images, and the layout if the names of the folders show it."""
    candidates = LAYOUTS.values() if wanted is None else (wanted,)
    for each in candidates:
        for name in each.scans_folders:
            if (folder / name).is_dir() and any((folder / name).glob("*.png")):
                return _by_neighbours(folder, each) if wanted is None else wanted, folder / name
    return wanted, folder


def _by_neighbours(folder: Path, layout: Layout) -> Layout | None:
    """Return the layout by other files: Oxford and Boreas both keep scans in `radar`."""
    if "radar" not in layout.scans_folders:
        return layout
    if (folder / "applanix").is_dir():
        return LAYOUTS["boreas"]
    if (folder / "gt").is_dir() or (folder / "radar.timestamps").is_file():
        return LAYOUTS["oxford"]
    return None


def _images(place: Path) -> tuple[Path, ...]:
    """Return the images in a folder by number."""
    paths = [path for path in place.glob("*.png") if not path.name.startswith(".")]
    if not paths:
        raise DatasetError(f"{place}: no scans (PNG files)")
    return tuple(sorted(paths, key=lambda path: (len(path.stem), path.stem)))


def _is_time(stem: str) -> bool:
    return stem.isdecimal() and len(stem) >= _SHORTEST_TIME


def _layout_by_first(image: NDArray[np.uint8]) -> Layout:
    """Return the layout by one image: MulRan counts nanoseconds, Oxford is 3768 bins wide."""
    if azimuth_ticks(image)[0] > _YEAR_2100_US:
        return LAYOUTS["mulran"]
    if image.shape[1] == HEADER_COLUMNS + SENSORS["cts350x"].bins:
        return LAYOUTS["oxford"]
    return LAYOUTS["boreas"]


def _sensor_by_first(path: Path, image: NDArray[np.uint8], layout: Layout) -> Sensor:
    """Return the sensor that writes images of this size in this layout.

    Raises:
        DatasetError: There is none; the message names the file.
    """
    rows, columns = image.shape
    for sensor in _CANDIDATES[layout.name]:
        if (sensor.azimuths, sensor.bins) == (rows, columns - HEADER_COLUMNS):
            named_us = layout.time_us(path.stem) if _is_time(path.stem) else None
            return _as_written(sensor, image, named_us)
    widths = ", ".join(f"{each.azimuths} x {HEADER_COLUMNS + each.bins}" for each in _CANDIDATES[layout.name])
    raise DatasetError(
        f"{path}: {rows} rows and {columns} columns are not a scan of the layout {layout.name} "
        f"({widths}); give its sensor"
    )


_CANDIDATES = {
    "oxford": (SENSORS["cts350x"],),
    "mulran": (SENSORS["cir204"],),
    "boreas": (SENSORS["cir304"], SENSORS["cir304_rt"]),
}


def _as_written(sensor: Sensor, image: NDArray[np.uint8], named_us: int | None) -> Sensor:
    """Return a sensor as one image shows it: direction of sweeps, encoder, bins after the radar's update.

    Bins go by the time in the image's name, as in pyboreas, or by that of its first azimuth.
    """
    mark = image[:, 10] > 0
    if sensor.chirps == "alternating" and mark.all():
        sensor = replace(sensor, chirps="rising")
    taken_us = int(azimuth_ticks(image)[0]) if named_us is None else named_us
    if sensor.name == "cir304" and taken_us > UPDATED_US:
        sensor = replace(sensor, bin_m=UPDATED_BIN_M)
    if sensor.encoder_first != image[0, 8] + 256 * int(image[0, 9]):
        sensor = replace(sensor, encoder_first=int(image[0, 8]) + 256 * int(image[0, 9]))
    return sensor
