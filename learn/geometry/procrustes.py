"""The rigid motion that fits matched points: weighted least squares, in closed form, and its robust form.

Source: Barnes & Posner 2020, section III-C, after Umeyama 1991, whose singular value decomposition
(`learn.model.keypoint_model.weighted_pose`) has a closed form in the plane: the angle is atan2(sum of cross
products, sum of dot products); its gradient is exact where that of the decomposition is ill-conditioned.
"""

from dataclasses import dataclass

import torch
from torch import Tensor

ROBUST_SCALE_PX = 1.0
"""Scale of the robust weights, in pixels; of 0.35 to 2.5 the best on held-out towns, by little."""

_SMALLEST_SUM = 1e-12


@dataclass(frozen=True, kw_only=True)
class Motion:
    """Poses of B sources in the frames of their destinations, T_destination_source, in Oxford axes.

    A point p of the source (forward, right) [m] is at rotation @ p + translation_m in the destination's
    frame.

    Attributes:
        rotation: Rotations (B, 2, 2).
        translation_m: Translations (B, 2): forward, right [m].
        certain: Whether the points determine the motion (B,) bool; otherwise the rotation is 1.
    """

    rotation: Tensor
    translation_m: Tensor
    certain: Tensor

    @property
    def yaw_rad(self) -> Tensor:
        """Angle (B,) of the rotation, clockwise seen from above [rad]."""
        return torch.atan2(self.rotation[:, 1, 0], self.rotation[:, 0, 0])


def motion_of_matches(source_m: Tensor, destination_m: Tensor, weights: Tensor) -> Motion:
    """Minimise the sum of w |R source + t - destination|^2.

    With s and d about their weighted centroids, the angle of R is atan2(sum w s x d, sum w s . d) and
    t = mean(d) - R mean(s). Where both sums vanish R is 1, without gradient; without any weight t is 0.

    Args:
        source_m: Points (B, N, 2): forward, right [m].
        destination_m: Points (B, N, 2) [m].
        weights: Weights w (B, N), 0 or more; their scale does not matter.

    Returns:
        The motions T_destination_source.

    Raises:
        ValueError: The shapes do not fit.
    """
    if source_m.shape != destination_m.shape or source_m.shape != (*weights.shape, 2):
        shapes = f"{tuple(source_m.shape)}, {tuple(destination_m.shape)} and {tuple(weights.shape)}"
        raise ValueError(f"points must be (B, N, 2) twice and weights (B, N), got {shapes}")
    share = shares(weights)[..., None]
    source_mean, destination_mean = (share * source_m).sum(1), (share * destination_m).sum(1)
    source, destination = source_m - source_mean[:, None], destination_m - destination_mean[:, None]
    dot = (share * source * destination).sum((1, 2))
    cross = (share[..., 0] * _cross(source, destination)).sum(1)
    spread = _spread(share, source) + _spread(share, destination)
    rounding = torch.finfo(dot.dtype).eps ** 2 * (_spread(share, source_m) + _spread(share, destination_m))
    rotation, certain = _rotation(dot, cross, spread, rounding)
    moved_mean = (rotation @ source_mean[..., None])[..., 0]
    return Motion(rotation=rotation, translation_m=destination_mean - moved_mean, certain=certain)


def robust_motion(source_m: Tensor, destination_m: Tensor, weights: Tensor, *, scale_m: float) -> Motion:
    """Solve for the motion that fits matches some of which are wrong.

    Iteratively reweighted least squares with the Geman-McClure weight 1 / (1 + e^2 / c^2)^2 of a match with
    residual e; c is halved from 32 scale_m to scale_m (graduated non-convexity, Yang et al., RA-L 2020), so
    that outliers close together do not fix the first answer. `certain` is that of all matches.

    Args:
        source_m: Points (B, N, 2): forward, right [m].
        destination_m: Points (B, N, 2) [m].
        weights: Weights (B, N), 0 or more.
        scale_m: Residual from which a match loses weight [m].

    Returns:
        The motions T_destination_source.
    """
    motion = motion_of_matches(source_m, destination_m, weights)
    certain = motion.certain
    for part in (32, 16, 8, 4, 2, 1, 1, 1):
        off = residuals_m(source_m, destination_m, motion) / (part * scale_m)
        motion = motion_of_matches(source_m, destination_m, weights / (1 + off**2) ** 2)
    return Motion(rotation=motion.rotation, translation_m=motion.translation_m, certain=certain)


def residuals_m(source_m: Tensor, destination_m: Tensor, motion: Motion) -> Tensor:
    """Compute the distances of destinations from where a motion takes their sources.

    Args:
        source_m: Points (B, N, 2): forward, right [m].
        destination_m: Points (B, N, 2) [m].
        motion: The motions T_destination_source.

    Returns:
        Distances (B, N) [m].
    """
    return torch.linalg.vector_norm(destination_m - moved(source_m, motion), dim=-1)


def moved(points_m: Tensor, motion: Motion) -> Tensor:
    """Map points by a motion.

    Args:
        points_m: Points (B, N, 2) in the frames of the sources: forward, right [m].
        motion: The motions T_destination_source.

    Returns:
        The points (B, N, 2) in the frames of the destinations [m].
    """
    return points_m @ motion.rotation.transpose(1, 2) + motion.translation_m[:, None]


def rotation_of_yaw(yaw_rad: Tensor) -> Tensor:
    """Build rotations from angles.

    Args:
        yaw_rad: Angles (B,), clockwise from forward to right [rad].

    Returns:
        Rotations (B, 2, 2).
    """
    cosine, sine = yaw_rad.cos(), yaw_rad.sin()
    return torch.stack([cosine, -sine, sine, cosine], -1).unflatten(-1, (2, 2))


def _cross(first: Tensor, second: Tensor) -> Tensor:
    return first[..., 0] * second[..., 1] - first[..., 1] * second[..., 0]


def shares(weights: Tensor) -> Tensor:
    """Normalise weights to a sum of 1.

    Args:
        weights: Weights (B, N), 0 or more, however small.

    Returns:
        The normalised weights (B, N); 0 without any weight.
    """
    largest = weights.detach().amax(1, keepdim=True)
    scaled = weights / torch.where(largest > 0, largest, torch.ones_like(largest))
    return scaled / scaled.sum(1, keepdim=True).clamp(min=_SMALLEST_SUM)


def _spread(share: Tensor, points: Tensor) -> Tensor:
    """Return (B,) the weighted mean square of points: their variance, if they are about their centroid."""
    return (share * points.detach() ** 2).sum((1, 2)).detach()


def _rotation(dot: Tensor, cross: Tensor, spread: Tensor, rounding: Tensor) -> tuple[Tensor, Tensor]:
    """Return the rotations (B, 2, 2) of (dot, cross), and whether each is determined beyond rounding.

    spread: of the points about their centroids; rounding: what it may be by rounding alone [m^2].
    """
    certain = torch.hypot(dot, cross).detach() > 8 * torch.finfo(dot.dtype).eps * spread + 64 * rounding
    dot = torch.where(certain, dot, torch.ones_like(dot))
    cross = torch.where(certain, cross, torch.zeros_like(cross))
    return rotation_of_yaw(torch.atan2(cross, dot)), certain
