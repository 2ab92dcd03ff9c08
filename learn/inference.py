"""A trained model at work: keypoints once a scan, then the motion between any two scans, and a scan's place.

Source: Barnes & Posner 2020, sections III-C and III-D. Batch normalisation is folded into the convolutions.
"""

import copy
import math
from dataclasses import dataclass

import numpy as np
import torch
from numpy.typing import NDArray
from torch import Tensor, nn
from torch.nn.utils.fusion import fuse_conv_bn_eval

from echoscape.learn.augment import PlaneMotion
from echoscape.learn.image import Projector, range_cells
from echoscape.learn.keypoints import Keypoints
from echoscape.learn.model import Features, KeypointModel, Matches, Matching
from echoscape.learn.pose import Motion, rotation_of_yaw


@dataclass(frozen=True, kw_only=True)
class ScanFeatures:
    """What is kept of a scan: `plain` as it is seen, and its keypoints seen at each further heading."""

    plain: Features
    turned: tuple[Keypoints, ...]


@dataclass(frozen=True, kw_only=True)
class PairEstimate:
    """The motion T_destination_source of a pair and the matches behind it.

    source_m, destination_m: (N, 2) float32 forward, right [m]; weights: (N,) float32; certain: whether the
    matches determine the rotation.
    """

    motion: PlaneMotion
    source_m: NDArray[np.float32]
    destination_m: NDArray[np.float32]
    weights: NDArray[np.float32]
    certain: bool


class Estimator:
    """A model that takes scans."""

    def __init__(self, model: KeypointModel, matching: Matching | None = None) -> None:
        """Take a copy of the model, made faster for inference; matching: at every pixel unless given."""
        self.model = folded(model)
        self.matching = matching or Matching()
        self._projectors: dict[int, Projector] = {}

    @torch.inference_mode()
    def features(
        self, codes: NDArray[np.uint8], bin_m: float, *, range_offset_m: float = 0.0
    ) -> ScanFeatures:
        """Return what is kept of a scan with codes (azimuths, bins).

        Raises:
            ValueError: `codes` is no scan, or `bin_m` no length.
        """
        image = self.model.settings.image
        cells = range_cells(codes, bin_m, image, range_offset_m=range_offset_m)
        projector = self._projectors.setdefault(len(cells), Projector(image, len(cells)))
        plain = self.model.features(projector.image(cells)[None])
        turned = [
            self.model.features(projector.image(cells, turn_rad=turn)[None]).keypoints
            for turn in self._turns_rad()
        ]
        return ScanFeatures(plain=plain, turned=tuple(turned))

    @torch.inference_mode()
    def estimate(self, source: ScanFeatures, destination: ScanFeatures) -> PairEstimate:
        """Return the motion T_destination_source; of several headings the one whose weights sum to most."""
        found = [self._matches(source.plain.keypoints, destination, 0.0)]
        for keypoints, turn in zip(source.turned, self._turns_rad(), strict=True):
            found.append(self._matches(keypoints, destination, turn))
        best = max(found, key=lambda each: float(each.weights.sum()))
        motion = best.motion()
        return PairEstimate(
            motion=_plane(motion),
            source_m=best.source_m[0].numpy(),
            destination_m=best.destination_m[0].numpy(),
            weights=best.weights[0].numpy(),
            certain=bool(motion.certain),
        )

    @torch.inference_mode()
    def embedding(self, scan: ScanFeatures) -> NDArray[np.float32]:
        """Return the description (248,) float32 of the scan's place."""
        return self.model.embedding(scan.plain)[0].numpy()

    def _turns_rad(self) -> list[float]:
        count = self.model.settings.headings
        return [2 * math.pi * number / count for number in range(1, count)]

    def _matches(self, keypoints: Keypoints, destination: ScanFeatures, turn_rad: float) -> Matches:
        """Match keypoints that were seen after the picture was turned, and turn them back."""
        into = destination.plain
        found = self.model.matches(keypoints, into.maps, into.scores, self.matching)
        back = rotation_of_yaw(torch.tensor([-turn_rad]))
        return Matches(
            source_m=found.source_m @ back.transpose(1, 2),
            destination_m=found.destination_m,
            weights=found.weights,
        )


def folded(model: KeypointModel) -> KeypointModel:
    """Return a copy in evaluation mode whose batch normalisations are part of its convolutions."""
    model = copy.deepcopy(model).eval()
    for part in model.modules():
        if isinstance(part, nn.Sequential):
            for i, (layer, following) in enumerate(zip(list(part), list(part)[1:], strict=False)):
                if isinstance(layer, nn.Conv2d) and isinstance(following, nn.BatchNorm2d):
                    part[i], part[i + 1] = fuse_conv_bn_eval(layer, following), nn.Identity()
    return model.requires_grad_(False)


def _plane(motion: Motion) -> PlaneMotion:
    forward, right = _floats(motion.translation_m[0])
    return PlaneMotion(x_m=forward, y_m=right, yaw_rad=float(motion.yaw_rad))


def _floats(values: Tensor) -> list[float]:
    return [float(value) for value in values]
