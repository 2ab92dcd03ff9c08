"""Pairs of scans to learn from: any folders that tell poses, 1 to 8 scans apart, in either order.

Source: Barnes & Posner 2020, section IV train on successive scans; wider gaps and both orders are what maps
and loop closure ask for. What is drawn depends on the generator given alone: a run can go on anywhere.
"""

from collections.abc import Sequence
from dataclasses import dataclass, field
from functools import cached_property
from pathlib import Path

import numpy as np
import torch
from numpy.typing import NDArray
from torch import Tensor

from echoscape.learn.data.augmentation import Turns, TurnSettings, drawn_turns, turned
from echoscape.learn.data.cell_cache import Report, cells_of
from echoscape.learn.data.ground_truth import DriveMotion, Truth, drive_motion, rolls
from echoscape.learn.data.image import ImageSettings, Projector
from echoscape.learn.geometry.procrustes import Motion
from echoscape.learn.geometry.se2 import to_motion
from echoscape.sim.datasets.files.atomic_write import DatasetError
from echoscape.sim.datasets.scan_folder import open_folder
from echoscape.sim.datasets.se2 import relative_from_world

LARGEST_GAP = 8


@dataclass(frozen=True, kw_only=True)
class Pair:
    """Two scans of a drive, by number, and what to turn their pictures by."""

    drive: int
    source: int
    destination: int
    turns: Turns = field(default_factory=Turns)


@dataclass(frozen=True, kw_only=True)
class Batch:
    """B pairs as tensors: pictures (B, 1, H, H) float32 and what is known of them, rolls included."""

    source: Tensor
    destination: Tensor
    truth: Truth

    @property
    def motion(self) -> Motion:
        """The true motions T_destination_source between the pictures."""
        return self.truth.motion


@dataclass(frozen=True)
class Drive:
    """A folder's scans.

    cells (N, azimuths, cells) uint8; poses (N, 4) x, y, z [m], yaw [rad], world axes; motion: of the car.
    """

    cells: NDArray[np.uint8]
    poses: NDArray[np.float64]
    motion: DriveMotion
    projector: Projector

    @cached_property
    def candidates(self) -> list[tuple[int, int]]:
        """Numbers of scans at most 8 apart that both have poses, the earlier first."""
        known = [bool(np.isfinite(pose).all()) for pose in self.poses]
        count = len(self.poses)
        gaps = range(1, LARGEST_GAP + 1)
        return [(i, i + gap) for gap in gaps for i in range(count - gap) if known[i] and known[i + gap]]


class PairSet:
    """Folders of scans as pairs of pictures with their true motions."""

    def __init__(
        self,
        folders: Sequence[Path],
        image: ImageSettings,
        *,
        cache: Path | None = None,
        report: Report | None = None,
    ) -> None:
        """Open the folders and make their cells where there is no cache yet.

        Raises:
            DatasetError: a folder has no scans, no poses, or no two scans with poses; the message names it.
        """
        if not folders:
            raise DatasetError("data must name one folder or more")
        self.names = [Path(folder).resolve().name for folder in folders]
        self.drives = [_drive(Path(folder), image, cache, report) for folder in folders]

    def drawn(
        self, turns: TurnSettings, step: int, *, rng: np.random.Generator, gap_power: float = 0.0
    ) -> Pair:
        """Draw a pair: any drive by its number of scans, gap g by g^-gap_power, either order."""
        lengths = np.array([len(drive.cells) for drive in self.drives], float)
        drive = int(rng.choice(len(self.drives), p=lengths / lengths.sum()))
        candidates = self.drives[drive].candidates
        gaps = sorted({later - earlier for earlier, later in candidates})
        chances = np.array(gaps, float) ** -gap_power
        gap = gaps[int(rng.choice(len(gaps), p=chances / chances.sum()))]
        fitting = [pair for pair in candidates if pair[1] - pair[0] == gap]
        earlier, later = fitting[int(rng.integers(len(fitting)))]
        if rng.random() < 0.5:
            earlier, later = later, earlier
        return Pair(drive=drive, source=later, destination=earlier, turns=drawn_turns(turns, step, rng=rng))

    def batch(self, pairs: Sequence[Pair]) -> Batch:
        """Return the pictures and motions of pairs."""
        sources, destinations, motions = [], [], []
        for pair in pairs:
            drive, turns = self.drives[pair.drive], pair.turns
            project = drive.projector.image
            sources.append(
                project(drive.cells[pair.source], turn_rad=turns.source_rad, shift_m=turns.shift_m)
            )
            destinations.append(project(drive.cells[pair.destination], turn_rad=turns.destination_rad))
            motion = relative_from_world(drive.poses[pair.destination], drive.poses[pair.source])
            motions.append(turned(motion, turns))
        return Batch(
            source=torch.stack(sources),
            destination=torch.stack(destinations),
            truth=Truth(
                motion=to_motion(motions),
                source=rolls(
                    [(self.drives[pair.drive].motion, pair.source) for pair in pairs],
                    to_motion([pair.turns.source_shown_at for pair in pairs]),
                ),
                destination=rolls(
                    [(self.drives[pair.drive].motion, pair.destination) for pair in pairs],
                    to_motion([pair.turns.destination_shown_at for pair in pairs]),
                ),
            ),
        )


def _drive(folder: Path, image: ImageSettings, cache: Path | None, report: Report | None) -> Drive:
    scans = open_folder(folder)
    poses = scans.poses()
    if poses is None:
        raise DatasetError(f"{folder}: tells no poses, so there is nothing to learn from")
    projector = Projector(image, scans.sensor.azimuths)
    cells = cells_of(scans, image, cache=cache, report=report)
    drive = Drive(cells, poses, drive_motion(scans, poses), projector)
    if not drive.candidates:
        raise DatasetError(f"{folder}: has no two scans with poses within {LARGEST_GAP} of each other")
    return drive
