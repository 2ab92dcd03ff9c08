"""The method of "Under the Radar" from two radar images to the motion between them, in plain PyTorch.

Source: Barnes & Posner, "Under the Radar: Learning to Predict Robust Keypoints for Odometry Estimation and
Metric Localisation in Radar", ICRA 2020; this file follows its section III and figure 2 from top to bottom.
A motion is T_destination_source in the axes of gt/radar_odometry.csv: forward, right, clockwise from above.
`fast_keypoint_model` computes the same faster; it is tested against this file.
"""

import torch
from torch import Tensor, nn
from torch.nn.functional import interpolate, max_pool2d, normalize, pad

from echoscape.learn.geometry.matches import Matches
from echoscape.learn.geometry.procrustes import Motion
from echoscape.learn.model.blurred_pooling import blurred_max_pool
from echoscape.learn.model.model_settings import ModelSettings, Pooling
from echoscape.learn.model.pixel_coords import cell_centres, metres_of_pixels, pixel_grid, sampled

CHANNELS = (8, 16, 32, 64, 128)
"""Channels of the encoder's blocks, finest first; together the 248 of a dense descriptor."""
MOMENTUM = 0.01
"""Share of one step in the running statistics of batch normalisation; a step sees a single pair."""
MIN_NORM = 1e-6
"""Descriptors shorter than this are divided by it instead of by their length."""

Maps = tuple[Tensor, ...]
"""Maps of the encoder, finest first: map l is (B, CHANNELS[l], H / 2^l, W / 2^l)."""


# ------------------------------------------------------------------ III-A: the network
def block(inputs: int, outputs: int) -> nn.Sequential:
    """Return two 3 x 3 convolutions, each with batch normalisation and ReLU.

    Args:
        inputs: Channels of the input.
        outputs: Channels of the output.

    Returns:
        The layers: (B, inputs, H, W) to (B, outputs, H, W).
    """
    layers: list[nn.Module] = []
    for channels in (inputs, outputs):
        layers += [nn.Conv2d(channels, outputs, 3, padding=1, bias=False)]
        layers += [nn.BatchNorm2d(outputs, momentum=MOMENTUM), nn.ReLU(inplace=True)]
    return nn.Sequential(*layers)


class Encoder(nn.Module):
    """Encoder of the U-Net: images (B, 1, H, W), H and W multiples of 16, to five maps."""

    def __init__(self, pooling: Pooling = "max") -> None:
        super().__init__()
        self.pooling = pooling
        self.blocks = nn.ModuleList(map(block, (1, *CHANNELS[:-1]), CHANNELS))

    def forward(self, images: Tensor) -> Maps:
        """Compute the maps of images.

        Args:
            images: Images (B, 1, H, W).

        Returns:
            The five maps.
        """
        maps = [self.blocks[0](images)]
        for layer in list(self.blocks)[1:]:
            halved = blurred_max_pool(maps[-1]) if self.pooling == "blurred" else max_pool2d(maps[-1], 2)
            maps.append(layer(halved))
        return tuple(maps)


class Decoder(nn.Module):
    """Decoder of the U-Net with skip connections: maps to one number per pixel, by a 1 x 1 convolution."""

    def __init__(self) -> None:
        super().__init__()
        pairs = zip(CHANNELS[1:], CHANNELS[:-1], strict=True)
        self.blocks = nn.ModuleList([block(coarse + fine, fine) for coarse, fine in pairs])
        self.head = nn.Conv2d(CHANNELS[0], 1, 1)

    def forward(self, maps: Maps) -> Tensor:
        """Compute one number per pixel.

        Args:
            maps: Maps of the encoder.

        Returns:
            Logits (B, 1, H, W), unbounded.
        """
        values = maps[-1]
        for fine, layer in zip(maps[-2::-1], list(self.blocks)[::-1], strict=True):
            upsampled = interpolate(values, scale_factor=2, mode="bilinear", align_corners=False)
            values = layer(torch.cat([upsampled, fine], 1))
        weight, bias = self.head.parameters()  # summed here, so that threads do not change its rounding
        return (values * weight[0]).sum(1, keepdim=True) + bias


def dense_descriptors(maps: Maps) -> Tensor:
    """Upsample the maps to the image's size and concatenate them.

    Args:
        maps: Maps of the encoder.

    Returns:
        Dense descriptors (B, 248, H, W), not normalised.
    """
    size = maps[0].shape[-2:]
    coarse = [interpolate(each, size=size, mode="bilinear", align_corners=False) for each in maps[1:]]
    return torch.cat([maps[0], *coarse], 1)


# ------------------------------------------------------------------ III-B: keypoints and matches
def keypoint_locations(logits: Tensor, cells: int) -> Tensor:
    """Compute keypoint locations by a spatial softmax over each cell: sum_p softmax(logits)_p p.

    Args:
        logits: Location logits (B, 1, H, H).
        cells: Cells a side.

    Returns:
        Locations (B, cells^2, 2): row, column [px].

    Raises:
        ValueError: The logits are not square, or H is not a multiple of `cells`.
    """
    batch, _, size, width = logits.shape
    if size != width or size % cells:
        raise ValueError(f"logits must be square and a multiple of {cells} wide, got {size} x {width}")
    side = size // cells
    tiles = logits.reshape(batch, cells, side, cells, side).transpose(2, 3)  # (B, cells, cells, side, side)
    weights = tiles.reshape(batch, cells * cells, side * side).softmax(-1)
    offsets = pixel_grid(side, side, like=logits) - (side - 1) / 2
    return cell_centres(size, cells, like=logits) + weights @ offsets


def unit(descriptors: Tensor, dim: int = -1) -> Tensor:
    """Divide descriptors by their Euclidean length, at least `MIN_NORM`.

    Args:
        descriptors: Descriptors, of any shape.
        dim: Dimension of their channels.

    Returns:
        Descriptors of the same shape.
    """
    return normalize(descriptors, dim=dim, eps=MIN_NORM)


def matched_locations(descriptors: Tensor, dense: Tensor, *, temperature: float) -> Tensor:
    """Match keypoints to a whole image: sum over pixels p of softmax_p(T cos(d, D_p)) p.

    Args:
        descriptors: Of keypoints (B, N, 248), of unit length.
        dense: Dense descriptors of the image (B, 248, H, W), of unit length.
        temperature: T.

    Returns:
        Matched locations (B, N, 2): row, column [px].
    """
    weights = (temperature * (descriptors @ dense.flatten(2))).softmax(-1)  # (B, N, H W)
    return weights @ pixel_grid(*dense.shape[-2:], like=descriptors)


def match_weights(similarity: Tensor, source_scores: Tensor, matched_scores: Tensor) -> Tensor:
    """Weigh matches by similarity and scores: (cos(d_s, d_d) + 1) / 2 s_s s_d.

    Args:
        similarity: Cosines of the descriptors of keypoint and match (B, N).
        source_scores: Scores at the keypoints (B, N).
        matched_scores: Scores of the destination at the matches (B, N).

    Returns:
        Weights (B, N).
    """
    return 0.5 * (similarity + 1) * source_scores * matched_scores


# ------------------------------------------------------------------ III-C: pose
def weighted_pose(source_m: Tensor, destination_m: Tensor, weights: Tensor) -> Motion:
    """Minimise sum w |R source + t - destination|^2 by singular value decomposition (Umeyama 1991).

    Where the points do not determine R (no weight, or all in one place) it is 1, without gradient, and the
    motion is not `certain`. The gradient of R does not exist where both singular values are equal.

    Args:
        source_m: Keypoints (B, N, 2): forward, right [m].
        destination_m: Their matches (B, N, 2) [m].
        weights: Weights (B, N), 0 or more.

    Returns:
        The motions T_destination_source.
    """
    eps = torch.finfo(weights.dtype).eps
    share = (weights / weights.sum(1, keepdim=True).clamp(min=1e-12))[..., None]
    source_mean, destination_mean = (share * source_m).sum(1), (share * destination_m).sum(1)
    source, destination = source_m - source_mean[:, None], destination_m - destination_mean[:, None]
    covariance = destination.mT @ (share * source)  # (B, 2, 2)
    strength = torch.hypot(  # the sum of the singular values, the second one signed
        covariance[:, 0, 0] + covariance[:, 1, 1], covariance[:, 1, 0] - covariance[:, 0, 1]
    )
    rounding = 64 * eps**2 * (share * (source_m**2 + destination_m**2)).sum((1, 2))
    certain = strength > 8 * eps * (share * (source**2 + destination**2)).sum((1, 2)) + rounding
    stand_in = torch.diag(covariance.new_tensor([2.0, 1.0]))
    u, _, vt = torch.linalg.svd(torch.where(certain[:, None, None], covariance, stand_in))
    signs = torch.stack([torch.ones_like(strength), torch.linalg.det(u @ vt).detach()], -1)
    rotation = u @ torch.diag_embed(signs) @ vt  # det(R) = 1: no reflection
    translation_m = destination_mean - (rotation @ source_mean[..., None])[..., 0]
    return Motion(rotation=rotation, translation_m=translation_m, certain=certain)


def pose_loss(estimate: Motion, truth: Motion, *, alpha_m: float) -> Tensor:
    """Compute the loss (B,) [m], equation 6: |t^ - t| + alpha |R^ R^T - 1|, both spectral norms.

    For plane rotations that differ by delta the second is 2 |sin(delta / 2)|: both columns of the matrix
    have that length and are orthogonal. At an error of exactly 0 the gradient is 0.

    Args:
        estimate: Estimated motions, B of them.
        truth: True motions.
        alpha_m: Weight of the rotation [m], 10 in the paper.

    Returns:
        The loss (B,) [m].
    """
    translation_m = torch.linalg.vector_norm(estimate.translation_m - truth.translation_m, dim=-1)
    rotation = estimate.rotation @ truth.rotation.transpose(1, 2) - torch.eye(2).to(estimate.rotation)
    return translation_m + alpha_m * torch.linalg.vector_norm(rotation[..., 0], dim=-1)


# ------------------------------------------------------------------ the whole method
class KeypointModel(nn.Module):
    """The network and the differentiable odometry on top of it."""

    def __init__(self, settings: ModelSettings) -> None:
        """Make a model with random weights.

        Args:
            settings: Settings of the model.
        """
        super().__init__()
        self.settings = settings
        self.encoder = Encoder(settings.pooling)
        self.locations = Decoder() if settings.location_head else None
        self.scores = Decoder() if settings.score_head else None

    def maps(self, images: Tensor) -> Maps:
        """Compute the encoder's maps of images that are padded to `ModelSettings.side`.

        Args:
            images: Images (B, 1, size, size).

        Returns:
            The five maps.
        """
        return self.encoder(pad(images, [(self.settings.side - images.shape[-1]) // 2] * 4))

    def forward(self, source: Tensor, destination: Tensor) -> tuple[Motion, Matches]:
        """Estimate the motions between images.

        Args:
            source: Images (B, 1, size, size), on the model's device; keypoints are detected in these.
            destination: Images (B, 1, size, size) in which they are searched for.

        Returns:
            The motions T_destination_source, and the matches behind them.
        """
        settings, count = self.settings, len(source)
        maps = self.maps(torch.cat([source, destination]))
        # The three outputs: dense descriptors, scores and, of the source, keypoint locations.
        dense = dense_descriptors(maps)
        scores = torch.ones_like(dense[:, :1]) if self.scores is None else self.scores(maps).sigmoid()
        if self.locations is None:
            points = cell_centres(settings.side, settings.cells, like=dense).expand(count, -1, -1)
        else:
            logits = self.locations(tuple(each[:count] for each in maps))
            points = keypoint_locations(logits, settings.cells)
        # Descriptors and scores at keypoints, and their matches in the destination.
        descriptors = unit(sampled(dense[:count], points))
        matched = matched_locations(descriptors, unit(dense[count:], dim=1), temperature=settings.temperature)
        similarity = (descriptors * unit(sampled(dense[count:], matched))).sum(-1)
        weights = match_weights(
            similarity, sampled(scores[:count], points)[..., 0], sampled(scores[count:], matched)[..., 0]
        )
        points_m, matched_m = (
            metres_of_pixels(each, size=settings.side, pixel_m=settings.image.pixel_m)
            for each in (points, matched)
        )
        matches = Matches(source_m=points_m, destination_m=matched_m, weights=weights)
        return weighted_pose(points_m, matched_m, weights), matches

    def embedding(self, images: Tensor) -> Tensor:
        """Describe places by the maximum of each dense descriptor over all locations (III-D).

        Args:
            images: Images (B, 1, size, size).

        Returns:
            Descriptions (B, 248).
        """
        return dense_descriptors(self.maps(images)).amax((2, 3))
