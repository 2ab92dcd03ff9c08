"""A trained model at work: keypoints once a scan, then the motion between any two scans, and a scan's place.

Source: Barnes & Posner 2020, sections III-C and III-D. Batch normalisation is folded into the convolutions.
"""

import copy
import math
from collections.abc import Sequence
from dataclasses import dataclass, field, replace

import numpy as np
import torch
from numpy.typing import NDArray
from torch import nn
from torch.nn.utils.fusion import fuse_conv_bn_eval

from echoscape.learn.data.image import Projector, range_cells
from echoscape.learn.geometry.matches import Matches
from echoscape.learn.geometry.motion_compensation import Part, ScanMotionModel, solve_compensated
from echoscape.learn.geometry.pose_refinement import turned_precision
from echoscape.learn.geometry.procrustes import ROBUST_SCALE_PX, Motion
from echoscape.learn.geometry.se2 import relative, to_motion, to_pose, transform
from echoscape.learn.model.keypoint_model import (
    Destination,
    Features,
    KeypointModel,
    Matching,
    destination_of,
)
from echoscape.sim.datasets.se2 import IDENTITY, SE2


@dataclass(frozen=True, kw_only=True)
class ScanFeatures:
    """What is kept of a scan.

    seen: what the network says of its picture; cells: range cells (azimuths, cells) uint8; shown_at: the pose
    of the scan in the frame of its picture, which need not be upright nor show the radar in its middle.
    """

    seen: Features
    cells: NDArray[np.uint8]
    shown_at: SE2 = IDENTITY


@dataclass(frozen=True, kw_only=True)
class MatchTarget:
    """A scan's picture for others to be looked for in, and the scan's pose in its frame.

    What searches share is made by the first of them, and kept.
    """

    destination: Destination
    shown_at: SE2


@dataclass(frozen=True, kw_only=True)
class MatcherConfig:
    """How a motion is made of matches.

    robust: whether matches that disagree with the others are weighed down, rather than least squares of all;
    matching: how matches are searched for; network: number format of the convolutions.
    """

    robust: bool = True
    matching: Matching = field(default_factory=Matching)
    network: torch.dtype = torch.float32


def quick_solving() -> MatcherConfig:
    """Return what costs least and was seen to be as accurate: a search between every four pixels.

    Networks and products are bfloat16 where the processor multiplies that by itself, which moves an answer
    by millimetres; elsewhere float32.
    """
    able = torch.cpu.get_capabilities()
    native = bool(able.get("avx512_bf16") or able.get("amx_bf16"))
    dtype = torch.bfloat16 if native else torch.float32
    return MatcherConfig(matching=Matching(stride=2, dtype=dtype), network=dtype)


@dataclass(frozen=True, kw_only=True)
class PairEstimate:
    """The motion T_destination_source of a pair and the matches behind it.

    source_m, destination_m: (N, 2) float32 forward, right [m], each in its own scan's frame, as its picture
    shows it; weights: (N,) float32; certain: whether the matches determine the motion; agreement: the weight
    of the matches that the motion explains, those with other destinations included.
    """

    motion: SE2
    source_m: NDArray[np.float32]
    destination_m: NDArray[np.float32]
    weights: NDArray[np.float32]
    certain: bool
    agreement: float


class ScanMatcher:
    """A model that takes scans."""

    def __init__(self, model: KeypointModel, solving: MatcherConfig | None = None) -> None:
        """Take a copy of the model, made faster for inference."""
        self.model = folded(model)
        self.solving = solving or MatcherConfig()
        self._projectors: dict[int, Projector] = {}

    @torch.inference_mode()
    def features(
        self,
        codes: NDArray[np.uint8],
        bin_m: float,
        *,
        range_offset_m: float = 0.0,
        shown_at: SE2 = IDENTITY,
    ) -> ScanFeatures:
        """Return what is kept of a scan with codes (azimuths, bins), shown at a pose.

        Raises:
            ValueError: `codes` is no scan, or `bin_m` no length.
        """
        cells = range_cells(codes, bin_m, self.model.settings.image, range_offset_m=range_offset_m)
        return self._seen(cells, shown_at)

    @torch.inference_mode()
    def shown(self, scan: ScanFeatures, shown_at: SE2) -> ScanFeatures:
        """Return what is kept of a scan once its picture shows it at another pose."""
        return scan if shown_at == scan.shown_at else self._seen(scan.cells, shown_at)

    @torch.inference_mode()
    def searchable(self, scan: ScanFeatures) -> MatchTarget:
        """Return the scan as a destination, to be used for as many sources as there are."""
        seen = scan.seen
        into = destination_of(seen.maps, seen.scores, self.solving.matching)
        return MatchTarget(destination=into, shown_at=scan.shown_at)

    @torch.inference_mode()
    def matches(self, source: ScanFeatures, into: MatchTarget, *, within_m: float | None = None) -> Matches:
        """Return the matches of the source's keypoints, points each in its own scan's frame [m].

        within_m: where both are shown in one frame, how far off in it a match is expected to be, as a
        standard deviation [m]; None expects it anywhere alike.
        """
        found = self.model.matches(source.seen.keypoints, into.destination, within_m=within_m)
        return replace(
            found,
            source_m=transform(source.shown_at.inverse(), found.source_m),
            destination_m=transform(into.shown_at.inverse(), found.destination_m),
            precision=None
            if found.precision is None
            else turned_precision(found.precision, to_motion(into.shown_at.inverse()).rotation),
        )

    @torch.inference_mode()
    def solve(self, parts: Sequence[Part], rolling: ScanMotionModel | None = None) -> PairEstimate:
        """Return the source's pose by its matches with one destination or more, and those with the last.

        The pose is told in the frame in which the parts tell their destinations'.
        """
        scale_m = ROBUST_SCALE_PX * self.model.settings.image.pixel_m
        motion, seen = solve_compensated(
            parts, scale_m=scale_m if self.solving.robust else None, rolling=rolling
        )
        last = parts[-1].matches
        return PairEstimate(
            motion=to_pose(motion),
            source_m=last.source_m[0].numpy(),
            destination_m=last.destination_m[0].numpy(),
            weights=last.weights[0].numpy(),
            certain=bool(motion.certain),
            agreement=sum(_agreement(part, motion, scale_m) for part in seen),
        )

    def estimate(
        self, source: ScanFeatures, destination: ScanFeatures, rolling: ScanMotionModel | None = None
    ) -> PairEstimate:
        """Return the motion T_destination_source of scans whose pictures differ by less than some 20 deg.

        rolling: how the scans rolled, for the motion from mid-scan to mid-scan of a car that is not slow;
        without it points count as if they had all been seen at once.
        """
        return self._estimate(source, self.searchable(destination), rolling)

    def estimate_any_heading(
        self, source: ScanFeatures, destination: ScanFeatures, *, headings: int = 16
    ) -> PairEstimate:
        """Return the motion T_destination_source of scans with any headings.

        The source's picture is turned to `headings` headings, evenly around; the motion whose matches agree
        most wins, and is refined with the source shown where that motion says.

        Raises:
            ValueError: `headings` is below 1.
        """
        if headings < 1:
            raise ValueError(f"headings must be 1 or more, got {headings}")
        into = self.searchable(destination)
        turns = (2 * math.pi * number / headings for number in range(headings))
        shown = (self.shown(source, replace(IDENTITY, yaw_rad=turn)) for turn in turns)
        best = max((self._estimate(each, into) for each in shown), key=lambda found: found.agreement)
        refined = self._estimate(self.shown(source, into.shown_at @ best.motion), into)
        return max(refined, best, key=lambda found: found.agreement)

    @torch.inference_mode()
    def embedding(self, scan: ScanFeatures) -> NDArray[np.float32]:
        """Return the description (248,) float32 of the scan's place."""
        return self.model.embedding(scan.seen)[0].numpy()

    def _seen(self, cells: NDArray[np.uint8], shown_at: SE2) -> ScanFeatures:
        """Return what the network says of range cells, shown at a pose."""
        if len(cells) not in self._projectors:
            self._projectors[len(cells)] = Projector(self.model.settings.image, len(cells))
        projector = self._projectors[len(cells)]
        shift_m = (shown_at.x_m, shown_at.y_m)
        picture = projector.image(cells, turn_rad=shown_at.yaw_rad, shift_m=shift_m)[None]
        seen = self.model.features(picture, self.solving.network)
        return ScanFeatures(seen=seen, cells=cells, shown_at=shown_at)

    def _estimate(
        self, source: ScanFeatures, into: MatchTarget, rolling: ScanMotionModel | None = None
    ) -> PairEstimate:
        return self.solve([Part(matches=self.matches(source, into), stood_at=to_motion(IDENTITY))], rolling)


def _agreement(part: Part, motion: Motion, scale_m: float) -> float:
    """Return the weight of the matches that a motion explains."""
    off = part.matches.errors_m(relative(part.stood_at, motion)) / scale_m
    return part.weight * float((part.matches.weights * torch.exp(-0.5 * off**2)).sum())


def folded(model: KeypointModel) -> KeypointModel:
    """Return a copy in evaluation mode whose batch normalisations are part of its convolutions."""
    model = copy.deepcopy(model).eval()
    for part in model.modules():
        if isinstance(part, nn.Sequential):
            for i, (layer, following) in enumerate(zip(list(part), list(part)[1:], strict=False)):
                if isinstance(layer, nn.Conv2d) and isinstance(following, nn.BatchNorm2d):
                    part[i], part[i + 1] = fuse_conv_bn_eval(layer, following), nn.Identity()
    # With a pixel's channels side by side, convolutions and descriptors take half the time.
    return model.requires_grad_(False).to(memory_format=torch.channels_last)  # pyright: ignore[reportCallIssue]
