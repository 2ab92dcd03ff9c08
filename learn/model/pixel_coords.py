"""Where a pixel of a model's picture lies: points are (row, column) in pixels, or (forward, right) in metres.

Source: docs/conventions.md; forward is up, right is right, the radar in the middle of the square picture,
between its middle pixels where the size is even, and whole numbers are the middles of pixels.
"""

import torch
from torch import Tensor


def metres_of_pixels(points_px: Tensor, *, size: int, pixel_m: float) -> Tensor:
    """Return (..., 2) forward, right [m] of (..., 2) row, column [px].

    forward = ((size - 1) / 2 - row) pixel_m, right = (column - (size - 1) / 2) pixel_m.
    """
    middle = (size - 1) / 2
    return torch.stack([middle - points_px[..., 0], points_px[..., 1] - middle], -1) * pixel_m


def pixels_of_metres(points_m: Tensor, *, size: int, pixel_m: float) -> Tensor:
    """Return (..., 2) row, column [px] of (..., 2) forward, right [m]: the inverse of `metres_of_pixels`."""
    middle = (size - 1) / 2
    return torch.stack([middle - points_m[..., 0] / pixel_m, middle + points_m[..., 1] / pixel_m], -1)
