"""Coordinates of the model's images: (row, column) in pixels and (forward, right) in metres.

Source: docs/conventions.md; forward is up, right is right, the radar is at the centre of the square image,
between the four central pixels if the size is even. Whole numbers are the centres of pixels.
"""

import torch
from torch import Tensor


def metres_of_pixels(points_px: Tensor, *, size: int, pixel_m: float) -> Tensor:
    """Convert pixels to metres.

    forward = ((size - 1) / 2 - row) pixel_m, right = (column - (size - 1) / 2) pixel_m.

    Args:
        points_px: Points (..., 2): row, column [px].
        size: Pixels a side of the image.
        pixel_m: Width of a pixel [m].

    Returns:
        The points (..., 2): forward, right [m].
    """
    middle = (size - 1) / 2
    return torch.stack([middle - points_px[..., 0], points_px[..., 1] - middle], -1) * pixel_m


def pixels_of_metres(points_m: Tensor, *, size: int, pixel_m: float) -> Tensor:
    """Convert metres to pixels, the inverse of `metres_of_pixels`.

    Args:
        points_m: Points (..., 2): forward, right [m].
        size: Pixels a side of the image.
        pixel_m: Width of a pixel [m].

    Returns:
        The points (..., 2): row, column [px].
    """
    middle = (size - 1) / 2
    return torch.stack([middle - points_m[..., 0] / pixel_m, middle + points_m[..., 1] / pixel_m], -1)
