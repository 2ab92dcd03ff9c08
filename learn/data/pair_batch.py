"""A pair of scans as training draws it, and a batch of such pairs as tensors."""

from dataclasses import dataclass, field, fields, is_dataclass, replace
from typing import TypeVar, cast

import torch
from torch import Tensor

from echoscape.learn.data.augmentation import PairAugmentation
from echoscape.learn.data.ground_truth import GroundTruth
from echoscape.learn.geometry.procrustes import Motion

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


def _moved_to(value: _Tensors, device: torch.device) -> _Tensors:
    """Return a tensor, or a dataclass of tensors and dataclasses, on a device."""
    if isinstance(value, Tensor):
        return cast("_Tensors", value.to(device))
    if is_dataclass(value) and not isinstance(value, type):
        parts = {each.name: _moved_to(getattr(value, each.name), device) for each in fields(value)}
        return replace(value, **parts)
    return value
