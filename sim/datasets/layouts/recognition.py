"""The layout and the radar of a folder of scans by its files, where no echoscape.json names them.

Source: docs/conventions.md; names of folders, the width of an image, its encoder and the unit of its times.
"""

from dataclasses import replace
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from echoscape.sim.datasets.files.atomic_write import DatasetError
from echoscape.sim.datasets.files.navtech_png import HEADER_COLUMNS, azimuth_ticks
from echoscape.sim.datasets.layouts.boreas import UPDATED_BIN_M, UPDATED_US
from echoscape.sim.datasets.layouts.layout import Layout
from echoscape.sim.datasets.layouts.registry import LAYOUTS
from echoscape.sim.sensor.registry import SENSORS
from echoscape.sim.sensor.sensor import Sensor

_YEAR_2100_US = 4_102_444_800_000_000
_SHORTEST_TIME = 13
"""Least digits of an image's name that is a time and not a running number."""
_CANDIDATES = {
    "oxford": (SENSORS["cts350x"],),
    "mulran": (SENSORS["cir204"],),
    "boreas": (SENSORS["cir304"], SENSORS["cir304_rt"]),
}


def scans_folder(folder: Path, wanted: Layout | None) -> tuple[Layout | None, Path]:
    """Find the images of a data set.

    Args:
        folder: Its folder, which may hold the images itself.
        wanted: Its layout, None where it is not known.

    Returns:
        The layout, None if the names of the folders do not show it, and the folder of the images.
    """
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


def is_time(stem: str) -> bool:
    """Tell a time from a running number.

    Args:
        stem: Name of an image, without the suffix.

    Returns:
        Whether it is a time.
    """
    return stem.isdecimal() and len(stem) >= _SHORTEST_TIME


def layout_by_image(image: NDArray[np.uint8]) -> Layout:
    """Recognise a layout by one image: MulRan counts nanoseconds, Oxford is 3768 bins wide.

    Args:
        image: The image as it is in its file (azimuths, columns) uint8.

    Returns:
        The layout.
    """
    if azimuth_ticks(image)[0] > _YEAR_2100_US:
        return LAYOUTS["mulran"]
    if image.shape[1] == HEADER_COLUMNS + SENSORS["cts350x"].bins:
        return LAYOUTS["oxford"]
    return LAYOUTS["boreas"]


def sensor_by_image(path: Path, image: NDArray[np.uint8], layout: Layout) -> Sensor:
    """Find the radar that writes images of this size in this layout.

    Args:
        path: File of the image.
        image: The image as it is in its file (azimuths, columns) uint8.
        layout: Layout of the folder.

    Returns:
        The radar, with the encoder, the direction of sweeps and the bins of the image.

    Raises:
        DatasetError: There is none; the message names the file.
    """
    rows, columns = image.shape
    for sensor in _CANDIDATES[layout.name]:
        if (sensor.azimuths, sensor.bins) == (rows, columns - HEADER_COLUMNS):
            named_us = layout.time_us(path.stem) if is_time(path.stem) else None
            return _as_written(sensor, image, named_us)
    widths = ", ".join(f"{each.azimuths} x {HEADER_COLUMNS + each.bins}" for each in _CANDIDATES[layout.name])
    raise DatasetError(
        f"{path}: {rows} rows and {columns} columns are not a scan of the layout {layout.name} "
        f"({widths}); give its sensor"
    )


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
