"""A scan as the 8-bit grey PNG that Navtech's driver writes and Oxford, MulRan and Boreas publish.

Barnes et al., "The Oxford Radar RobotCar Dataset", ICRA 2020, and its files; the other two follow it but for
the unit of time (MulRan: nanoseconds) and column 10 (Boreas-RT: the direction of the sweep).
"""

import struct
import zlib
from pathlib import Path

import numpy as np
from numpy.typing import NDArray
from PIL import Image

from echoscape.sim.datasets.files.atomic_write import DatasetError, write_atomic
from echoscape.sim.datasets.polar_scan import PolarScan
from echoscape.sim.sensor.cts350x import CTS350X
from echoscape.sim.sensor.sensor import Sensor

HEADER_COLUMNS = 11
"""Columns before the first range bin: 8 of time stamp, 2 of encoder, 1 of validity or sweep direction."""

_YES = 255
"""Column 10 of a valid azimuth, or where sweeps alternate of one whose sweep rises."""
_SIGNATURE = b"\x89PNG\r\n\x1a\n"
_SUB = 1
"""PNG's filter type of pixels as differences to their left neighbours: neighbouring bins are alike."""


def png_bytes(scan: PolarScan, *, ticks_per_us: int = 1) -> bytes:
    """Encode a scan.

    Args:
        scan: The scan.
        ticks_per_us: Unit of the time stamps, per microsecond.

    Returns:
        The bytes of a PNG with (azimuths, 11 + bins) pixels.
    """
    azimuths, bins = scan.codes.shape
    image = np.empty((azimuths, HEADER_COLUMNS + bins), np.uint8)
    ticks = scan.timestamp_us * ticks_per_us
    image[:, :8] = ticks.astype("<i8").view(np.uint8).reshape(azimuths, 8)
    image[:, 8:10] = scan.encoder.astype("<u2").view(np.uint8).reshape(azimuths, 2)
    image[:, 10] = np.where(scan.valid if scan.rising is None else scan.rising, _YES, 0)
    image[:, HEADER_COLUMNS:] = scan.codes
    return _grey_png(image)


def _grey_png(image: NDArray[np.uint8]) -> bytes:
    """Encode pixels as an 8-bit grey PNG (W3C, "Portable Network Graphics (PNG) Specification").

    Differences of neighbours in Huffman codes alone, without a search for repetitions, are as small as zlib's
    default on whole pixels makes them, in a sixth of the time.
    """
    rows, columns = image.shape
    filtered = np.empty((rows, 1 + columns), np.uint8)
    filtered[:, 0], filtered[:, 1] = _SUB, image[:, 0]
    np.subtract(image[:, 1:], image[:, :-1], out=filtered[:, 2:])
    packer = zlib.compressobj(strategy=zlib.Z_HUFFMAN_ONLY, memLevel=9)
    data = packer.compress(filtered.data) + packer.flush()
    header = struct.pack(">IIBBBBB", columns, rows, 8, 0, 0, 0, 0)  # 8 bits, grey, deflate, not interlaced
    return _SIGNATURE + _chunk(b"IHDR", header) + _chunk(b"IDAT", data) + _chunk(b"IEND", b"")


def _chunk(kind: bytes, data: bytes) -> bytes:
    """Return a chunk: length, type, data, CRC of type and data."""
    return struct.pack(">I", len(data)) + kind + data + struct.pack(">I", zlib.crc32(data, zlib.crc32(kind)))


def write_png(path: Path, scan: PolarScan, *, ticks_per_us: int = 1) -> None:
    """Write a scan, whole or not at all.

    Args:
        path: File to write.
        scan: The scan.
        ticks_per_us: Unit of the time stamps, per microsecond.

    Raises:
        OSError: The folder cannot be written to.
    """
    write_atomic(path, png_bytes(scan, ticks_per_us=ticks_per_us))


def read_png(path: Path, *, sensor: Sensor = CTS350X, ticks_per_us: int = 1) -> PolarScan:
    """Read a scan.

    Args:
        path: The file.
        sensor: The radar that took it, which gives azimuths, bins and bin size.
        ticks_per_us: Unit of the time stamps, per microsecond.

    Returns:
        The scan, without truth.

    Raises:
        DatasetError: The file is absent, cut short, or no scan of this sensor; the message names it.
    """
    image = grey_pixels(Path(path))
    expected = (sensor.azimuths, HEADER_COLUMNS + sensor.bins)
    if image.shape != expected:
        raise DatasetError(
            f"{path}: a scan of {sensor.name} has {expected[0]} rows and {expected[1]} columns "
            f"({HEADER_COLUMNS} + {sensor.bins} bins), this file has {image.shape[0]} and {image.shape[1]}"
        )
    alternating = sensor.chirps == "alternating"
    mark = image[:, 10] == _YES
    return PolarScan(
        codes=image[:, HEADER_COLUMNS:].copy(),
        timestamp_us=azimuth_ticks(image) // ticks_per_us,
        encoder=image[:, 8:10].copy().view("<u2")[:, 0].astype(np.uint16),
        valid=np.ones_like(mark) if alternating else mark,
        bin_m=sensor.bin_m,
        rising=mark if alternating else None,
        encoder_per_turn=sensor.encoder_per_turn,
    )


def is_complete_png(path: Path) -> bool:
    """Check that a PNG is complete: every chunk has its check sum, and the last one is IEND.

    A chunk is length, type, data, CRC of type and data (W3C, "Portable Network Graphics (PNG)
    Specification", 5.3).

    Args:
        path: A file that may not exist.

    Returns:
        Whether the file exists and is complete.
    """
    try:
        data = memoryview(path.read_bytes())
    except FileNotFoundError:
        return False
    at, kind = len(_SIGNATURE), b""
    if data[:at] != _SIGNATURE:
        return False
    while kind != b"IEND" and at + 12 <= len(data):
        end = at + 8 + int.from_bytes(data[at : at + 4])
        kind = bytes(data[at + 4 : at + 8])
        if zlib.crc32(data[at + 4 : end]) != int.from_bytes(data[end : end + 4]):
            return False
        at = end + 4
    return kind == b"IEND" and at == len(data)


def azimuth_ticks(image: NDArray[np.uint8]) -> NDArray[np.int64]:
    """Decode the time stamps of a scan.

    Args:
        image: Pixels of its PNG (azimuths, columns).

    Returns:
        Time stamps (azimuths,) int64 in the file's unit.
    """
    return image[:, :8].copy().view("<i8")[:, 0].astype(np.int64)


def grey_pixels(path: Path) -> NDArray[np.uint8]:
    """Read the pixels of an 8-bit grey PNG.

    Args:
        path: The file.

    Returns:
        Pixels (azimuths, columns).

    Raises:
        DatasetError: The file is absent, cut short, or another kind of image; the message names it.
    """
    if not path.is_file():
        raise DatasetError(f"{path}: no such scan")
    try:
        with Image.open(path, formats=["PNG"]) as image:
            if image.mode != "L":
                raise DatasetError(f"{path}: a scan is an 8-bit grey PNG, this one has mode {image.mode}")
            return np.asarray(image)
    except (OSError, SyntaxError) as error:
        raise DatasetError(f"{path}: not a complete PNG file ({error})") from error
