"""The whole model: two pictures to the motion between them, and each picture to keypoints and a place.

Source: Barnes & Posner 2020, section III and figure 2. A motion is T_destination_source in the axes and the
order of gt/radar_odometry.csv: for a car that drives on, with the later scan as the source, x is positive.
"""

import math
from collections.abc import Callable
from dataclasses import dataclass, field
from typing import get_args

import torch
from torch import Tensor, nn
from torch.nn.functional import pad

from echoscape.learn.data.image_settings import ImageSettings
from echoscape.learn.geometry.matches import Matches
from echoscape.learn.model.descriptors import descriptors_at, embedding, sampled
from echoscape.learn.model.feature_pyramid import FeaturePyramid
from echoscape.learn.model.keypoints import Keypoints, cell_centres, expected_places, keypoints_at
from echoscape.learn.model.local_matching import Near, match_local
from echoscape.learn.model.ops.channels_last import with_gradient_by_pixel
from echoscape.learn.model.pixel_coords import metres_of_pixels, pixels_of_metres
from echoscape.learn.model.prior_removal import precision_of_pixels, remove_prior
from echoscape.learn.model.softmax_matching import match_weights
from echoscape.learn.model.tiled_matching import match_global
from echoscape.learn.model.unet import Decoder, Encoder, Maps, Pooling

TruePlaces = Callable[[Tensor], Tensor]
"""Takes keypoints (B, N, 2) forward, right [m] to where they truly are in the destination, likewise."""


@dataclass(frozen=True, kw_only=True)
class ModelSettings:
    """What makes a model what it is, stored with its weights.

    image: how scans become pictures; cells: a side, each with one keypoint; temperature: T of the matching
    softmax; location_head, score_head: without, keypoints are the cells' middles, and all scores are 1;
    pooling: of the encoder, see `unet`.
    """

    image: ImageSettings = field(default_factory=ImageSettings)
    cells: int = 20
    temperature: float = 100.0
    location_head: bool = True
    score_head: bool = True
    pooling: Pooling = "max"

    def __post_init__(self) -> None:
        if not 2 <= self.cells <= self.image.size:
            raise ValueError(f"cells must be 2 to {self.image.size}, the picture's pixels, got {self.cells}")
        if self.pooling not in get_args(Pooling):
            raise ValueError(f"pooling must be one of {get_args(Pooling)}, got {self.pooling!r}")
        if not 0 < self.temperature < float("inf"):
            raise ValueError(f"temperature must be finite and above 0, got {self.temperature}")

    @property
    def side(self) -> int:
        """Pixels a side that the network works on: the picture's, with an empty margin where need be.

        A multiple of 16, for four times of pooling, and of the cells.
        """
        step = math.lcm(16, self.cells)
        return step * math.ceil(self.image.size / step)


@dataclass(frozen=True, kw_only=True)
class Matching:
    """How the search for matches is computed; it changes cost and rounding, not what is searched for.

    stride: 1 searches every pixel, 2 a grid of half as many a side; dtype: of the large products.
    """

    stride: int = 1
    dtype: torch.dtype = torch.float32


@dataclass(frozen=True, kw_only=True)
class Features:
    """What the network says of B pictures.

    maps: of the encoder; keypoints: N a picture; scores: (B, 1, H, W) from 0 to 1, None without that head.
    """

    maps: Maps
    keypoints: Keypoints
    scores: Tensor | None


@dataclass(frozen=True, kw_only=True)
class Destination:
    """B pictures to be searched, and their scores."""

    picture: FeaturePyramid
    scores: Tensor | None


class KeypointModel(nn.Module):
    """U-Net, keypoints, matching and pose."""

    def __init__(self, settings: ModelSettings) -> None:
        super().__init__()
        self.settings = settings
        self.encoder = Encoder(settings.pooling)
        self.locations = Decoder() if settings.location_head else None
        self.scores = Decoder() if settings.score_head else None

    def forward(
        self,
        source: Tensor,
        destination: Tensor,
        matching: Matching,
        network_dtype: torch.dtype,
        true_places: TruePlaces | None = None,
    ) -> Matches:
        """Return the matches between pictures (B, 1, H, H), for training.

        Both go through the network together; keypoints are looked for in the source alone. network_dtype:
        of the convolutions; true_places: see `matches`.
        """
        count = source.shape[0]
        with torch.autocast("cpu", network_dtype, enabled=network_dtype != torch.float32):
            maps, scores = self.maps(torch.cat([source, destination]))
            source_maps, destination_maps = zip(*(each.split(count) for each in maps), strict=True)
            logits = None if self.locations is None else self.locations(source_maps)
        source_scores, destination_scores = (None, None) if scores is None else scores.split(count)
        found = self.keypoints(_in_float32(source_maps), source_scores, logits)
        into = destination_of(_in_float32(destination_maps), destination_scores, matching)
        return self.matches(found, into, true_places)

    def maps(self, images: Tensor) -> tuple[Maps, Tensor | None]:
        """Return the encoder's maps and the scores of images (B, 1, H, H), the margin included."""
        margin = (self.settings.side - images.shape[-1]) // 2
        maps = self.encoder(pad(images, [margin] * 4))
        return maps, None if self.scores is None else torch.sigmoid(self.scores(maps).float())

    def features(self, images: Tensor, network_dtype: torch.dtype = torch.float32) -> Features:
        """Return all that a scan needs to be matched with others, of images (B, 1, H, H).

        network_dtype: of the convolutions; keypoints are made of their results in float32.
        """
        with torch.autocast("cpu", network_dtype, enabled=network_dtype != torch.float32):
            maps, scores = self.maps(images)
            logits = None if self.locations is None else self.locations(maps)
        maps = _in_float32(maps)
        return Features(maps=maps, keypoints=self.keypoints(maps, scores, logits), scores=scores)

    def keypoints(self, maps: Maps, scores: Tensor | None, logits: Tensor | None) -> Keypoints:
        """Return the keypoints of pictures; logits: of their places, None for the cells' middles."""
        if logits is not None:
            return keypoints_at(expected_places(logits.float(), self.settings.cells), maps, scores)
        centres = cell_centres(maps[0].shape[-1], self.settings.cells, like=maps[0])
        return keypoints_at(centres.expand(maps[0].shape[0], -1, -1), maps, scores)

    def matches(
        self,
        source: Keypoints,
        into: Destination,
        true_places: TruePlaces | None = None,
        *,
        within_m: float | None = None,
    ) -> Matches:
        """Look for the source's keypoints in destinations.

        within_m: where pictures are shown in one frame, how far from its own place each keypoint is expected,
        as a standard deviation [m]; None expects it anywhere alike. true_places: where each truly is in the
        destination, for the surprisal of matches that are expected anywhere.
        """
        if true_places is not None and within_m is not None:
            raise ValueError("true_places goes without within_m: surprisal is that of a search anywhere")
        precision = surprisal = None
        if within_m is None:
            temperature = self.settings.temperature
            found = match_global(source.descriptors, into.picture, temperature=temperature)
            places = found.places_px
            if true_places is not None:
                surprisal = self._surprisal(source, into.picture, found.log_sums, true_places)
        else:
            places, precision = self._near(source, into.picture, within_m)
        similarity = (source.descriptors * descriptors_at(into.picture.maps, places)).sum(-1)
        matched = torch.ones_like(similarity) if into.scores is None else sampled(into.scores, places)[..., 0]
        return Matches(
            source_m=self.metres(source.points_px),
            destination_m=self.metres(places),
            weights=match_weights(similarity, source.scores, matched),
            surprisal=surprisal,
            precision=precision,
        )

    def _near(self, source: Keypoints, picture: FeaturePyramid, within_m: float) -> tuple[Tensor, Tensor]:
        """Return places (B, N, 2) [px] found near the keypoints' own, and their precisions (B, N, 2, 2).

        A normal distribution narrower than a sample would choose among samples, so it is not.
        """
        deviation_px = max(within_m / self.settings.image.pixel_m, picture.stride)
        near = Near(places_px=source.points_px, deviation_px=deviation_px)
        found = match_local(source.descriptors, picture, temperature=self.settings.temperature, near=near)
        places, precision = remove_prior(found.found, found.expected)
        return places, precision_of_pixels(precision)

    def _surprisal(
        self,
        source: Keypoints,
        picture: FeaturePyramid,
        log_sums: Tensor,
        true_places: TruePlaces,
    ) -> Tensor:
        """Return (B, N) [nat]: log sum - T q . d at the true places, 0 where these are not in the picture.

        The true place shares in the samples around it, as bilinear interpolation has it: were its descriptor
        made of finer maps than those of the samples, the network would learn to tell the two apart.
        """
        true_m = true_places(self.metres(source.points_px))
        side = self.settings.side
        places = pixels_of_metres(true_m, size=side, pixel_m=self.settings.image.pixel_m)
        inside = ((places >= 0) & (places <= side - 1)).all(-1)
        similarity = picture.similarity(source.descriptors, places.detach())
        return torch.where(inside, log_sums - self.settings.temperature * similarity, 0.0)

    def metres(self, points_px: Tensor) -> Tensor:
        """Return points (..., 2) row, column [px] as forward, right [m]."""
        return metres_of_pixels(points_px, size=self.settings.side, pixel_m=self.settings.image.pixel_m)

    def embedding(self, features: Features) -> Tensor:
        """Return (B, 248), the description of the place."""
        return embedding(features.maps)


def destination_of(maps: Maps, scores: Tensor | None, matching: Matching) -> Destination:
    """Return pictures with these maps and scores, to be searched as `matching` says."""
    picture = FeaturePyramid(maps=maps, stride=matching.stride, dtype=matching.dtype)
    return Destination(picture=picture, scores=scores)


def _in_float32(maps: Maps) -> Maps:
    """Return maps as they are computed with: autocast makes the network's output bfloat16."""
    return tuple(with_gradient_by_pixel(each).float() for each in maps)
