"""A folder of scans as the viewer reads it: real or simulated, with ground truth or without.

Poses are those of the ground truth, else those that the folder reports.
"""

import math
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from echoscape.scenes.core.scene import CLASSES
from echoscape.sim.datasets.files.metadata import read_manifest, world_of
from echoscape.sim.datasets.files.truth_npz import read_arrays
from echoscape.sim.datasets.polar_scan import Component, ScanTruth
from echoscape.sim.datasets.scan_folder import ScanFolder, open_folder
from echoscape.sim.datasets.se2 import relative_from_world

Pose = tuple[float, float, float]
"""x, y [m] and yaw [rad], counter-clockwise, in the world."""
Motion = tuple[float, float, float]
"""x forward, y right [m], yaw clockwise [rad]."""


@dataclass(frozen=True, kw_only=True)
class Source:
    """A folder of scans with its metadata and poses.

    Attributes:
        scans: The folder.
        manifest: Content of echoscape.json, None for real scans.
        stamps_us: Times (N,) that name the scans' files [us].
        poses: Poses (N, 4) of the car at mid-scan in the world: x, y, z [m], yaw [rad]; NaN where unknown.
        north_up: Whether the y axis of that world is north.
        has_truth: Whether the folder has ground truth.
    """

    scans: ScanFolder
    manifest: dict[str, Any] | None
    stamps_us: list[int]
    poses: NDArray[np.float64]
    north_up: bool
    has_truth: bool

    @property
    def title(self) -> str:
        """What was simulated, else the folder's name."""
        if self.manifest is None:
            return self.scans.folder.resolve().name
        config = self.manifest["config"]
        return f"{world_of(self.manifest)}, seed {config['seed']}"

    @property
    def classes(self) -> list[str]:
        """Names of the classes by number."""
        return list(self.manifest["classes"] if self.manifest else CLASSES)

    @property
    def components(self) -> list[str]:
        """Names of the components by number."""
        return (
            list(self.manifest["components"]) if self.manifest else [each.name.lower() for each in Component]
        )

    @property
    def motion_distortion(self) -> float:
        """Share of a revolution's time over which azimuths were simulated, 1 for real scans."""
        artefacts = self.manifest["config"].get("artefacts", {}) if self.manifest else {}
        return float(artefacts.get("motion_distortion", 1.0))

    def truth(self, index: int) -> ScanTruth | None:
        """Read the ground truth of a scan.

        Args:
            index: Number of the scan, from 0.

        Returns:
            The truth, None where the folder has none.

        Raises:
            DatasetError: A file is absent or damaged; the message names it.
        """
        return self.scans.truth(index) if self.has_truth else None

    def pose(self, index: int) -> Pose | None:
        """Return the pose of the car at mid-scan, rounded to a centimetre.

        Args:
            index: Number of the scan, from 0.

        Returns:
            The pose, None where it is unknown.
        """
        x, y, _, yaw = self.poses[index].tolist()
        return None if math.isnan(x + y + yaw) else (round(x, 2), round(y, 2), round(yaw, 4))

    def motion(self, index: int) -> Motion | None:
        """Return the motion of the car since the scan before.

        Args:
            index: Number of the scan, from 0.

        Returns:
            The motion, None for the first scan and where a pose is unknown.
        """
        if index == 0 or np.isnan(self.poses[index - 1 : index + 1]).any():
            return None
        motion = relative_from_world(self.poses[index - 1], self.poses[index])
        return round(motion.x_m, 4), round(motion.y_m, 4), round(motion.yaw_rad, 6)


def open_source(folder: Path) -> Source:
    """Open a folder of scans without reading them.

    Args:
        folder: The folder, simulated or real.

    Returns:
        The folder with its metadata and poses.

    Raises:
        DatasetError: The folder has no scans, or a file of it is damaged; the message names it.
    """
    scans = open_folder(folder)
    has_truth = scans.simulated and (folder / "truth").is_dir()
    return Source(
        scans=scans,
        manifest=read_manifest(folder) if scans.simulated else None,
        stamps_us=scans.timestamps_us.tolist(),
        poses=_true_poses(scans) if has_truth else _reported_poses(scans),
        north_up=has_truth or scans.layout.name != "oxford",
        has_truth=has_truth,
    )


def _true_poses(scans: ScanFolder) -> NDArray[np.float64]:
    paths = [scans.folder / "truth" / f"{path.stem}.npz" for path in scans.paths]
    return np.array([read_arrays(path, ("middle_pose",))["middle_pose"] for path in paths])


def _reported_poses(scans: ScanFolder) -> NDArray[np.float64]:
    """Return the folder's own poses (N, 4); those relative to the first scan are rotated to start along y."""
    poses = scans.poses()
    if poses is None:
        return np.full((len(scans), 4), np.nan)
    if scans.layout.name != "oxford":
        return poses
    rotated = poses[:, [1, 0, 2, 3]] * (-1, 1, 1, 1)
    rotated[:, 3] += math.pi / 2
    return rotated
