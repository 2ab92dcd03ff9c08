"""Encoder maps and images for tests, drawn or ideal: no network is trained."""

import math

import numpy as np
import torch
from torch import Tensor

from echoscape.learn.model.descriptors import descriptors_at
from echoscape.learn.model.keypoint_model import CHANNELS, Maps, unit
from echoscape.learn.model.pixel_coords import pixels_of_metres


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


def drawn_search(size: int, *, dtype: torch.dtype = torch.float64, batch: int = 1) -> tuple[Tensor, Maps]:
    """Return descriptors (batch, 9, 248) and the maps that they nearly occur in, all with gradients."""
    maps = drawn_maps(size, dtype=dtype, batch=batch)
    points = drawn_points(9, size, dtype=dtype).expand(batch, -1, -1)
    noise = torch.randn((batch, 9, 248), generator=torch.Generator().manual_seed(3), dtype=dtype)
    queries = unit(descriptors_at(maps, points) + 0.03 * noise)
    return queries.requires_grad_(), tuple(each.requires_grad_() for each in maps)


def drawn_image(size: int, *, seed: int = 1) -> Tensor:
    """Return an image (1, 1, size, size) of random numbers from 0 to 1."""
    return torch.rand((1, 1, size, size), generator=torch.Generator().manual_seed(seed))


def ideal_maps(forward_m: float, right_m: float, yaw: float, *, size: int, pixel_m: float) -> Maps:
    """Return maps whose descriptors depend on the place of each pixel in the world alone."""
    offset = (torch.arange(size) - (size - 1) / 2) * pixel_m
    forward, right = -offset[:, None].expand(size, size), offset[None].expand(size, size)
    x = forward_m + math.cos(yaw) * forward - math.sin(yaw) * right
    y = right_m + math.sin(yaw) * forward + math.cos(yaw) * right
    waves = [(1.0, 0.0), (0.0, 1.0), (1.1, 1.3), (1.3, -1.1)]
    phases = [(u * x + v * y) * (2 * math.pi / 220) for u, v in waves]
    fine = torch.stack([each for phase in phases for each in (phase.cos(), phase.sin())])[None]
    coarse = [torch.zeros(1, count, size >> level, size >> level) for level, count in enumerate(CHANNELS)]
    return fine, *coarse[1:]


def inner_points(size: int, *, pixel_m: float) -> Tensor:
    """Return points (1, 60, 2) [px] within 25 m of the middle in x and in y."""
    draws = np.random.default_rng(1).uniform(-25, 25, (1, 60, 2)).astype(np.float32)
    return pixels_of_metres(torch.from_numpy(draws), size=size, pixel_m=pixel_m)
