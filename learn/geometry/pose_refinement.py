"""How much matches say by direction, and the motion that fits them: along a wall little, across it much.

Sources: information filters (Maybeck, Stochastic Models, Estimation and Control, 1979, section 5.7) for
taking an expectation out of what was found with it; Gauss-Newton over SE(2) with residuals that count by
direction as in registration by uncertainties (Segal et al., Generalized-ICP, RSS 2009).
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
"""By how much the residuals' scale is widened, round after round."""
_LEAST_EIGENVALUE = 1e-9
"""Of the normal matrix with a diagonal of 1: from here on a motion counts as known."""


def turned_precision(precision: Tensor, rotation: Tensor) -> Tensor:
    """Return (B, N, 2, 2): precisions of points that are turned by rotations (B, 2, 2)."""
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
    """Return the motion that fits matches best whose residuals count by direction.

    source_m, destination_m: (B, N, 2) [m]; weights: (B, N); precision: (B, N, 2, 2) of the destinations,
    forward and right. Begins with `robust_motion` and goes on by Gauss-Newton to the least sum of
    w rho(r^T P r), r = destination - R source - t, rho of Geman-McClure at `scale_m`, wider at first; without
    a scale rho is the square. Where the matches leave a direction open, or are not finite, `certain` is False
    and the motion the one that it began with. near: a motion to begin with that is nearly right, in place of
    the robust one, and not wider at first.
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
    """Return (..., N) [m^2]: r^T P r of residuals (..., N, 2) and precisions (..., N, 2, 2)."""
    return (off_m * _by_direction(precision, off_m)).sum(-1)


def _by_direction(precision: Tensor, vectors: Tensor) -> Tensor:
    """Return (..., 2): precisions (..., 2, 2), which are symmetric, times vectors (..., 2)."""
    return precision[..., 0, :] * vectors[..., :1] + precision[..., 1, :] * vectors[..., 1:]


def _step(off_m: Tensor, turned_m: Tensor, precision: Tensor, share: Tensor) -> tuple[Tensor, Tensor]:
    """Return the change (B, 3) of yaw and shift that takes away most of residuals, and whether it is known.

    With p a turned source, a small turn a moves it by a j, j = (-p_right, p_forward): linear least squares in
    three unknowns, of residuals r that count by share s and precision P. Its normal matrix has the sums of
    s j^T P j, of s P j, and of s P; what it is to be equal to has those of s j^T P r and of s P r. The matrix
    is divided by its diagonal, so that units do not decide what is known.
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
