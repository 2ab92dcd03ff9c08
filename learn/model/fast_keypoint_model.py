"""The keypoint model as training and odometry run it: what `keypoint_model` computes, in less time.

Differences are in cost and rounding only: dense descriptors are never stored for keypoints, the global search
is tiled, and a search around predicted locations is local. Weights fit both models.
"""

from collections.abc import Callable
from dataclasses import dataclass

import torch
from torch import Tensor, nn
from torch.nn.functional import pad

from echoscape.learn.geometry.matches import Matches
from echoscape.learn.model.descriptors import descriptors_at
from echoscape.learn.model.device import autocast
from echoscape.learn.model.feature_pyramid import FeaturePyramid
from echoscape.learn.model.keypoint_model import (
    KeypointModel,
    Maps,
    dense_descriptors,
    keypoint_locations,
    match_weights,
)
from echoscape.learn.model.keypoints import Keypoints, keypoints_at
from echoscape.learn.model.local_matching import Near, match_local
from echoscape.learn.model.model_settings import ModelSettings
from echoscape.learn.model.ops.channels_last import with_gradient_by_pixel
from echoscape.learn.model.pixel_coords import cell_centres, metres_of_pixels, pixels_of_metres, sampled
from echoscape.learn.model.prior_removal import precision_of_pixels, remove_prior
from echoscape.learn.model.tiled_matching import match_global
from echoscape.learn.model.unet import FastDecoder, FastEncoder

TruePlaces = Callable[[Tensor], Tensor]
"""Maps keypoints (B, N, 2) forward, right [m] to their true locations in the destination, likewise."""


@dataclass(frozen=True, kw_only=True)
class Matching:
    """How the search for matches is computed: cost and rounding, not what is searched for.

    Attributes:
        stride: 1 searches every pixel, 2 the centre of each 2 x 2 block.
        dtype: Number format of the products of descriptors.
    """

    stride: int = 1
    dtype: torch.dtype = torch.float32


@dataclass(frozen=True, kw_only=True)
class Features:
    """Output of the network for B images.

    Attributes:
        maps: Maps of the encoder.
        keypoints: N keypoints per image.
        scores: Scores (B, 1, H, W) from 0 to 1, None without that head.
    """

    maps: Maps
    keypoints: Keypoints
    scores: Tensor | None


@dataclass(frozen=True, kw_only=True)
class Destination:
    """B images in which keypoints are searched for.

    Attributes:
        pyramid: Features to search.
        scores: Scores (B, 1, H, W), None without that head.
    """

    pyramid: FeaturePyramid
    scores: Tensor | None


class FastKeypointModel(nn.Module):
    """`KeypointModel` for training and odometry, with matches before the pose is solved."""

    def __init__(self, settings: ModelSettings) -> None:
        """Make a model with random weights, the same as those of `KeypointModel` after the same seed.

        Args:
            settings: Settings of the model.
        """
        super().__init__()
        self.settings = settings
        self.encoder = FastEncoder(settings.pooling)
        self.locations = FastDecoder() if settings.location_head else None
        self.scores = FastDecoder() if settings.score_head else None

    @classmethod
    def from_plain(cls, model: "KeypointModel | FastKeypointModel") -> "FastKeypointModel":
        """Copy a model.

        Args:
            model: The model to copy.

        Returns:
            A fast model with a copy of its weights, on the same device, in the same mode.
        """
        fast = cls(model.settings)
        fast.load_state_dict(model.state_dict())
        return fast.to(next(model.parameters()).device).train(model.training)

    def forward(
        self,
        source: Tensor,
        destination: Tensor,
        matching: Matching,
        network_dtype: torch.dtype,
        true_places: TruePlaces | None = None,
    ) -> Matches:
        """Match images, for training; both go through the network as one batch.

        Args:
            source: Images (B, 1, H, H) in which keypoints are detected, on the model's device.
            destination: Images (B, 1, H, H) in which they are searched for.
            matching: How the search is computed.
            network_dtype: Number format of the convolutions.
            true_places: True locations of keypoints, for their surprisal, see `match`.

        Returns:
            The matches.
        """
        count = source.shape[0]
        with autocast(source.device, network_dtype):
            maps, scores = self.maps(torch.cat([source, destination]))
            source_maps, destination_maps = zip(*(each.split(count) for each in maps), strict=True)
            logits = None if self.locations is None else self.locations(source_maps)
        source_scores, destination_scores = (None, None) if scores is None else scores.split(count)
        keypoints = self.keypoints(_in_float32(source_maps), source_scores, logits)
        target = destination_of(_in_float32(destination_maps), destination_scores, matching)
        return self.match(keypoints, target, true_places)

    def maps(self, images: Tensor) -> tuple[Maps, Tensor | None]:
        """Run the encoder and the score decoder.

        Args:
            images: Images (B, 1, H, H).

        Returns:
            The encoder's maps, of the padded images, and the scores (B, 1, side, side) or None.
        """
        margin = (self.settings.side - images.shape[-1]) // 2
        maps = self.encoder(pad(images, [margin] * 4))
        return maps, None if self.scores is None else torch.sigmoid(self.scores(maps).float())

    def features(self, images: Tensor, network_dtype: torch.dtype = torch.float32) -> Features:
        """Compute everything that matching needs of images.

        Args:
            images: Images (B, 1, H, H), on the model's device.
            network_dtype: Number format of the convolutions; keypoints are computed in float32 from them.

        Returns:
            The features.
        """
        with autocast(images.device, network_dtype):
            maps, scores = self.maps(images)
            logits = None if self.locations is None else self.locations(maps)
        maps = _in_float32(maps)
        return Features(maps=maps, keypoints=self.keypoints(maps, scores, logits), scores=scores)

    def keypoints(self, maps: Maps, scores: Tensor | None, logits: Tensor | None) -> Keypoints:
        """Detect the keypoints of images.

        Args:
            maps: Maps of the encoder.
            scores: Scores (B, 1, side, side), or None.
            logits: Location logits (B, 1, side, side); None takes the centres of the cells.

        Returns:
            The keypoints, cells^2 per image.
        """
        if logits is not None:
            return keypoints_at(keypoint_locations(logits.float(), self.settings.cells), maps, scores)
        centres = cell_centres(maps[0].shape[-1], self.settings.cells, like=maps[0])
        return keypoints_at(centres.expand(maps[0].shape[0], -1, -1), maps, scores)

    def match(
        self,
        source: Keypoints,
        target: Destination,
        true_places: TruePlaces | None = None,
        *,
        search_sigma_m: float | None = None,
    ) -> Matches:
        """Search for keypoints in images.

        Args:
            source: Keypoints of the sources.
            target: The destinations.
            true_places: True locations of keypoints in the destinations, for the surprisal of global matches.
            search_sigma_m: Where both images show the scene in one frame, the standard deviation of a match
                from the keypoint's own location [m]; None searches the whole image.

        Returns:
            The matches, with surprisal if `true_places` is given, with precisions if `search_sigma_m` is.

        Raises:
            ValueError: Both are given.
        """
        if true_places is not None and search_sigma_m is not None:
            raise ValueError("true_places goes without search_sigma_m: surprisal is that of a global search")
        precision = surprisal = None
        if search_sigma_m is None:
            temperature = self.settings.temperature
            found = match_global(source.descriptors, target.pyramid, temperature=temperature)
            places = found.places_px
            if true_places is not None:
                surprisal = self._surprisal(source, target.pyramid, found.log_sums, true_places)
        else:
            places, precision = self._match_local(source, target.pyramid, search_sigma_m)
        similarity = (source.descriptors * descriptors_at(target.pyramid.maps, places)).sum(-1)
        scores = target.scores
        matched = torch.ones_like(similarity) if scores is None else sampled(scores, places)[..., 0]
        return Matches(
            source_m=self.metres(source.points_px),
            destination_m=self.metres(places),
            weights=match_weights(similarity, source.scores, matched),
            surprisal=surprisal,
            precision=precision,
        )

    def _match_local(
        self, source: Keypoints, pyramid: FeaturePyramid, search_sigma_m: float
    ) -> tuple[Tensor, Tensor]:
        """Return matched locations (B, N, 2) [px] without the prior, and their precisions (B, N, 2, 2).

        A prior narrower than a sample would itself choose among samples, so it is at least that wide.
        """
        sigma_px = max(search_sigma_m / self.settings.image.pixel_m, pyramid.stride)
        near = Near(places_px=source.points_px, deviation_px=sigma_px)
        found = match_local(source.descriptors, pyramid, temperature=self.settings.temperature, near=near)
        places, precision = remove_prior(found.found, found.expected)
        return places, precision_of_pixels(precision)

    def _surprisal(
        self, source: Keypoints, pyramid: FeaturePyramid, log_sums: Tensor, true_places: TruePlaces
    ) -> Tensor:
        """Return (B, N) [nat]: log sum - T q . d at the true locations, 0 where these are outside the image.

        The similarity there is interpolated between samples: with a descriptor interpolated from finer maps
        than those of the samples, the network would learn to distinguish the two.
        """
        true_m = true_places(self.metres(source.points_px))
        side = self.settings.side
        places = pixels_of_metres(true_m, size=side, pixel_m=self.settings.image.pixel_m)
        inside = ((places >= 0) & (places <= side - 1)).all(-1)
        similarity = pyramid.similarity(source.descriptors, places.detach())
        return torch.where(inside, log_sums - self.settings.temperature * similarity, 0.0)

    def metres(self, points_px: Tensor) -> Tensor:
        """Convert image points to metres.

        Args:
            points_px: Points (..., 2): row, column [px].

        Returns:
            The points (..., 2): forward, right [m].
        """
        return metres_of_pixels(points_px, size=self.settings.side, pixel_m=self.settings.image.pixel_m)

    def embedding(self, maps: Maps) -> Tensor:
        """Describe the places of images.

        Args:
            maps: Maps of the encoder of B images.

        Returns:
            Descriptions (B, 248): the maximum of each dense descriptor over all locations.
        """
        return dense_descriptors(maps).amax((2, 3))


def destination_of(maps: Maps, scores: Tensor | None, matching: Matching) -> Destination:
    """Prepare images to be searched.

    Args:
        maps: Maps of the encoder.
        scores: Scores (B, 1, H, W), or None.
        matching: How they will be searched.

    Returns:
        The images as destinations.
    """
    pyramid = FeaturePyramid(maps=maps, stride=matching.stride, dtype=matching.dtype)
    return Destination(pyramid=pyramid, scores=scores)


def _in_float32(maps: Maps) -> Maps:
    """Return maps in float32: autocast makes the network's output bfloat16."""
    return tuple(with_gradient_by_pixel(each).float() for each in maps)
