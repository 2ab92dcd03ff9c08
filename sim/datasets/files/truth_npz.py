"""The ground truth of a scan as a NumPy archive that `numpy.load` opens, the same bytes for the same truth.

docs/conventions.md lists its arrays. They are compressed at level 1: some 18 ms and 0.3 MB a scan,
where level 6 takes six times as long to save a third.
"""

from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from echoscape.sim.datasets.files.atomic_write import DatasetError, write_atomic
from echoscape.sim.datasets.files.npz import archive_bytes, read_archive
from echoscape.sim.datasets.polar_scan import CellTruth, MoverBoxes, ScanTruth

_LEVEL = 1
_CELLS = ("component", "instance", "class_id", "bounces", "moving", "displaced")
_SCAN = {
    "pose": "pose",
    "attitude": "attitude",
    "middle_pose": "middle_pose",
    "middle_us": "middle_us",
    "saturated": "saturated",
    "first_m": "first_obstacle_m",
}
_BOXES = {
    "box_instance": "instance",
    "box_class": "class_id",
    "box_centre": "centre",
    "box_extent": "extent",
    "box_yaw": "yaw",
    "box_velocity": "velocity",
    "box_row": "row",
    "box_row_centre": "row_centre",
    "box_row_yaw": "row_yaw",
}
NAMES = (*_CELLS, *_SCAN, *_BOXES)
"""Names of the arrays in a truth file, in their order."""


def truth_arrays(truth: ScanTruth) -> dict[str, NDArray]:
    """Convert a truth to the arrays of its file.

    Args:
        truth: The truth of a scan.

    Returns:
        The arrays by name, in the order of `NAMES`; instance ids as 16 bits where they fit.
    """
    arrays = {name: getattr(truth.cells, name) for name in _CELLS}
    if arrays["instance"].max(initial=0) <= np.iinfo(np.uint16).max:
        arrays["instance"] = arrays["instance"].astype(np.uint16)
    arrays |= {name: np.asarray(getattr(truth, field)) for name, field in _SCAN.items()}
    return arrays | {name: getattr(truth.boxes, field) for name, field in _BOXES.items()}


def truth_bytes(truth: ScanTruth) -> bytes:
    """Encode a truth.

    Args:
        truth: The truth of a scan.

    Returns:
        The bytes of an .npz archive.
    """
    return archive_bytes(truth_arrays(truth), level=_LEVEL)


def write_truth(path: Path, truth: ScanTruth) -> None:
    """Write a truth, whole or not at all.

    Args:
        path: File to write.
        truth: The truth of a scan.

    Raises:
        OSError: The folder cannot be written to.
    """
    write_atomic(path, truth_bytes(truth))


def read_truth(path: Path) -> ScanTruth:
    """Read a truth.

    Args:
        path: A file that `write_truth` wrote.

    Returns:
        The truth of the scan.

    Raises:
        DatasetError: The file is absent, damaged, or lacks an array; the message names it.
    """
    found = read_arrays(Path(path), NAMES)
    found["instance"] = found["instance"].astype(np.uint32)
    shape = found["component"].shape
    cells = {name: found[name] for name in _CELLS}
    for name in cells:
        if found[name].shape != shape or len(shape) != 2:
            raise DatasetError(f"{path}: {name} has shape {found[name].shape}, component has {shape}")
    return ScanTruth(
        cells=CellTruth(**cells),
        pose=found["pose"],
        middle_pose=found["middle_pose"],
        middle_us=int(found["middle_us"]),
        saturated=found["saturated"],
        first_obstacle_m=found["first_m"],
        boxes=MoverBoxes(**{field: found[name] for name, field in _BOXES.items()}),
        attitude=found["attitude"],
    )


def read_arrays(path: Path, names: tuple[str, ...]) -> dict[str, NDArray]:
    """Read some arrays of a truth file; the others are not decompressed.

    Args:
        path: The file.
        names: Names of the arrays, from `NAMES`.

    Returns:
        The arrays by name.

    Raises:
        DatasetError: The file is absent, damaged, or lacks an array; the message names it.
    """
    return read_archive(path, names, kind="truth file")
