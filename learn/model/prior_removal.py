"""Removal of the search prior from a local match, and the precision of the match by direction.

Source: information filters (Maybeck, Stochastic Models, Estimation and Control, 1979, section 5.7).
"""

import torch
from torch import Tensor

from echoscape.learn.model.local_matching import Moments

_SHARPEST_PX = 0.7
"""Standard deviation of the sharpest matches [px]."""

_LEAST_SHARE = 0.1
"""Part of the prior's inverse covariance; a match that adds less in a direction has no precision there."""


def remove_prior(found: Moments, expected: Moments) -> tuple[Tensor, Tensor]:
    """Remove the prior from the posterior of a local search.

    The posterior is the likelihood times a normal prior; with both taken as normal, inverse covariances add:
    1 / v = 1 / s - 1 / e for the covariances v of the likelihood, s of the posterior and e of the prior, and
    so do the means multiplied by them. The precision is c^2 / (c^2 + v), c = 0.7 px, in each principal
    direction of v: near 1 for the sharpest matches. In directions in which the match adds nearly nothing to
    the prior it is 0, and the location is the prior's.

    Args:
        found: Moments of the posterior.
        expected: Moments of the prior over the same samples.

    Returns:
        Locations (B, N, 2) [px] and precisions (B, N, 2, 2), both by row and column.
    """
    known, before = _inverse(found.spread_px2), _inverse(expected.spread_px2)
    off = (known @ (found.places_px - expected.places_px)[..., None])[..., 0]
    direction, middle, half = _principal(known - before)
    added = torch.stack([middle + half, middle - half], -1)
    says = added > _LEAST_SHARE * before.diagonal(dim1=-2, dim2=-1).mean(-1, keepdim=True)
    variance = torch.where(says, 1 / torch.where(says, added, 1.0), 0.0)
    precision = torch.where(says, _SHARPEST_PX**2 / (_SHARPEST_PX**2 + variance), 0.0)
    own = expected.places_px + (_matrix(variance, direction) @ off[..., None])[..., 0]
    return own, _matrix(precision, direction)


def _inverse(matrix: Tensor) -> Tensor:
    """Return the inverses of symmetric matrices (..., 2, 2)."""
    (first, cross), (_, second) = (row.unbind(-1) for row in matrix.unbind(-2))
    adjugate = torch.stack([second, -cross, -cross, first], -1).unflatten(-1, (2, 2))
    return adjugate / (first * second - cross**2)[..., None, None]


def _principal(matrix: Tensor) -> tuple[Tensor, Tensor, Tensor]:
    """Return D (..., 2, 2), m and h (...) of symmetric matrices m + h D, h of 0 or more.

    D squared is 1 and its trace 0, so that the eigenvalues are m + h and m - h.
    """
    middle = matrix.diagonal(dim1=-2, dim2=-1).mean(-1)
    rest = matrix - middle[..., None, None] * torch.eye(2).to(matrix)
    half = torch.linalg.vector_norm(rest[..., 0], dim=-1)
    return rest / half.clamp(min=torch.finfo(matrix.dtype).tiny)[..., None, None], middle, half


def _matrix(values: Tensor, direction: Tensor) -> Tensor:
    """Return symmetric matrices by their eigenvalues (..., 2) for +1 and -1 of `direction`'s."""
    middle, half = values.mean(-1), (values[..., 0] - values[..., 1]) / 2
    return middle[..., None, None] * torch.eye(2).to(values) + half[..., None, None] * direction


def precision_of_pixels(precision: Tensor) -> Tensor:
    """Convert precisions from row and column to forward and right; forward is up.

    Args:
        precision: Precisions (B, N, 2, 2) by row and column.

    Returns:
        Precisions (B, N, 2, 2) by forward and right.
    """
    up = precision.new_tensor([[1.0, -1.0], [-1.0, 1.0]])
    return precision * up
