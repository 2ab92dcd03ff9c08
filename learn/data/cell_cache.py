"""The averaged range cells of a folder's scans in one memory-mapped file: a pair takes milliseconds to read.

Source: NumPy's .npy format, (scans, azimuths, cells) uint8, which `numpy.load` opens. The file's name has a
hash of the settings and of the scans' files, so that a cache of other data is never read.
"""

import hashlib
import os
from pathlib import Path

import numpy as np
from numpy.lib.format import open_memmap
from numpy.typing import NDArray

from echoscape.learn.data.image import range_cells
from echoscape.learn.data.image_settings import ImageSettings
from echoscape.scenes.core.progress import Progress
from echoscape.sim.datasets.files.atomic_write import DatasetError, temporary_beside
from echoscape.sim.datasets.polar_scan import PolarScan
from echoscape.sim.datasets.scan_folder import ScanFolder

_FORMAT = 1


def range_cells_of(scan: PolarScan, folder: ScanFolder, image: ImageSettings) -> NDArray[np.uint8]:
    """Average a scan over range cells.

    Args:
        scan: The scan.
        folder: The folder that it is from, which knows the offset of its ranges.
        image: How scans become images.

    Returns:
        Mean codes (azimuths, cells) uint8.

    Raises:
        ValueError: The scan has no azimuths or bins.
    """
    return range_cells(scan.codes, scan.bin_m, image, range_offset_m=folder.range_offset_m)


def cached_range_cells(
    folder: ScanFolder, image: ImageSettings, *, cache: Path, progress: Progress | None = None
) -> NDArray[np.uint8]:
    """Return the range cells of a folder's scans, computed once and then mapped from the cache.

    Args:
        folder: The scans.
        image: How scans become images.
        cache: Folder of the cache, made where it is absent.
        progress: Called after each scan that is computed.

    Returns:
        Codes averaged over range cells (scans, azimuths, cells), read-only.

    Raises:
        DatasetError: A scan cannot be read, or the cache is damaged.
        OSError: The cache cannot be written.
    """
    path = cache / f"cells_{_fingerprint(folder, image)}.npy"
    shape = (len(folder), folder.sensor.azimuths, image.cells)
    if not path.is_file():
        path.parent.mkdir(parents=True, exist_ok=True)
        _write(path, folder, image, shape, progress)
    cells = np.load(path, mmap_mode="r")
    if cells.shape != shape or cells.dtype != np.uint8:
        raise DatasetError(f"{path}: holds {cells.dtype} {cells.shape}, expected uint8 {shape}; delete it")
    return cells


def _write(
    path: Path, folder: ScanFolder, image: ImageSettings, shape: tuple[int, ...], progress: Progress | None
) -> None:
    temporary = temporary_beside(path)
    try:
        cells = open_memmap(temporary, mode="w+", dtype=np.uint8, shape=shape)
        for index, scan in enumerate(folder):
            cells[index] = range_cells_of(scan, folder, image)
            if progress is not None:
                progress(f"cells of {folder.folder.name}", index + 1, len(folder))
        cells.flush()
        os.replace(temporary, path)
    except BaseException:
        temporary.unlink(missing_ok=True)
        raise


def _fingerprint(folder: ScanFolder, image: ImageSettings) -> str:
    files = [(path.name, path.stat().st_size) for path in folder.paths]
    content = repr((_FORMAT, image, folder.sensor.bin_m, folder.range_offset_m, files))
    return hashlib.sha256(content.encode()).hexdigest()[:16]
