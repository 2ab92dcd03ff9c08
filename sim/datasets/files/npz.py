"""Arrays by name as a NumPy archive that `numpy.load` opens: the same bytes for the same arrays.

Entries are dated 1980, as those of zip archives without a clock are, and compressed by deflate. They are
packed here (PKWARE, "APPNOTE.TXT - .ZIP File Format Specification", 4.3), as `zipfile` cannot choose zlib's
strategy: labels of cells, one byte each, come in runs, which a coder of runs packs faster and smaller.
"""

import io
import struct
import zipfile
import zlib
from collections.abc import Mapping
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from echoscape.sim.datasets.files.atomic_write import DatasetError

_FIELDS = "<HHHHHIIIHH"
"""What header and directory share: version, flags, method, time, date, CRC, two sizes, two lengths."""
_VERSION, _DEFLATED = 20, 8
_DATE = 1 << 5 | 1
"""1980-01-01."""
_FILE_MODE = 0o600 << 16


def archive_bytes(arrays: Mapping[str, NDArray], *, level: int) -> bytes:
    """Encode arrays as an archive.

    Args:
        arrays: Arrays by name, each below 4 GB.
        level: Level of compression, 0 to 9.

    Returns:
        The bytes of an .npz archive, in the order of `arrays`.
    """
    content, directory = bytearray(), bytearray()
    for name, array in arrays.items():
        path = f"{name}.npy".encode()
        entry = io.BytesIO()
        np.lib.format.write_array(entry, np.ascontiguousarray(array).reshape(array.shape), version=(1, 0))
        data = entry.getbuffer()
        packed = _deflated(data, level=level, strategy=_strategy(array))
        sizes = (zlib.crc32(data), len(packed), len(data), len(path), 0)
        fields = struct.pack(_FIELDS, _VERSION, 0, _DEFLATED, 0, _DATE, *sizes)
        directory += b"PK\1\2" + struct.pack("<H", _VERSION) + fields
        directory += struct.pack("<HHHII", 0, 0, 0, _FILE_MODE, len(content)) + path
        content += b"PK\3\4" + fields + path + packed
    count = len(arrays)
    end = struct.pack("<HHHHIIH", 0, 0, count, count, len(directory), len(content), 0)
    return bytes(content + directory + b"PK\5\6" + end)


def _strategy(array: NDArray) -> int:
    """Return zlib's fastest strategy for an array: runs of equal bytes where values are bytes."""
    return zlib.Z_RLE if array.dtype.itemsize == 1 else zlib.Z_DEFAULT_STRATEGY


def _deflated(data: memoryview, *, level: int, strategy: int) -> bytes:
    """Return data compressed by raw deflate, as entries of archives are."""
    packer = zlib.compressobj(level, zlib.DEFLATED, -zlib.MAX_WBITS, 9, strategy)
    return packer.compress(data) + packer.flush()


def ends_as_archive(path: Path) -> bool:
    """Check that an archive is complete, by its directory, which is its end; the rest is not read.

    Args:
        path: A file that may not exist.

    Returns:
        Whether the file exists and ends as an archive does.
    """
    try:
        with zipfile.ZipFile(path):
            return True
    except (FileNotFoundError, zipfile.BadZipFile):
        return False


def read_archive(path: Path, names: tuple[str, ...], *, kind: str) -> dict[str, NDArray]:
    """Read some arrays of an archive; the others are not decompressed.

    Args:
        path: The file.
        names: Names of the arrays.
        kind: What the file is called in messages.

    Returns:
        The arrays by name.

    Raises:
        DatasetError: The file is absent, damaged, or lacks one of `names`; the message names it and `kind`.
    """
    if not path.is_file():
        raise DatasetError(f"{path}: no such {kind}")
    try:
        with path.open("rb") as file, np.load(file, allow_pickle=False) as archive:
            lacking = [name for name in names if name not in archive]
            if lacking:
                raise DatasetError(f"{path}: a {kind} without {', '.join(lacking)}")
            return {name: archive[name] for name in names}
    except DatasetError:
        raise
    except (OSError, ValueError, EOFError, TypeError, zipfile.BadZipFile, zlib.error) as error:
        raise DatasetError(f"{path}: not a complete {kind} ({error})") from error
