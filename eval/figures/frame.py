"""One scan of a simulated data set, read from its files with all that a figure of it shows."""

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from echoscape.eval.figures.style import IN_PLACE
from echoscape.eval.figures.target_markers import TargetMark, target_marks
from echoscape.sim.datasets.files.metadata import read_manifest, world_of
from echoscape.sim.datasets.files.truth_npz import read_arrays, read_truth
from echoscape.sim.datasets.polar_scan import CellTruth, PolarScan, ScanTruth
from echoscape.sim.datasets.scan_folder import open_folder


@dataclass(frozen=True, kw_only=True)
class Frame:
    """One scan of a simulated data set with its surroundings.

    Attributes:
        folder: The data set.
        manifest: Content of its echoscape.json.
        scan: The scan.
        truth: Its ground truth.
        number: Its place in the data set, from 0.
        path: Poses (scans, 4) of the car at mid-scan, over the whole data set: x, y, z [m], yaw [rad].
        targets: The test targets, in the world.
    """

    folder: Path
    manifest: dict[str, Any]
    scan: PolarScan
    truth: ScanTruth
    number: int
    path: NDArray[np.float64]
    targets: tuple[TargetMark, ...] = ()

    @property
    def world(self) -> str:
        """Name of the simulated world: its preset, or the file of its scene."""
        return world_of(self.manifest)

    @property
    def custom_scene(self) -> bool:
        """Whether the world is a user's mesh, whose faces may be turned either way."""
        return self.manifest["config"].get("scene") is not None

    def shown_components(self) -> tuple[NDArray[np.uint8], list[str]]:
        """Return each cell's component (azimuths, bins), ghosts in place apart, and the names by number."""
        names = self.manifest["components"]
        return shown_components(self.truth.cells, names), [*names, IN_PLACE]

    def direct_classes(self) -> NDArray[np.uint8]:
        """Return the class (azimuths, bins) of each cell with a direct echo, 0 elsewhere."""
        cells = self.truth.cells
        direct = cells.component == self.manifest["components"].index("direct")
        return np.where(direct, cells.class_id, 0).astype(np.uint8)


def shown_components(cells: CellTruth, names: Sequence[str]) -> NDArray[np.uint8]:
    """Return the component of each cell, with ghosts in place apart from displaced ones.

    Args:
        cells: Truth of the cells.
        names: Names of the components by number.

    Returns:
        Numbers of the components (azimuths, bins), `len(names)` for ghosts in place.
    """
    in_place = (cells.component == names.index("ghost")) & ~cells.displaced
    return np.where(in_place, np.uint8(len(names)), cells.component)


def read_frame(folder: Path, scan: int | None = None) -> Frame:
    """Read one scan of a simulated data set.

    Args:
        folder: The data set.
        scan: Number of the scan, from 0; None for the middle one.

    Returns:
        The scan with its surroundings.

    Raises:
        DatasetError: The folder lacks a file or one is damaged; the message names it.
        ValueError: There is no such scan.
    """
    content = read_manifest(folder)
    scans = open_folder(folder)
    number = len(scans) // 2 if scan is None else scan
    if not 0 <= number < len(scans):
        raise ValueError(f"scan must be between 0 and {len(scans) - 1}, got {number}")
    truths = [folder / "truth" / f"{path.stem}.npz" for path in scans.paths]
    poses = [read_arrays(truth, ("middle_pose",))["middle_pose"] for truth in truths]
    return Frame(
        folder=folder,
        manifest=content,
        scan=scans.read(number),
        truth=read_truth(truths[number]),
        number=number,
        path=np.array(poses),
        targets=target_marks(content, start=read_arrays(truths[0], ("pose",))["pose"][0]),
    )
