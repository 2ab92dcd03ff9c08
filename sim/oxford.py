"""The files of the Oxford Radar RobotCar data set: scans as PNG, their times, and the motion between them.

Barnes et al., "The Oxford Radar RobotCar Dataset", ICRA 2020, and the files and loaders published with it.
docs/conventions.md says how its axes and times relate to ours.
"""

import csv
import io
import math
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray
from PIL import Image

from echoscape.sim.cts350x import CTS350X
from echoscape.sim.polar_scan import PolarScan
from echoscape.sim.sensor import Sensor
from echoscape.sim.whole_files import DatasetError, write_whole

HEADER_COLUMNS = 11
"""Columns before the first range bin: 8 of time stamp, 2 of encoder, 1 of validity."""

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

_VALID = 255
_RUN_LENGTHS = 3
"""zlib's Z_RLE: twice as fast as the default on scans, smaller, and the same bytes on every processor."""


# ---------------------------------------------------------------------- scans


def png_bytes(scan: PolarScan) -> bytes:
    """Return a scan as the 8-bit grey PNG that the sensor's driver writes, (azimuths, 11 + bins)."""
    azimuths, bins = scan.codes.shape
    image = np.empty((azimuths, HEADER_COLUMNS + bins), np.uint8)
    image[:, :8] = scan.timestamp_us.astype("<i8").view(np.uint8).reshape(azimuths, 8)
    image[:, 8:10] = scan.encoder.astype("<u2").view(np.uint8).reshape(azimuths, 2)
    image[:, 10] = np.where(scan.valid, _VALID, 0)
    image[:, HEADER_COLUMNS:] = scan.codes
    data = io.BytesIO()
    Image.fromarray(image).save(data, "png", compress_level=6, compress_type=_RUN_LENGTHS)
    return data.getvalue()


def write_png(path: Path, scan: PolarScan) -> None:
    """Write a scan to `path`, whole or not at all."""
    write_whole(path, png_bytes(scan))


def read_png(path: Path, *, sensor: Sensor = CTS350X) -> PolarScan:
    """Read the scan in `path`; its rows, bins and bin size are those of `sensor`. It has no truth.

    Raises:
        DatasetError: the file is absent, cut short, or no scan of this sensor; the message names it.
    """
    image = _grey_pixels(Path(path))
    expected = (sensor.azimuths, HEADER_COLUMNS + sensor.bins)
    if image.shape != expected:
        raise DatasetError(
            f"{path}: a scan of {sensor.name} has {expected[0]} rows and {expected[1]} columns "
            f"({HEADER_COLUMNS} + {sensor.bins} bins), this file has {image.shape[0]} and {image.shape[1]}"
        )
    return PolarScan(
        codes=image[:, HEADER_COLUMNS:].copy(),
        timestamp_us=image[:, :8].copy().view("<i8")[:, 0].astype(np.int64),
        encoder=image[:, 8:10].copy().view("<u2")[:, 0].astype(np.uint16),
        valid=image[:, 10] == _VALID,
        bin_m=sensor.bin_m,
    )


def _grey_pixels(path: Path) -> NDArray[np.uint8]:
    """Return the pixels (rows, columns) of an 8-bit grey PNG."""
    if not path.is_file():
        raise DatasetError(f"{path}: no such scan")
    try:
        with Image.open(path, formats=["PNG"]) as image:
            if image.mode != "L":
                raise DatasetError(f"{path}: a scan is an 8-bit grey PNG, this one has mode {image.mode}")
            return np.asarray(image)
    except (OSError, SyntaxError) as error:
        raise DatasetError(f"{path}: not a whole PNG file ({error})") from error


# ---------------------------------------------------------------------- time stamps


def write_timestamps(path: Path, stamps_us: Sequence[int]) -> None:
    """Write `radar.timestamps`: the time of each scan's first row, which names its file, and 1 for valid."""
    write_whole(path, "".join(f"{stamp} 1\n" for stamp in stamps_us).encode())


def read_timestamps(path: Path) -> list[int]:
    """Return the time stamps in `radar.timestamps` [us].

    Raises:
        DatasetError: the file is absent or a line of it is no `<timestamp> <valid>`; the message names both.
    """
    stamps = []
    for number, line in enumerate(_text(path).splitlines(), 1):
        words = line.split()
        if len(words) != 2 or not all(word.isdecimal() for word in words):
            raise DatasetError(f"{path}: line {number} is no '<timestamp> <valid>': {line!r}")
        stamps.append(int(words[0]))
    return stamps


def _text(path: Path) -> str:
    try:
        return path.read_text()
    except (OSError, UnicodeDecodeError) as error:
        raise DatasetError(f"{path}: cannot be read ({error})") from error


# ---------------------------------------------------------------------- the motion between scans


@dataclass(frozen=True, kw_only=True)
class OdometryRow:
    """The pose of the later frame (source) in the earlier one's (destination), mid-scan to mid-scan.

    x forward, y right, z down [m]; yaw clockwise seen from above [rad]. Times are mid-scan [us], those of
    `_radar_us` name the files [us].
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


def relative_pose(
    earlier: NDArray[np.float64], later: NDArray[np.float64]
) -> tuple[float, float, float, float]:
    """Return x, y, z [m] and yaw [rad] in Oxford axes of the pose `later` seen from the pose `earlier`.

    Both (4,): x, y, z [m] and yaw [rad] in the world, which has z up and yaw counter-clockwise.
    """
    east, north, up, turn = (float(value) for value in np.asarray(later) - np.asarray(earlier))
    cosine, sine = math.cos(earlier[3]), math.sin(earlier[3])
    forward, left = cosine * east + sine * north, cosine * north - sine * east
    yaw = math.remainder(-turn, 2 * math.pi)
    return forward + 0.0, 0.0 - left, 0.0 - up, yaw + 0.0


def write_odometry(path: Path, rows: Sequence[OdometryRow]) -> None:
    """Write `gt/radar_odometry.csv` with the data set's header and six decimals."""
    lines = [",".join(ODOMETRY_HEADER)]
    for row in rows:
        motion = ",".join(f"{value:.6f}" for value in (row.x, row.y, row.z, row.roll, row.pitch, row.yaw))
        files = f"{row.source_radar_us},{row.destination_radar_us}"
        lines.append(f"{row.source_us},{row.destination_us},{motion},{files}")
    write_whole(path, ("\n".join(lines) + "\n").encode())


def read_odometry(path: Path) -> list[OdometryRow]:
    """Return the rows of a `radar_odometry.csv`.

    Raises:
        DatasetError: the file is absent, has another header, or a row is no motion; the message names both.
    """
    lines = list(csv.reader(_text(path).splitlines()))
    if not lines or tuple(lines[0]) != ODOMETRY_HEADER:
        raise DatasetError(f"{path}: the header is not {','.join(ODOMETRY_HEADER)}")
    rows = []
    for number, words in enumerate(lines[1:], 2):
        try:
            times = [int(word) for word in (*words[:2], *words[8:])]
            x, y, z, roll, pitch, yaw = (float(word) for word in words[2:8])
            source, destination, source_radar, destination_radar = times
        except ValueError as error:
            raise DatasetError(f"{path}: line {number} is no row of odometry ({error})") from error
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
