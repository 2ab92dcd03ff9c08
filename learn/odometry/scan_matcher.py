"""A trained model at work on scans: features once a scan, then the motion between any two, and places.

Source: Barnes & Posner 2020, sections III-C and III-D. The robust, compensated and joint pose is ours
(`learn.geometry`). Batch normalisation is folded into the convolutions.
"""

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
from echoscape.learn.geometry.motion_compensation import Part, ScanMotionModel, Twist, solve_compensated
from echoscape.learn.geometry.pose_refinement import turned_precision
from echoscape.learn.geometry.procrustes import ROBUST_SCALE_PX, Motion
from echoscape.learn.geometry.se2 import relative, to_motion, transform
from echoscape.learn.model.device import fast_dtype
from echoscape.learn.model.fast_keypoint_model import (
    Destination,
    FastKeypointModel,
    Matching,
    destination_of,
)
from echoscape.learn.model.keypoint_model import KeypointModel
from echoscape.learn.model.keypoints import Keypoints
from echoscape.learn.odometry.pair_estimate import PairEstimate, pair_estimate
from echoscape.sim.datasets.polar_scan import PolarScan
from echoscape.sim.datasets.se2 import IDENTITY, SE2


@dataclass(frozen=True, kw_only=True)
class ScanFeatures:
    """What is kept of a scan, to be matched with others as source or as destination.

    Attributes:
        keypoints: Its keypoints, in its image.
        destination: Its image to be searched; what searches share is computed by the first and kept.
        cells: Its range cells (azimuths, cells) uint8, from which it can be rendered at other poses.
        first_rad: Direction of its first azimuth, clockwise from ahead [rad].
        rendered_at: Pose of the scan in the frame of its image, IDENTITY for an image centred on the radar
            with forward up.
    """

    keypoints: Keypoints
    destination: Destination
    cells: NDArray[np.uint8]
    first_rad: float
    rendered_at: SE2 = IDENTITY


@dataclass(frozen=True, kw_only=True)
class Reference:
    """A destination of a joint estimate.

    Attributes:
        features: The scan.
        pose: Its pose in the frame of the estimate.
        twist: Velocities at which it was measured; None for those of the motion to the source.
        weight: Factor of the weights of its matches.
    """

    features: ScanFeatures
    pose: SE2 = IDENTITY
    twist: Twist | None = None
    weight: float = 1.0


@dataclass(frozen=True, kw_only=True)
class MatcherConfig:
    """How motions are computed.

    Attributes:
        robust: Whether outliers are weighted down; otherwise least squares of all matches.
        matching: How matches are searched for.
        network_dtype: Number format of the convolutions.
    """

    robust: bool = True
    matching: Matching = field(default_factory=Matching)
    network_dtype: torch.dtype = torch.float32


def fast_config(device: torch.device) -> MatcherConfig:
    """Choose the fastest configuration that is as accurate: one sample per 2 x 2 pixels.

    Networks and products are bfloat16 where the device multiplies it natively, which changes motions by
    millimetres; elsewhere float32.

    Args:
        device: Where the matcher runs.

    Returns:
        The configuration.
    """
    dtype = fast_dtype(device)
    return MatcherConfig(matching=Matching(stride=2, dtype=dtype), network_dtype=dtype)


class ScanMatcher:
    """Matches scans by a trained model."""

    def __init__(
        self,
        model: KeypointModel | FastKeypointModel,
        config: MatcherConfig | None = None,
        *,
        device: torch.device | None = None,
        range_offset_m: float = 0.0,
    ) -> None:
        """Take a copy of a model, prepared for inference.

        Args:
            model: The model.
            config: How motions are computed; None for the default configuration.
            device: Where to compute; None for where the model is. Poses are solved on the CPU.
            range_offset_m: Added to the ranges of all bins [m].
        """
        self.device = device or next(model.parameters()).device
        self.model = folded(model).to(self.device)
        self.config = config or MatcherConfig()
        self._range_offset_m = range_offset_m
        self._projectors: dict[int, Projector] = {}

    def features(self, scan: PolarScan, *, rendered_at: SE2 = IDENTITY) -> ScanFeatures:
        """Compute the features of a scan.

        Args:
            scan: The scan.
            rendered_at: Pose of the scan in the frame of its image.

        Returns:
            Its features, on the device.

        Raises:
            ValueError: The scan has no azimuths or bins.
        """
        settings = self.model.settings.image
        cells = range_cells(scan.codes, scan.bin_m, settings, range_offset_m=self._range_offset_m)
        return self._features(cells, scan.first_azimuth_rad, rendered_at)

    def rendered(self, scan: ScanFeatures, rendered_at: SE2) -> ScanFeatures:
        """Compute the features of a scan rendered at another pose.

        Args:
            scan: Features of the scan.
            rendered_at: Pose of the scan in the frame of its new image.

        Returns:
            The features; the same object if the pose is the same.
        """
        if rendered_at == scan.rendered_at:
            return scan
        return self._features(scan.cells, scan.first_rad, rendered_at)

    @torch.inference_mode()
    def match(
        self, source: ScanFeatures, destination: ScanFeatures, *, search_sigma_m: float | None = None
    ) -> Matches:
        """Match the keypoints of a scan to another scan.

        Args:
            source: The scan whose keypoints are searched for.
            destination: The scan that is searched.
            search_sigma_m: Where both images show the scene in one frame, the standard deviation of a match
                from its keypoint there [m]; None searches the whole image.

        Returns:
            One set of matches on the CPU, points each in the frame of its own scan.
        """
        found = self.model.match(
            source.keypoints, destination.destination, search_sigma_m=search_sigma_m
        ).cpu()
        to_source, to_destination = source.rendered_at.inverse(), destination.rendered_at.inverse()
        return replace(
            found,
            source_m=transform(to_source, found.source_m),
            destination_m=transform(to_destination, found.destination_m),
            precision=None
            if found.precision is None
            else turned_precision(found.precision, to_motion(to_destination).rotation),
        )

    def estimate(
        self,
        source: ScanFeatures,
        references: Sequence[Reference] | ScanFeatures,
        *,
        scan_motion: ScanMotionModel | None = None,
        search_sigma_m: float | None = None,
    ) -> PairEstimate:
        """Estimate the pose of a scan from its matches with one or several others.

        Without a search prior, images may differ in heading by some 20 deg.

        Args:
            source: The scan.
            references: Destinations, or a single scan for the motion to it.
            scan_motion: Timing, for a motion from mid-scan to mid-scan at the velocity of the estimate
                itself; None takes points as measured at a single instant.
            search_sigma_m: See `match`.

        Returns:
            The pose of the source in the frame of the references' poses, with the matches of the last one.
        """
        if isinstance(references, ScanFeatures):
            references = [Reference(features=references)]
        parts = [
            Part(
                matches=self.match(source, each.features, search_sigma_m=search_sigma_m),
                pose=to_motion(each.pose),
                twist=each.twist,
                weight=each.weight,
            )
            for each in references
        ]
        return self._solve(parts, scan_motion)

    @torch.inference_mode()
    def _solve(self, parts: Sequence[Part], scan_motion: ScanMotionModel | None = None) -> PairEstimate:
        """Return the pose of the source in the frame of the parts' poses, with the last part's matches."""
        scale_m = ROBUST_SCALE_PX * self.model.settings.image.pixel_m
        motion, compensated = solve_compensated(
            parts, scale_m=scale_m if self.config.robust else None, scan_motion=scan_motion
        )
        agreement = sum(_agreement(part, motion, scale_m) for part in compensated)
        return pair_estimate(motion, parts[-1].matches, agreement=agreement)

    def estimate_any_heading(
        self, source: ScanFeatures, destination: ScanFeatures, *, headings: int = 16
    ) -> PairEstimate:
        """Estimate the motion between scans of one place at any headings.

        The source is rendered at `headings` headings, evenly spaced; the motion that most matches agree with
        is refined with the source rendered there.

        Args:
            source: The scan.
            destination: The scan that is searched.
            headings: Number of hypotheses.

        Returns:
            The motion T_destination_source.

        Raises:
            ValueError: `headings` is below 1.
        """
        if headings < 1:
            raise ValueError(f"headings must be 1 or more, got {headings}")
        yaws = (2 * math.pi * number / headings for number in range(headings))
        rendered = (self.rendered(source, replace(IDENTITY, yaw_rad=yaw)) for yaw in yaws)
        best = max((self.estimate(each, destination) for each in rendered), key=lambda found: found.agreement)
        at_best = self.rendered(source, destination.rendered_at @ best.motion)
        return max(self.estimate(at_best, destination), best, key=lambda found: found.agreement)

    @torch.inference_mode()
    def embedding(self, scan: ScanFeatures) -> NDArray[np.float32]:
        """Describe the place of a scan.

        Args:
            scan: Features of the scan.

        Returns:
            The description (248,) float32: the maximum of each dense descriptor over its image.
        """
        return self.model.embedding(scan.destination.pyramid.maps)[0].cpu().numpy()

    @torch.inference_mode()
    def _features(self, cells: NDArray[np.uint8], first_rad: float, rendered_at: SE2) -> ScanFeatures:
        """Return the features of range cells, rendered at a pose."""
        if len(cells) not in self._projectors:
            self._projectors[len(cells)] = Projector(self.model.settings.image, len(cells))
        image = self._projectors[len(cells)].image(
            cells,
            first_rad=first_rad,
            turn_rad=rendered_at.yaw_rad,
            shift_m=(rendered_at.x_m, rendered_at.y_m),
        )
        found = self.model.features(image[None].to(self.device), self.config.network_dtype)
        return ScanFeatures(
            keypoints=found.keypoints,
            destination=destination_of(found.maps, found.scores, self.config.matching),
            cells=cells,
            first_rad=first_rad,
            rendered_at=rendered_at,
        )


def _agreement(part: Part, motion: Motion, scale_m: float) -> float:
    """Return the sum of the weights of the matches that a motion explains."""
    off = part.matches.errors_m(relative(part.pose, motion)) / scale_m
    return part.weight * float((part.matches.weights * torch.exp(-0.5 * off**2)).sum())


def folded(model: KeypointModel | FastKeypointModel) -> FastKeypointModel:
    """Copy a model for inference, its batch normalisations folded into its convolutions.

    Args:
        model: The model.

    Returns:
        The copy in evaluation mode, without gradients.
    """
    fast = FastKeypointModel.from_plain(model).eval()
    for part in fast.modules():
        if isinstance(part, nn.Sequential):
            for i, (layer, following) in enumerate(zip(list(part), list(part)[1:], strict=False)):
                if isinstance(layer, nn.Conv2d) and isinstance(following, nn.BatchNorm2d):
                    part[i], part[i + 1] = fuse_conv_bn_eval(layer, following), nn.Identity()
    # With a pixel's channels side by side, convolutions and descriptors take half the time.
    return fast.requires_grad_(False).to(memory_format=torch.channels_last)  # pyright: ignore
