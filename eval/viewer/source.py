"""A folder of scans as the viewer reads it: real or simulated, with truth or without.

The one place that knows which reader opens it; poses are those of the truth, else what the folder tells.
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
    """A folder of scans with what its numbers mean.

    manifest: echoscape.json or None; stamps_us: names of the scans [us]; poses (N, 4): of the car at
    mid-scan, NaN where unknown; absolute: whether their world has its north upwards.
    """

    scans: ScanFolder
    manifest: dict[str, Any] | None
    stamps_us: list[int]
    poses: NDArray[np.float64]
    absolute: bool
    has_truth: bool

    @property
    def title(self) -> str:
        """What was simulated, else the folder's name."""
        if self.manifest is None:
            return self.scans.folder.resolve().name
        recipe = self.manifest["recipe"]
        return f"{world_of(self.manifest)}, seed {recipe['seed']}"

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

    def truth(self, index: int) -> ScanTruth | None:
        """Return the truth of a scan, None where the folder has none; for errors see `read_truth`."""
        return self.scans.truth(index) if self.has_truth else None

    def pose(self, index: int) -> Pose | None:
        """Return where the car was, to a centimetre, None where that is unknown."""
        x, y, _, yaw = self.poses[index].tolist()
        return None if math.isnan(x + y + yaw) else (round(x, 2), round(y, 2), round(yaw, 4))

    def motion(self, index: int) -> Motion | None:
        """Return the motion from the scan before, None for the first and where poses are unknown."""
        if index == 0 or np.isnan(self.poses[index - 1 : index + 1]).any():
            return None
        motion = relative_from_world(self.poses[index - 1], self.poses[index])
        return round(motion.x_m, 4), round(motion.y_m, 4), round(motion.yaw_rad, 6)


def open_source(folder: Path) -> Source:
    """Return what stands in `folder`, its scans unread.

    Raises:
        DatasetError: it is no folder of scans, has none, or a file of it is damaged; the message names it.
    """
    scans = open_folder(folder)
    has_truth = scans.simulated and (folder / "truth").is_dir()
    return Source(
        scans=scans,
        manifest=read_manifest(folder) if scans.simulated else None,
        stamps_us=scans.timestamps_us.tolist(),
        poses=_true_poses(scans) if has_truth else _told_poses(scans),
        absolute=has_truth or scans.layout.name != "oxford",
        has_truth=has_truth,
    )


def _true_poses(scans: ScanFolder) -> NDArray[np.float64]:
    paths = [scans.folder / "truth" / f"{path.stem}.npz" for path in scans.paths]
    return np.array([read_arrays(path, ("middle_pose",))["middle_pose"] for path in paths])


def _told_poses(scans: ScanFolder) -> NDArray[np.float64]:
    """Return the folder's poses; a world that is only the first scan's is turned so that it looks along y."""
    poses = scans.poses()
    if poses is None:
        return np.full((len(scans), 4), np.nan)
    if scans.layout.name != "oxford":
        return poses
    turned = poses[:, [1, 0, 2, 3]] * (-1, 1, 1, 1)
    turned[:, 3] += math.pi / 2
    return turned
