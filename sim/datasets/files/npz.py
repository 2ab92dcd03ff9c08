"""Arrays by name as a NumPy archive that `numpy.load` opens: the same bytes for the same arrays.

Entries are dated 1980, as those of zip archives without a clock are, and compressed by deflate.
"""

import io
import zipfile
import zlib
from collections.abc import Mapping
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from echoscape.sim.datasets.files.atomic_write import DatasetError


def archive_bytes(arrays: Mapping[str, NDArray], *, level: int) -> bytes:
    """Encode arrays as an archive.

    Args:
        arrays: Arrays by name.
        level: Level of compression, 0 to 9.

    Returns:
        The bytes of an .npz archive, in the order of `arrays`.
    """
    archive = io.BytesIO()
    with zipfile.ZipFile(archive, "w") as entries:
        for name, array in arrays.items():
            entry = io.BytesIO()
            np.lib.format.write_array(entry, np.ascontiguousarray(array).reshape(array.shape), version=(1, 0))
            info = zipfile.ZipInfo(f"{name}.npy")  # dated 1980-01-01 by default
            entries.writestr(info, entry.getbuffer(), zipfile.ZIP_DEFLATED, level)
    return archive.getvalue()


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


def read_archive(
    path: Path, names: tuple[str, ...], *, kind: str, optional: tuple[str, ...] = ()
) -> dict[str, NDArray]:
    """Read some arrays of an archive; the others are not decompressed.

    Args:
        path: The file.
        names: Names of the arrays.
        kind: What the file is called in messages.
        optional: Names of arrays that the archive may lack.

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
            present = (*names, *(name for name in optional if name in archive))
            return {name: archive[name] for name in present}
    except DatasetError:
        raise
    except (OSError, ValueError, EOFError, TypeError, zipfile.BadZipFile, zlib.error) as error:
        raise DatasetError(f"{path}: not a complete {kind} ({error})") from error
