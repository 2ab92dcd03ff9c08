"""The motion that fits matches whose precision depends on direction: along a wall low, across it high.

Source: Gauss-Newton over SE(2) with residuals weighted by direction, as in Segal et al., "Generalized-ICP",
RSS 2009.
"""

import torch
from torch import Tensor

from echoscape.learn.geometry.procrustes import (
    Motion,
    motion_of_matches,
    moved,
    robust_motion,
    rotation_of_yaw,
)

_SCALES = (4, 2, 1, 1, 1)
"""Factors of the residuals' scale, one per iteration."""
_LEAST_EIGENVALUE = 1e-9
"""Smallest eigenvalue of the normal matrix, scaled to a diagonal of 1, from which a motion is determined."""


def turned_precision(precision: Tensor, rotation: Tensor) -> Tensor:
    """Rotate precisions: R P R^T.

    Args:
        precision: Precisions (B, N, 2, 2).
        rotation: Rotations (B, 2, 2).

    Returns:
        The precisions (B, N, 2, 2) in the rotated frame.
    """
    return rotation[:, None] @ precision @ rotation[:, None].transpose(-1, -2)


def motion_by_precision(
    source_m: Tensor,
    destination_m: Tensor,
    weights: Tensor,
    precision: Tensor,
    *,
    scale_m: float | None,
    near: Motion | None = None,
) -> Motion:
    """Minimise the sum of w rho(r^T P r) over motions, r = destination - R source - t.

    Gauss-Newton from `robust_motion`, with rho of Geman-McClure at `scale_m`, wider in the first iterations.
    Where the matches leave a direction undetermined, or are not finite, the motion is the first one and not
    `certain`.

    Args:
        source_m: Points (B, N, 2) of the sources: forward, right [m].
        destination_m: Points (B, N, 2) of the destinations [m].
        weights: Weights w (B, N).
        precision: Precisions P (B, N, 2, 2) in the frames of the destinations: forward, right.
        scale_m: Scale of rho [m]; None for squares, rho(x) = x.
        near: Motion to start from, nearly the answer; then rho has its scale from the first iteration.

    Returns:
        The motions T_destination_source.
    """
    start = near or _begun(source_m, destination_m, weights, scale_m)
    source_m, destination_m = source_m.double(), destination_m.double()
    weights, precision = weights.double(), precision.double()
    yaw, shift_m = start.yaw_rad.double(), start.translation_m.double()
    certain = start.certain
    for part in _SCALES if near is None else (1, 1):
        motion = Motion(rotation=rotation_of_yaw(yaw), translation_m=shift_m, certain=certain)
        off = destination_m - moved(source_m, motion)
        share = weights
        if scale_m is not None:
            share = weights / (1 + weighed_squares(off, precision) / (part * scale_m) ** 2) ** 2
        turned_m = source_m @ motion.rotation.transpose(1, 2)
        step, known = _step(off, turned_m, precision, share)
        certain = certain & known
        yaw, shift_m = yaw + step[:, 0], shift_m + step[:, 1:]
    found = torch.cat([shift_m, yaw[:, None]], 1)
    begun = torch.cat([start.translation_m, start.yaw_rad[:, None]], 1).double()
    found = torch.where(certain[:, None], found, begun).to(start.translation_m.dtype)
    return Motion(rotation=rotation_of_yaw(found[:, 2]), translation_m=found[:, :2], certain=certain)


def _begun(source_m: Tensor, destination_m: Tensor, weights: Tensor, scale_m: float | None) -> Motion:
    if scale_m is None:
        return motion_of_matches(source_m, destination_m, weights)
    return robust_motion(source_m, destination_m, weights, scale_m=scale_m)


def weighed_squares(off_m: Tensor, precision: Tensor) -> Tensor:
    """Compute r^T P r.

    Args:
        off_m: Residuals r (..., N, 2) [m].
        precision: Precisions P (..., N, 2, 2).

    Returns:
        The weighted squares (..., N) [m^2].
    """
    return (off_m * _by_direction(precision, off_m)).sum(-1)


def _by_direction(precision: Tensor, vectors: Tensor) -> Tensor:
    """Return (..., 2): precisions (..., 2, 2), which are symmetric, times vectors (..., 2)."""
    return precision[..., 0, :] * vectors[..., :1] + precision[..., 1, :] * vectors[..., 1:]


def _step(off_m: Tensor, turned_m: Tensor, precision: Tensor, share: Tensor) -> tuple[Tensor, Tensor]:
    """Return the Gauss-Newton step (B, 3) of yaw and translation, and whether it is determined.

    A small rotation a moves a rotated source p by a j, j = (-p_right, p_forward): linear least squares in
    three unknowns, of residuals r with weights s and precisions P. The normal matrix has the sums of s j^T P
    j, of s P j and of s P; the right-hand side those of s j^T P r and of s P r. The matrix is scaled to a
    diagonal of 1, so that units do not decide what is determined.
    """
    turning = torch.stack([-turned_m[..., 1], turned_m[..., 0]], -1)
    by_turn, wanted_shift = _by_direction(precision, turning), _by_direction(precision, off_m)
    of_turns = torch.stack([(turning * by_turn).sum(-1), (turning * wanted_shift).sum(-1)], -1)
    terms = torch.cat([of_turns, by_turn, wanted_shift, precision.flatten(-2)], -1)  # (B, N, 10)
    turn, wanted_turn, by_turn, wanted_shift, by_shift = (share[:, None] @ terms)[:, 0].split(
        [1, 1, 2, 2, 4], -1
    )
    upper = torch.cat([turn, by_turn], -1)[:, None]
    lower = torch.cat([by_turn[..., None], by_shift.unflatten(-1, (2, 2))], -1)
    normal, wanted = torch.cat([upper, lower], 1), torch.cat([wanted_turn, wanted_shift], -1)[..., None]
    size = normal.diagonal(dim1=1, dim2=2).clamp(min=torch.finfo(off_m.dtype).tiny).sqrt()
    balanced = normal / size[:, :, None] / size[:, None, :]
    finite = balanced.isfinite().all((1, 2)) & wanted.isfinite().all((1, 2))
    balanced = torch.where(finite[:, None, None], balanced, torch.zeros(3, 3).to(balanced))
    known = torch.linalg.eigvalsh(balanced)[:, 0] > _LEAST_EIGENVALUE
    balanced = torch.where(known[:, None, None], balanced, torch.eye(3).to(balanced))
    step = torch.linalg.solve(balanced, wanted / size[:, :, None])[..., 0] / size
    return torch.where(known[:, None], step, 0.0), known
