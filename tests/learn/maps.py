"""Encoder maps and images for tests, of random numbers: no network is trained."""

import torch
from torch import Tensor

from echoscape.learn.model.keypoint_model import CHANNELS, Maps


def drawn_maps(size: int, *, seed: int = 1, dtype: torch.dtype = torch.float32, batch: int = 1) -> Maps:
    """Return maps of an image of `size` pixels, of random numbers of 0 and more."""
    draws = torch.Generator().manual_seed(seed)
    shapes = [(batch, count, size >> level, size >> level) for level, count in enumerate(CHANNELS)]
    return tuple(torch.randn(shape, generator=draws, dtype=dtype).relu() for shape in shapes)


def oblong_maps(rows: int, columns: int, *, batch: int = 2) -> Maps:
    """Return maps in float64 of images that differ and are not square."""
    maps = drawn_maps(max(rows, columns), dtype=torch.float64, batch=batch)
    return tuple(each[:, :, : rows >> level, : columns >> level] for level, each in enumerate(maps))


def drawn_points(count: int, size: int, *, seed: int = 2, dtype: torch.dtype = torch.float32) -> Tensor:
    """Return points (1, count, 2) inside an image."""
    draws = torch.Generator().manual_seed(seed)
    return torch.rand((1, count, 2), generator=draws, dtype=dtype) * (size - 1)
