"""The range cells of a folder's scans in one file, mapped into memory: a pair takes milliseconds to read.

Source: the format is NumPy's .npy, (scans, azimuths, cells) uint8, which `numpy.load` opens. The name carries
a fingerprint of the settings and of the scans' files, so that a cache of something else is never read.
"""

import hashlib
import os
from collections.abc import Callable
from pathlib import Path

import numpy as np
from numpy.lib.format import open_memmap
from numpy.typing import NDArray

from echoscape.learn.data.image import ImageSettings, range_cells
from echoscape.sim.datasets.files.atomic_write import DatasetError, temporary_beside
from echoscape.sim.datasets.scan_folder import ScanFolder

_FORMAT = 1

Report = Callable[[str, int, int], None]
"""Told of progress: what is made, how many are done, of how many."""


def cells_of(
    folder: ScanFolder, image: ImageSettings, *, cache: Path | None = None, report: Report | None = None
) -> NDArray[np.uint8]:
    """Return the cells (scans, azimuths, cells) uint8 of a folder's scans, made once and then mapped.

    cache: where the file is kept, by default `cache` in the folder itself.

    Raises:
        DatasetError: a scan cannot be read.
        OSError: the cache cannot be written.
    """
    path = (folder.folder / "cache" if cache is None else cache) / f"cells_{_fingerprint(folder, image)}.npy"
    shape = (len(folder), folder.sensor.azimuths, image.cells)
    if not path.is_file():
        path.parent.mkdir(parents=True, exist_ok=True)
        _write(path, folder, image, shape, report)
    cells = np.load(path, mmap_mode="r")
    if cells.shape != shape or cells.dtype != np.uint8:
        raise DatasetError(f"{path}: holds {cells.dtype} {cells.shape}, wanted uint8 {shape}; delete it")
    return cells


def _write(
    path: Path, folder: ScanFolder, image: ImageSettings, shape: tuple[int, ...], report: Report | None
) -> None:
    temporary = temporary_beside(path)
    try:
        cells = open_memmap(temporary, mode="w+", dtype=np.uint8, shape=shape)
        for index, scan in enumerate(folder):
            cells[index] = range_cells(scan.codes, scan.bin_m, image, range_offset_m=folder.range_offset_m)
            if report is not None:
                report(f"cells of {folder.folder.name}", index + 1, len(folder))
        cells.flush()
        os.replace(temporary, path)
    except BaseException:
        temporary.unlink(missing_ok=True)
        raise


def _fingerprint(folder: ScanFolder, image: ImageSettings) -> str:
    files = [(path.name, path.stat().st_size) for path in folder.paths]
    told = repr((_FORMAT, image, folder.sensor.bin_m, folder.range_offset_m, files))
    return hashlib.sha256(told.encode()).hexdigest()[:16]
