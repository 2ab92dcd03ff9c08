"""Bilinear interpolation as sums over pixels: which pixels share in a place, and what maps are there.

Pixels are areas (`align_corners=False`), and the outermost ones extend outwards.
"""

from torch import Tensor, arange


def shares_of_places(places: Tensor, pixels: Tensor) -> Tensor:
    """Compute the bilinear weights of pixels at places between them, along one side.

    Args:
        places: Places (..., S) [px].
        pixels: Pixels (..., P) [px].

    Returns:
        Weights (..., S, P): max(0, 1 - |place - pixel|).
    """
    return (1 - (places[..., :, None] - pixels[..., None, :]).abs()).clamp(min=0)


def pixels_taken(values: Tensor, pixels: Tensor) -> Tensor:
    """Read maps where rows and columns cross.

    Places that are not finite are taken as 0; the weights computed from them are not finite either, so that
    the result shows it.

    Args:
        values: Maps (B, C, H, W).
        pixels: S rows and S columns for each of N points (B, N, 2, S), whole numbers inside the maps.

    Returns:
        Values (B, N, S^2, C).
    """
    batch, channels, height, width = values.shape
    by_pixel = values.permute(0, 2, 3, 1).reshape(-1, channels)
    first = arange(batch, device=values.device)[:, None, None, None] * (height * width)
    rows, columns = pixels.nan_to_num(0.0).long().unbind(2)
    index = first + rows[..., None] * width + columns[..., None, :]
    return by_pixel.index_select(0, index.flatten()).view(*index.shape[:2], -1, channels)
