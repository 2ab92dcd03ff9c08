"""Training pairs from folders of scans with poses: two scans of a drive 1 to 8 apart, in either order.

Source: Barnes & Posner 2020, section IV, train on successive scans; mapping and loop closure need wider gaps
and both orders. A draw depends on the given generator alone, so that a run can be resumed anywhere.
"""

from collections.abc import Sequence
from dataclasses import dataclass, field, fields, is_dataclass, replace
from functools import cached_property
from pathlib import Path
from typing import TypeVar, cast

import numpy as np
import torch
from numpy.typing import NDArray
from torch import Tensor

from echoscape.learn.data.augmentation import (
    AugmentationConfig,
    PairAugmentation,
    augmented_motion,
    draw_augmentation,
)
from echoscape.learn.data.cell_cache import Progress, cached_range_cells
from echoscape.learn.data.ground_truth import EgoMotion, GroundTruth, ego_motion, scan_distortions
from echoscape.learn.data.image import Projector
from echoscape.learn.data.image_settings import ImageSettings
from echoscape.learn.geometry.procrustes import Motion
from echoscape.learn.geometry.se2 import to_motion
from echoscape.sim.datasets.files.atomic_write import DatasetError
from echoscape.sim.datasets.scan_folder import open_folder
from echoscape.sim.datasets.se2 import relative_from_world

MAX_GAP = 8
"""Most scans from one scan of a pair to the other."""

_Tensors = TypeVar("_Tensors")


@dataclass(frozen=True, kw_only=True)
class Pair:
    """Two scans of a drive.

    Attributes:
        drive: Number of the drive.
        source: Number of the scan whose keypoints are searched for.
        destination: Number of the scan in which they are.
        augmentation: How their images are rotated and shifted.
    """

    drive: int
    source: int
    destination: int
    augmentation: PairAugmentation = field(default_factory=PairAugmentation)


@dataclass(frozen=True, kw_only=True)
class Batch:
    """B pairs as tensors.

    Attributes:
        source: Images of the sources (B, 1, H, H) float32.
        destination: Images of the destinations (B, 1, H, H) float32.
        truth: True motions and distortions.
    """

    source: Tensor
    destination: Tensor
    truth: GroundTruth

    @property
    def motion(self) -> Motion:
        """The true motions T_destination_source between the images."""
        return self.truth.motion

    def to(self, device: torch.device) -> "Batch":
        """Copy the batch to a device.

        Args:
            device: Where its tensors shall be.

        Returns:
            The batch there; itself where it is there already.
        """
        return _moved_to(self, device)


@dataclass(frozen=True)
class Drive:
    """The N scans of a folder.

    Attributes:
        cells: Codes averaged over range cells (N, azimuths, cells) uint8.
        poses: World poses (N, 4): x, y, z [m], yaw [rad]; NaN where one is unknown.
        motion: How the car moved.
        projector: Makes images of the cells.
        first_rad: Direction of the first azimuth of the scans, clockwise from ahead [rad].
    """

    cells: NDArray[np.uint8]
    poses: NDArray[np.float64]
    motion: EgoMotion
    projector: Projector
    first_rad: float

    @cached_property
    def candidates(self) -> list[tuple[int, int]]:
        """Pairs of scans at most `MAX_GAP` apart that both have poses, as numbers, the earlier first."""
        known = [bool(np.isfinite(pose).all()) for pose in self.poses]
        count = len(self.poses)
        gaps = range(1, MAX_GAP + 1)
        return [(i, i + gap) for gap in gaps for i in range(count - gap) if known[i] and known[i + gap]]


class PairDataset:
    """Pairs of images with their true motions, from folders of scans."""

    def __init__(
        self,
        folders: Sequence[Path],
        image: ImageSettings,
        *,
        cache: Path | None = None,
        progress: Progress | None = None,
    ) -> None:
        """Open the folders and prepare the range cells that are not cached yet.

        Args:
            folders: Folders of scans with poses.
            image: How scans become images.
            cache: Folder of the cache; by default `cache` in each folder.
            progress: Called after each scan that is prepared.

        Raises:
            DatasetError: A folder has no scans, no poses, or no two scans with poses that are near enough;
                the message names it.
        """
        if not folders:
            raise DatasetError("data must name one folder or more")
        self.names = [Path(folder).resolve().name for folder in folders]
        self.drives = [_drive(Path(folder), image, cache, progress) for folder in folders]

    def draw(
        self,
        augmentation: AugmentationConfig,
        step: int,
        *,
        rng: np.random.Generator,
        gap_power: float = 0.0,
    ) -> Pair:
        """Draw a pair: a drive by its number of scans, a gap g in proportion to g^-gap_power, either order.

        Args:
            augmentation: Ranges of rotations and shifts.
            step: Number of the training step, see `draw_augmentation`.
            rng: Source of the draws.
            gap_power: Exponent; 0 draws all gaps alike.

        Returns:
            The pair.
        """
        lengths = np.array([len(drive.cells) for drive in self.drives], float)
        drive = int(rng.choice(len(self.drives), p=lengths / lengths.sum()))
        candidates = self.drives[drive].candidates
        gaps = sorted({later - earlier for earlier, later in candidates})
        weights = np.array(gaps, float) ** -gap_power
        gap = gaps[int(rng.choice(len(gaps), p=weights / weights.sum()))]
        fitting = [pair for pair in candidates if pair[1] - pair[0] == gap]
        earlier, later = fitting[int(rng.integers(len(fitting)))]
        if rng.random() < 0.5:
            earlier, later = later, earlier
        drawn = draw_augmentation(augmentation, step, rng=rng)
        return Pair(drive=drive, source=later, destination=earlier, augmentation=drawn)

    def batch(self, pairs: Sequence[Pair]) -> Batch:
        """Make the images and true motions of pairs.

        Args:
            pairs: B pairs.

        Returns:
            The batch, on the CPU.
        """
        sources, destinations, motions = [], [], []
        for pair in pairs:
            drive, augmentation = self.drives[pair.drive], pair.augmentation
            project = drive.projector.image
            sources.append(
                project(
                    drive.cells[pair.source],
                    first_rad=drive.first_rad,
                    turn_rad=augmentation.source_rotation_rad,
                    shift_m=augmentation.source_shift_m,
                )
            )
            destinations.append(
                project(
                    drive.cells[pair.destination],
                    first_rad=drive.first_rad,
                    turn_rad=augmentation.destination_rotation_rad,
                )
            )
            motion = relative_from_world(drive.poses[pair.destination], drive.poses[pair.source])
            motions.append(augmented_motion(motion, augmentation))
        return Batch(
            source=torch.stack(sources),
            destination=torch.stack(destinations),
            truth=GroundTruth(
                motion=to_motion(motions),
                source=scan_distortions(
                    [(self.drives[pair.drive].motion, pair.source) for pair in pairs],
                    to_motion([pair.augmentation.source_in_image for pair in pairs]),
                ),
                destination=scan_distortions(
                    [(self.drives[pair.drive].motion, pair.destination) for pair in pairs],
                    to_motion([pair.augmentation.destination_in_image for pair in pairs]),
                ),
            ),
        )


def _drive(folder: Path, image: ImageSettings, cache: Path | None, progress: Progress | None) -> Drive:
    scans = open_folder(folder)
    poses = scans.poses()
    if poses is None:
        raise DatasetError(f"{folder}: has no poses, which training needs")
    projector = Projector(image, scans.sensor.azimuths)
    cells = cached_range_cells(scans, image, cache=cache, progress=progress)
    drive = Drive(cells, poses, ego_motion(scans, poses), projector, scans.sensor.first_azimuth_rad)
    if not drive.candidates:
        raise DatasetError(f"{folder}: has no two scans with poses within {MAX_GAP} of each other")
    return drive


def _moved_to(value: _Tensors, device: torch.device) -> _Tensors:
    """Return a tensor, or a dataclass of tensors and dataclasses, on a device."""
    if isinstance(value, Tensor):
        return cast("_Tensors", value.to(device))
    if is_dataclass(value) and not isinstance(value, type):
        parts = {each.name: _moved_to(getattr(value, each.name), device) for each in fields(value)}
        return replace(value, **parts)
    return value
