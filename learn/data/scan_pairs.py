"""Pairs of scans of a drive with their true motions: a map-style torch Dataset, from which training draws.

Source: Barnes & Posner 2020, section IV, train on successive scans; mapping and loop closure need wider gaps
and both orders. A draw depends on the given generator alone, so that a run can be resumed anywhere.
"""

from collections.abc import Collection, Sequence
from dataclasses import asdict
from pathlib import Path
from typing import SupportsIndex

import numpy as np
import torch
from torch.utils.data import Dataset

from echoscape.learn.data.augmentation import (
    AugmentationConfig,
    augmented_motion,
    draw_augmentation,
)
from echoscape.learn.data.ground_truth import EgoMotion, GroundTruth, scan_distortions
from echoscape.learn.data.image_settings import ImageSettings
from echoscape.learn.data.pair_batch import Batch, Pair
from echoscape.learn.data.scan_folder import Item, ScanFolder, has_truth, whole_index
from echoscape.learn.geometry.se2 import to_motion
from echoscape.scenes.core.checks import check_whole
from echoscape.scenes.core.progress import Progress
from echoscape.sim.datasets.files.atomic_write import DatasetError
from echoscape.sim.datasets.scan_folder import open_folder
from echoscape.sim.datasets.se2 import SE2, relative_from_world

TRAINING_STRIDES = range(1, 9)
"""Scans from one scan of a pair to the other, in `echoscape train`."""


class ScanPairs(Dataset[Item]):
    """Pairs of scans of one or several folders, `stride` apart.

    The item of a pair has the entries

    - `source` and `destination`: the later and the earlier scan, with the entries that `ScanFolder` lists;
    - `motion`: (3,) float32, the pose of the source in the frame of the destination at mid-scan: x forward,
      y right [m], heading clockwise [rad], as in gt/radar_odometry.csv;
    - `drive`: () int64, the number of the folder.

    Pairs are in the order of the folders, of the strides and of time. Scans without a pose are in no pair.

    Attributes:
        drives: The scans of each folder.
        names: Names of the folders.
        candidates: The pairs of each drive as numbers of scans, the earlier first, by stride.
        pairs: The pairs, as `len` and indexes count them.
    """

    def __init__(
        self,
        folders: Path | str | Sequence[Path | str],
        *,
        pixel_m: float = ImageSettings.pixel_m,
        size: int = ImageSettings.size,
        near_m: float = ImageSettings.near_m,
        stride: int | Collection[int] = 1,
        codes: bool = True,
        labels: bool | None = None,
        cache: Path | str | bool = False,
        progress: Progress | None = None,
    ) -> None:
        """Open folders.

        Args:
            folders: A folder of scans with poses, or several.
            pixel_m: Width of a pixel of the images [m].
            size: Pixels a side of the images, even.
            near_m: Range below which images are empty [m].
            stride: Scans from the earlier scan of a pair to the later one, or several such numbers.
            codes: Whether items have codes.
            labels: Whether items have labels; None gives them where all folders have truth.
            cache: Where to keep the scans averaged over range, see `ScanFolder`.
            progress: Called after each scan that is prepared for the cache.

        Raises:
            DatasetError: A folder has no scans, no poses, no two scans with poses so far apart, or no truth
                although labels are asked for; or codes or labels are asked for and the radars of the folders
                differ. The message names the folder.
            ValueError: The stride is below 1 or not whole, or a setting of the images is out of range.
        """
        paths = [folders] if isinstance(folders, Path | str) else list(folders)
        if not paths:
            raise DatasetError("data must name one folder or more")
        strides = _strides(stride)
        opened = [open_folder(path) for path in paths]
        labels = all(map(has_truth, opened)) if labels is None else labels
        settings = ImageSettings(pixel_m=pixel_m, size=size, near_m=near_m)
        kept = {"codes": codes, "labels": labels, "cache": cache, "progress": progress}
        self.drives = [ScanFolder(scans, **asdict(settings), **kept) for scans in opened]
        _check_alike(self.drives)
        self.names = [drive.scans.folder.resolve().name for drive in self.drives]
        self.candidates = [_candidates(drive, strides) for drive in self.drives]
        self.pairs = _pairs_of(self.candidates)

    @property
    def settings(self) -> ImageSettings:
        """How scans become images."""
        return self.drives[0].settings

    def __len__(self) -> int:
        """Return the number of pairs."""
        return len(self.pairs)

    def __getitem__(self, index: SupportsIndex) -> Item:
        """Return a pair.

        Args:
            index: Its number; negative ones count from the end.

        Returns:
            Its entries, as the class lists them.

        Raises:
            IndexError: There is no such pair.
            TypeError: The index is no integer.
            DatasetError: A file of a scan is absent or damaged; the message names it.
        """
        pair = self.pairs[whole_index(index, len(self))]
        drive, motion = self.drives[pair.drive], self.motion(pair)
        return {
            "source": drive[pair.source],
            "destination": drive[pair.destination],
            "motion": torch.tensor([motion.x_m, motion.y_m, motion.yaw_rad], dtype=torch.float32),
            "drive": torch.tensor(pair.drive),
        }

    def motion(self, pair: Pair) -> SE2:
        """Compute the true motion of a pair.

        Args:
            pair: The pair.

        Returns:
            T_destination_source between the images as they are shown, at mid-scan.
        """
        poses = self.drives[pair.drive].poses
        assert poses is not None  # or the folder would have been refused
        return augmented_motion(
            relative_from_world(poses[pair.destination], poses[pair.source]), pair.augmentation
        )

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
        lengths = np.array([len(drive) for drive in self.drives], float)
        drive = int(rng.choice(len(self.drives), p=lengths / lengths.sum()))
        candidates = self.candidates[drive]
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
        drives = [self.drives[pair.drive] for pair in pairs]
        sources = [
            drive.image(
                pair.source,
                turn_rad=pair.augmentation.source_rotation_rad,
                shift_m=pair.augmentation.source_shift_m,
            )
            for drive, pair in zip(drives, pairs, strict=True)
        ]
        destinations = [
            drive.image(pair.destination, turn_rad=pair.augmentation.destination_rotation_rad)
            for drive, pair in zip(drives, pairs, strict=True)
        ]
        return Batch(
            source=torch.stack(sources),
            destination=torch.stack(destinations),
            truth=GroundTruth(
                motion=to_motion([self.motion(pair) for pair in pairs]),
                source=scan_distortions(
                    [(self._ego_motion(pair), pair.source) for pair in pairs],
                    to_motion([pair.augmentation.source_in_image for pair in pairs]),
                ),
                destination=scan_distortions(
                    [(self._ego_motion(pair), pair.destination) for pair in pairs],
                    to_motion([pair.augmentation.destination_in_image for pair in pairs]),
                ),
            ),
        )

    def _ego_motion(self, pair: Pair) -> EgoMotion:
        motion = self.drives[pair.drive].motion
        assert motion is not None  # or the folder would have been refused
        return motion


def _strides(stride: int | Collection[int]) -> list[int]:
    """Return the strides in ascending order."""
    strides = list(stride) if isinstance(stride, Collection) and not isinstance(stride, str) else [stride]
    if not strides:
        raise ValueError(f"stride must be 1 or more, got {stride}")
    for each in strides:
        check_whole(stride=each, least=1)
    return sorted({int(each) for each in strides})


def _candidates(drive: ScanFolder, strides: Sequence[int]) -> list[tuple[int, int]]:
    """Return pairs of scans that both have poses, by stride, the earlier first.

    Raises:
        DatasetError: There are none.
    """
    folder, count = drive.scans.folder, len(drive)
    if drive.poses is None:
        raise DatasetError(f"{folder}: has no poses, which pairs need")
    known = [bool(np.isfinite(pose).all()) for pose in drive.poses]
    found = [(i, i + gap) for gap in strides for i in range(count - gap) if known[i] and known[i + gap]]
    if not found:
        apart = strides[0] if len(strides) == 1 else f"{strides[0]} to {strides[-1]}"
        raise DatasetError(f"{folder}: no two of its scans ({count}) have poses and are {apart} apart")
    return found


def _pairs_of(candidates: Sequence[Sequence[tuple[int, int]]]) -> list[Pair]:
    """Return the candidates of all drives as pairs, the later scan as the source."""
    return [
        Pair(drive=drive, source=later, destination=earlier)
        for drive, found in enumerate(candidates)
        for earlier, later in found
    ]


def _check_alike(drives: Sequence[ScanFolder]) -> None:
    """Refuse folders whose codes or labels cannot be stacked.

    Raises:
        DatasetError: Their radars differ.
    """
    shapes = [(drive.scans.sensor.azimuths, drive.scans.sensor.bins) for drive in drives]
    for drive, shape in zip(drives, shapes, strict=True):
        if (drive.has_codes or drive.has_labels) and shape != shapes[0]:
            raise DatasetError(
                f"{drive.scans.folder}: its scans have {shape[0]} x {shape[1]} cells, those of "
                f"{drives[0].scans.folder} {shapes[0][0]} x {shapes[0][1]}; leave out codes and labels"
            )
