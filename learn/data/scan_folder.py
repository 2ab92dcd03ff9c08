"""The scans of a folder as a map-style torch Dataset: images, codes, times, poses and labels of every cell.

Source: `torch.utils.data.Dataset`; an item is a dictionary of tensors, which `default_collate` stacks. The
scans themselves are read by `sim.datasets.scan_folder`.
"""

from dataclasses import fields
from pathlib import Path
from typing import Any, SupportsIndex

import numpy as np
import torch
from numpy.typing import NDArray
from torch import Tensor
from torch.utils.data import Dataset

from echoscape.learn.data.cell_cache import cached_range_cells, range_cells_of
from echoscape.learn.data.ground_truth import EgoMotion, ego_motion
from echoscape.learn.data.image import Projector
from echoscape.learn.data.image_settings import ImageSettings
from echoscape.scenes.core.progress import Progress
from echoscape.sim.datasets import scan_folder
from echoscape.sim.datasets.files.atomic_write import DatasetError
from echoscape.sim.datasets.polar_scan import PolarScan

Item = dict[str, Any]
"""Tensors and dictionaries of tensors, by name."""


class ScanFolder(Dataset[Item]):
    """The N scans of a folder.

    An item has the entries

    - `image`: (1, size, size) float32, codes over 128, forward up, the radar at the centre;
    - `index`: () int64, the number of the scan in order of time;
    - `time_us`: () int64, the time that names the scan [us];
    - `codes`: (azimuths, bins) uint8, and `azimuth_us`: (azimuths,) int64, the times of the azimuths [us],
      where `codes` is asked for;
    - `labels`: a dictionary of (azimuths, bins), `CellTruth` by the names of its fields, `instance` int32,
      where the folder has truth;
    - `pose`: (4,) float64, the world pose at mid-scan: x, y, z [m], yaw [rad], NaN where unknown; and
      `twist`: (3,) float32, the velocities of the car: forward, right [m/s], clockwise [rad/s], 0 where
      unknown; both where the folder has poses.

    Items lack the entries for which their folder has no data; none is None, so that items can be stacked.

    Attributes:
        scans: The folder as `open_folder` reads it.
        settings: How scans become images.
        poses: World poses at mid-scan (N, 4), None where the folder has none.
        motion: How the car moved, None where the folder has no poses.
        has_codes: Whether items have codes.
        has_labels: Whether items have labels.
    """

    def __init__(
        self,
        folder: Path | str | scan_folder.ScanFolder,
        *,
        pixel_m: float = ImageSettings.pixel_m,
        size: int = ImageSettings.size,
        near_m: float = ImageSettings.near_m,
        codes: bool = True,
        labels: bool | None = None,
        cache: Path | str | bool = False,
        progress: Progress | None = None,
    ) -> None:
        """Open a folder.

        Args:
            folder: Folder of scans, simulated or real, or one that `open_folder` has opened.
            pixel_m: Width of a pixel of the images [m].
            size: Pixels a side of the images, even.
            near_m: Range below which images are empty [m].
            codes: Whether items have codes.
            labels: Whether items have labels; None gives them where the folder has truth.
            cache: Where to keep the scans averaged over range, from which images are made in milliseconds: a
                folder, or True for `cache` in `folder`. Scans that are not there yet are prepared at once.
                False keeps nothing and reads the scan for each item.
            progress: Called after each scan that is prepared for the cache.

        Raises:
            DatasetError: It is no folder of scans, its poses or cache are damaged, or labels are asked for
                and it has no truth; the message names it.
            ValueError: A setting of the images is out of range.
        """
        self.scans = _opened(folder)
        self.settings = ImageSettings(pixel_m=pixel_m, size=size, near_m=near_m)
        self.has_codes = codes
        self.has_labels = _has_labels(self.scans, labels)
        self.poses = self.scans.poses()
        self.motion: EgoMotion | None = None if self.poses is None else ego_motion(self.scans, self.poses)
        self._times_us = self.scans.timestamps_us
        self._projector = Projector(self.settings, self.scans.sensor.azimuths)
        self._cache: Path | None = None if cache is False else Path(_cache_folder(self.scans, cache))
        self._cells = self._cached_cells(progress)

    def __len__(self) -> int:
        """Return the number of scans."""
        return len(self.scans)

    def __getitem__(self, index: SupportsIndex) -> Item:
        """Return a scan.

        Args:
            index: Its number in order of time; negative ones count from the end.

        Returns:
            Its entries, as the class lists them.

        Raises:
            IndexError: There is no such scan.
            TypeError: The index is no integer.
            DatasetError: A file of the scan is absent or damaged; the message names it.
        """
        number = whole_index(index, len(self))
        scan = self.scans.read(number) if self.has_codes or self._cells is None else None
        item: Item = {
            "image": self.image(number, scan=scan),
            "index": torch.tensor(number),
            "time_us": torch.tensor(int(self._times_us[number])),
        }
        if scan is not None and self.has_codes:
            item |= {"codes": torch.tensor(scan.codes), "azimuth_us": torch.tensor(scan.timestamp_us)}
        if self.has_labels:
            item["labels"] = self._labels(number)
        if self.poses is not None and self.motion is not None:
            item["pose"] = torch.tensor(self.poses[number])
            item["twist"] = torch.tensor(self.motion.velocities[number], dtype=torch.float32)
        return item

    def image(
        self,
        number: int,
        *,
        turn_rad: float = 0.0,
        shift_m: tuple[float, float] = (0.0, 0.0),
        scan: PolarScan | None = None,
    ) -> Tensor:
        """Make the image of a scan, rotated about the radar and then shifted.

        Args:
            number: Number of the scan, 0 or more.
            turn_rad: Clockwise rotation of the content [rad].
            shift_m: Shift of the content after that: forward, right [m].
            scan: The scan where it has been read already.

        Returns:
            The image (1, size, size) float32.

        Raises:
            DatasetError: The scan cannot be read; the message names its file.
        """
        if self._cells is None:
            cells = range_cells_of(scan or self.scans.read(number), self.scans, self.settings)
        else:
            cells = self._cells[number]
        first_rad = self.scans.sensor.first_azimuth_rad
        return self._projector.image(cells, first_rad=first_rad, turn_rad=turn_rad, shift_m=shift_m)

    def _labels(self, number: int) -> dict[str, Tensor]:
        truth = self.scans.truth(number)
        assert truth is not None  # a folder without truth has no labels
        arrays = {field.name: getattr(truth.cells, field.name) for field in fields(truth.cells)}
        arrays["instance"] = arrays["instance"].astype(np.int32)  # PyTorch computes little with uint32
        return {name: torch.tensor(values) for name, values in arrays.items()}

    def _cached_cells(self, progress: Progress | None = None) -> NDArray[np.uint8] | None:
        """Return the range cells (N, azimuths, cells) of the cache, None without one."""
        if self._cache is None:
            return None
        return cached_range_cells(self.scans, self.settings, cache=self._cache, progress=progress)

    def __getstate__(self) -> dict[str, Any]:
        """Leave out the mapped cells, which would be copied whole to the workers of a DataLoader."""
        return {**vars(self), "_cells": None}

    def __setstate__(self, state: dict[str, Any]) -> None:
        """Map the cells again."""
        vars(self).update(state)
        self._cells = self._cached_cells()


def has_truth(scans: scan_folder.ScanFolder) -> bool:
    """Return whether a folder has the truth of its cells.

    Args:
        scans: The folder.

    Returns:
        Whether it was simulated and its truth files are there.
    """
    return scans.simulated and (scans.folder / "truth").is_dir()


def whole_index(index: SupportsIndex, count: int) -> int:
    """Return the number, 0 or more, of an item of a torch Dataset.

    Args:
        index: The index; negative ones count from the end.
        count: Number of items.

    Returns:
        The number.

    Raises:
        IndexError: There is no such item.
        TypeError: The index is a slice, or no integer.
    """
    if isinstance(index, slice):
        raise TypeError(f"index must be an integer, got {index}; torch.utils.data.Subset takes several")
    return scan_folder.number_of(index, count)


def _opened(folder: Path | str | scan_folder.ScanFolder) -> scan_folder.ScanFolder:
    return folder if isinstance(folder, scan_folder.ScanFolder) else scan_folder.open_folder(folder)


def _has_labels(scans: scan_folder.ScanFolder, labels: bool | None) -> bool:
    """Return whether items have labels, by default where the folder has truth, or raise DatasetError."""
    if labels and not has_truth(scans):
        raise DatasetError(f"{scans.folder}: has no truth, which labels are from")
    return has_truth(scans) if labels is None else labels


def _cache_folder(scans: scan_folder.ScanFolder, cache: Path | str | bool) -> Path | str:
    return scans.folder / "cache" if isinstance(cache, bool) else cache
