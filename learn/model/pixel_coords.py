"""Coordinates of the model's images: (row, column) in pixels and (forward, right) in metres.

Source: docs/conventions.md; forward is up, right is right, the radar is at the centre of the square image,
between the four central pixels if the size is even. Whole numbers are the centres of pixels.
"""

import torch
from torch import Tensor
from torch.nn.functional import grid_sample


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


def pixel_grid(rows: int, columns: int, *, like: Tensor) -> Tensor:
    """List all pixels of an image, row by row.

    Args:
        rows: Rows of the image.
        columns: Columns of the image.
        like: A tensor of the wanted type and device.

    Returns:
        Points (rows * columns, 2): row, column [px].
    """
    axes = [torch.arange(count, dtype=like.dtype, device=like.device) for count in (rows, columns)]
    return torch.stack(torch.meshgrid(*axes, indexing="ij"), -1).reshape(-1, 2)


def cell_centres(size: int, cells: int, *, like: Tensor) -> Tensor:
    """List the centres of the cells of a square image, row by row.

    Args:
        size: Pixels a side of the image.
        cells: Cells a side.
        like: A tensor of the wanted type and device.

    Returns:
        Points (cells^2, 2): row, column [px].
    """
    return (pixel_grid(cells, cells, like=like) + 0.5) * (size / cells) - 0.5


def sampled(values: Tensor, points_px: Tensor) -> Tensor:
    """Sample maps bilinearly, edges repeated.

    Args:
        values: Maps (B, C, H, W).
        points_px: Points (B, N, 2): row, column [px].

    Returns:
        Values at the points (B, N, C).
    """
    size = torch.tensor(values.shape[-2:], dtype=points_px.dtype, device=points_px.device)
    grid = ((points_px + 0.5) * (2 / size) - 1).flip(-1)[:, None].to(values.dtype)
    found = grid_sample(values, grid, mode="bilinear", padding_mode="border", align_corners=False)
    return found[:, :, 0].transpose(1, 2)
