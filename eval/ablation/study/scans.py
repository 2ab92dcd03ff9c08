"""The scans of a drive under every condition, each scan traced once for all conditions that allow it.

Every condition has a folder with the files that `echoscape simulate` would write: its images, the motion of
the car, echoscape.json, and with `keep_scans` the truth. Odometry reads these, as it reads any other folder.
"""

from dataclasses import asdict, dataclass, replace
from functools import cached_property
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from echoscape.eval.ablation.study.conditions import Condition
from echoscape.eval.ablation.study.settings import AblationDrive
from echoscape.sim.datasets.files.atomic_write import write_atomic
from echoscape.sim.datasets.files.metadata import FILE_NAME, manifest_text
from echoscape.sim.datasets.files.navtech_png import is_complete_png
from echoscape.sim.datasets.files.npz import ends_as_archive
from echoscape.sim.datasets.files.truth_npz import write_truth
from echoscape.sim.datasets.layouts.layout import ScanRecord
from echoscape.sim.datasets.polar_scan import PolarScan
from echoscape.sim.effects.sensor_faults import arriving, recorded_us, with_faults
from echoscape.sim.generation.manifest import manifest
from echoscape.sim.generation.setup import SceneSetup
from echoscape.sim.kinematics.timeline import Timeline

if TYPE_CHECKING:
    from echoscape.sim.simulator import Simulator


@dataclass(frozen=True, kw_only=True)
class DriveFolders:
    """Where the scans of a drive lie, and under which conditions.

    Attributes:
        folder: Folder of the drive, with a folder for each condition.
        drive: The drive.
        conditions: The conditions.
        keep_truth: Whether the truth of every scan is written.
    """

    folder: Path
    drive: AblationDrive
    conditions: tuple[Condition, ...]
    keep_truth: bool = False

    def of(self, condition: Condition) -> Path:
        """Return the folder of a condition.

        Args:
            condition: One of the conditions.

        Returns:
            The folder.
        """
        return self.folder / condition.name

    @property
    def complete(self) -> bool:
        """Whether all scans are there and whole, and echoscape.json, which is written last."""
        return all(map(self._is_complete, self.conditions))

    def arriving(self, condition: Condition) -> NDArray[np.bool_]:
        """Return which scans of the drive arrive under a condition.

        Args:
            condition: One of the conditions.

        Returns:
            Whether each scan arrives (scans,).
        """
        return arriving(condition.faults, self.drive.config.scans, seed=self.drive.config.seed)

    def _is_complete(self, condition: Condition) -> bool:
        folder = self.of(condition)
        if not (folder / FILE_NAME).is_file():
            return False
        images = self.drive.config.folder_layout.scan_path(folder, "0").parent.glob("*.png")
        whole = sum(self.is_whole(each, folder / "truth" / f"{each.stem}.npz") for each in images)
        return whole >= self.arriving(condition).sum()

    def is_whole(self, image: Path, truth: Path) -> bool:
        """Check a scan.

        Args:
            image: Its image, which may not exist.
            truth: Its truth, which counts only where it is kept.

        Returns:
            Whether it need not be simulated again.
        """
        return is_complete_png(image) and (not self.keep_truth or ends_as_archive(truth))


class DriveWriter:
    """Simulates the scans of a drive and writes them as they are recorded under every condition."""

    def __init__(self, folders: DriveFolders, setup: SceneSetup, *, threads: int | None = None) -> None:
        """Take the drive; the ray tracer is loaded with the first scan that is simulated.

        Args:
            folders: The folders to write.
            setup: Scene, drive and traffic.
            threads: Threads of Dr.Jit in this process; None leaves their number as it is.
        """
        self._folders, self._setup, self._threads = folders, setup, threads
        self._config = folders.drive.config
        self._arriving = {each.name: folders.arriving(each) for each in folders.conditions}

    @cached_property
    def _simulator(self) -> "Simulator":
        from echoscape.sim.generation.single_scan import simulator_of
        from echoscape.sim.raytracing.mitsuba_backend import set_threads

        if self._threads is not None:
            set_threads(self._threads)
        return simulator_of(self._setup, self._config)

    def missing(self) -> list[int]:
        """Find the scans that a condition lacks.

        Returns:
            Their numbers.
        """
        return [index for index in range(self._config.scans) if self._lacking(index)]

    def write(self, index: int) -> None:
        """Simulate a scan under the conditions that lack it, and write it; its images come last.

        Args:
            index: Number of the scan.
        """
        lacking = self._lacking(index)
        settings = [each.artefacts for each in lacking]
        if not lacking:
            return
        scans = self._simulator.scans(index, settings, truth=self._folders.keep_truth)
        for condition, scan in zip(lacking, scans, strict=True):
            self._write(condition, index, scan)

    def finish(self) -> None:
        """Write what makes data sets of the images: the motion of the car, then echoscape.json."""
        config, layout = self._config, self._config.folder_layout
        for condition in self._folders.conditions:
            folder = self._folders.of(condition)
            for name in layout.other_folders:
                (folder / name).mkdir(exist_ok=True)
            indices = np.flatnonzero(self._arriving[condition.name]).tolist()
            layout.write_motion(folder, [self._record(condition, each) for each in indices], config.sensor)
            content = manifest(replace(config, artefacts=condition.artefacts))
            if condition.faults.any:
                content["faults"] = asdict(condition.faults)
            write_atomic(folder / FILE_NAME, manifest_text(content).encode())

    def _lacking(self, index: int) -> list[Condition]:
        """Return the conditions under which a scan arrives and is not there."""
        arrives = [each for each in self._folders.conditions if self._arriving[each.name][index]]
        return [each for each in arrives if not self._is_there(each, index)]

    def _is_there(self, condition: Condition, index: int) -> bool:
        return self._folders.is_whole(*self._paths(condition, self._stamps_us(condition, index)))

    def _write(self, condition: Condition, index: int, scan: PolarScan) -> None:
        """Write a scan as it is recorded under a condition."""
        config = self._config
        recorded = with_faults(
            scan, condition.faults, index=index, count=config.scans, seed=config.seed, sensor=config.sensor
        )
        image, truth = self._paths(condition, recorded.timestamp_us)
        image.parent.mkdir(parents=True, exist_ok=True)
        if recorded.truth is not None:
            truth.parent.mkdir(exist_ok=True)
            write_truth(truth, recorded.truth)
        config.folder_layout.write_scan(image, recorded)

    def _paths(self, condition: Condition, stamps_us: NDArray[np.int64]) -> tuple[Path, Path]:
        """Return the paths of a scan's image and truth."""
        layout, folder = self._config.folder_layout, self._folders.of(condition)
        stem = layout.stem(stamps_us)
        return layout.scan_path(folder, stem), folder / "truth" / f"{stem}.npz"

    @cached_property
    def _timeline(self) -> Timeline:
        setup, config = self._setup, self._config
        return Timeline(setup.drive, setup.movers, sensor=config.sensor, seed=config.seed)

    def _stamps_us(self, condition: Condition, index: int) -> NDArray[np.int64]:
        """Return the recorded times of the azimuths of a scan (azimuths,) [us]."""
        times_s = self._timeline.revolution(index).times_s
        true_us = self._config.sensor.epoch_us + np.rint(times_s * 1e6).astype(np.int64)
        return recorded_us(true_us, condition.faults, index=index, seed=self._config.seed)

    def _record(self, condition: Condition, index: int) -> ScanRecord:
        """Return the entry of a scan in the files that list scans: its recorded name, its true motion."""
        revolution, track = self._timeline.revolution(index), self._setup.drive.trajectory
        return ScanRecord(
            stem=self._config.folder_layout.stem(self._stamps_us(condition, index)),
            middle_us=self._config.sensor.epoch_us + round(revolution.middle_s * 1e6),
            middle_pose=track.pose(np.float64(revolution.middle_s)),
            pose=track.pose(revolution.times_s),
        )
