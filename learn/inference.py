"""A trained model at work: keypoints once a scan, then the motion between any two scans, and a scan's place.

Source: Barnes & Posner 2020, sections III-C and III-D. Batch normalisation is folded into the convolutions.
"""

import copy
import math
from dataclasses import dataclass, field, replace

import numpy as np
import torch
from numpy.typing import NDArray
from torch import Tensor, nn
from torch.nn.utils.fusion import fuse_conv_bn_eval

from echoscape.learn.augment import PlaneMotion
from echoscape.learn.image import Projector, range_cells
from echoscape.learn.keypoints import Keypoints
from echoscape.learn.model import Destination, Features, KeypointModel, Matching, destination_of
from echoscape.learn.pose import ROBUST_SCALE_PX, Motion, residuals_m, rotation_of_yaw
from echoscape.learn.rolling import Rolling, solved


@dataclass(frozen=True, kw_only=True)
class ScanFeatures:
    """What is kept of a scan: what the network says of it, and its range cells (azimuths, cells) uint8."""

    plain: Features
    cells: NDArray[np.uint8]


@dataclass(frozen=True, kw_only=True)
class Solving:
    """How a motion is made of matches.

    robust: whether matches that disagree with the others are weighed down, rather than least squares of all;
    matching: how matches are searched for; network: number format of the convolutions.
    """

    robust: bool = True
    matching: Matching = field(default_factory=Matching)
    network: torch.dtype = torch.float32


def quick_solving() -> Solving:
    """Return what costs least and was seen to be as accurate: a search between every four pixels.

    Networks and products are bfloat16 where the processor multiplies that by itself, which moves an answer
    by millimetres; elsewhere float32.
    """
    able = torch.cpu.get_capabilities()
    native = bool(able.get("avx512_bf16") or able.get("amx_bf16"))
    dtype = torch.bfloat16 if native else torch.float32
    return Solving(matching=Matching(stride=2, dtype=dtype), network=dtype)


@dataclass(frozen=True, kw_only=True)
class PairEstimate:
    """The motion T_destination_source of a pair and the matches behind it.

    source_m, destination_m: (N, 2) float32 forward, right [m]; weights: (N,) float32; certain: whether the
    matches determine the rotation; agreement: the weight of the matches that the motion explains.
    """

    motion: PlaneMotion
    source_m: NDArray[np.float32]
    destination_m: NDArray[np.float32]
    weights: NDArray[np.float32]
    certain: bool
    agreement: float


class Estimator:
    """A model that takes scans."""

    def __init__(self, model: KeypointModel, solving: Solving | None = None) -> None:
        """Take a copy of the model, made faster for inference."""
        self.model = folded(model)
        self.solving = solving or Solving()
        self._projectors: dict[int, Projector] = {}

    @torch.inference_mode()
    def features(
        self, codes: NDArray[np.uint8], bin_m: float, *, range_offset_m: float = 0.0
    ) -> ScanFeatures:
        """Return what is kept of a scan with codes (azimuths, bins).

        Raises:
            ValueError: `codes` is no scan, or `bin_m` no length.
        """
        cells = range_cells(codes, bin_m, self.model.settings.image, range_offset_m=range_offset_m)
        return ScanFeatures(plain=self._seen(cells, 0.0), cells=cells)

    @torch.inference_mode()
    def estimate(
        self, source: ScanFeatures, destination: ScanFeatures, rolling: Rolling | None = None
    ) -> PairEstimate:
        """Return the motion T_destination_source of scans whose headings differ by less than some 20 deg.

        rolling: how the scans rolled, for the motion from mid-scan to mid-scan of a car that is not slow;
        without it points count as if they had all been seen at once.
        """
        return self._estimate(source.plain.keypoints, self._prepared(destination), 0.0, rolling)

    @torch.inference_mode()
    def estimate_any_heading(
        self, source: ScanFeatures, destination: ScanFeatures, *, headings: int = 16
    ) -> PairEstimate:
        """Return the motion T_destination_source of scans with any headings.

        The source's picture is turned to `headings` headings, evenly around; the motion whose matches agree
        most wins, and is refined with the picture turned to the heading that it tells.

        Raises:
            ValueError: `headings` is below 1.
        """
        if headings < 1:
            raise ValueError(f"headings must be 1 or more, got {headings}")
        turns = [2 * math.pi * number / headings for number in range(headings)]
        into = self._prepared(destination)
        best = max((self._turned(source, into, turn) for turn in turns), key=lambda each: each.agreement)
        return max(self._turned(source, into, best.motion.yaw_rad), best, key=lambda each: each.agreement)

    @torch.inference_mode()
    def embedding(self, scan: ScanFeatures) -> NDArray[np.float32]:
        """Return the description (248,) float32 of the scan's place."""
        return self.model.embedding(scan.plain)[0].numpy()

    def _seen(self, cells: NDArray[np.uint8], turn_rad: float) -> Features:
        """Return what the network says of range cells, once their picture is turned."""
        projector = self._projectors.setdefault(len(cells), Projector(self.model.settings.image, len(cells)))
        picture = projector.image(cells, turn_rad=turn_rad)[None]
        with torch.autocast("cpu", self.solving.network, enabled=self.solving.network != torch.float32):
            return self.model.features(picture)

    def _prepared(self, scan: ScanFeatures) -> Destination:
        return destination_of(scan.plain.maps, scan.plain.scores, self.solving.matching)

    def _turned(self, source: ScanFeatures, into: Destination, turn_rad: float) -> PairEstimate:
        keypoints = self._seen(source.cells, turn_rad).keypoints if turn_rad else source.plain.keypoints
        return self._estimate(keypoints, into, turn_rad, None)

    def _estimate(
        self, keypoints: Keypoints, into: Destination, turn_rad: float, rolling: Rolling | None
    ) -> PairEstimate:
        """Match keypoints that were seen after the picture was turned, turn them back, and solve."""
        found = self.model.matches(keypoints, into, self.solving.matching)
        back = rotation_of_yaw(torch.tensor([-turn_rad]))
        found = replace(found, source_m=found.source_m @ back.transpose(1, 2))
        scale_m = ROBUST_SCALE_PX * self.model.settings.image.pixel_m
        motion, found = solved(found, scale_m=scale_m if self.solving.robust else None, rolling=rolling)
        off = residuals_m(found.source_m, found.destination_m, motion) / scale_m
        return PairEstimate(
            motion=_plane(motion),
            source_m=found.source_m[0].numpy(),
            destination_m=found.destination_m[0].numpy(),
            weights=found.weights[0].numpy(),
            certain=bool(motion.certain),
            agreement=float((found.weights * torch.exp(-0.5 * off**2)).sum()),
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
