"""A picture to be searched: the encoder's maps, and what searches make of them, on a grid of samples.

The grid has a sample on every pixel or, at a stride of 2, one between every four. The finest map is averaged
there; coarser ones are resized bilinearly with pixels as areas, to which a sample is f-th of a pixel wide.
"""

from dataclasses import dataclass
from functools import cached_property

import torch
from torch import Tensor
from torch.nn.functional import avg_pool2d

from echoscape.learn.model.keypoint_model import MIN_NORM, Maps, sampled, unit
from echoscape.learn.model.ops.bilinear import resized, squared_lengths

STRIDES = (1, 2)


@dataclass(frozen=True, kw_only=True)
class Layer:
    """Maps (B, C, h, w) of one resolution; factor: samples that a pixel of them is wide."""

    values: Tensor
    factor: int


@dataclass(frozen=True, kw_only=True)
class FeaturePyramid:
    """B pictures by the encoder's maps, finest first (B, C, h, w).

    stride: pixels that a sample is wide; dtype: of dense descriptors and the large products with them, None
    for that of the maps. What is made of the maps is made when it is first asked for, and kept, with its
    gradients if these are asked for then.

    Raises:
        ValueError: the stride is none of `STRIDES`.
    """

    maps: Maps
    stride: int = 1
    dtype: torch.dtype | None = None

    def __post_init__(self) -> None:
        if self.stride not in STRIDES:
            raise ValueError(f"stride must be one of {STRIDES}, got {self.stride}")

    @property
    def shape(self) -> tuple[int, int]:
        """Rows and columns of samples."""
        rows, columns = self.maps[0].shape[-2:]
        return rows // self.stride, columns // self.stride

    @cached_property
    def layers(self) -> tuple[Layer, ...]:
        """The maps by resolution, finest first; those that are as fine as each other are one layer."""
        if self.stride == 1:
            return tuple(Layer(values=each, factor=2**level) for level, each in enumerate(self.maps))
        finest = torch.cat([avg_pool2d(self.maps[0], 2), *self.maps[1:2]], 1)
        coarser = (Layer(values=each, factor=2**level) for level, each in enumerate(self.maps[2:], 1))
        return (Layer(values=finest, factor=1), *coarser)

    @cached_property
    def lengths(self) -> Tensor:
        """Lengths (B, rows, columns) of the descriptors, at least `MIN_NORM`."""
        squares = [squared_lengths(each.values, each.factor) for each in self.layers]
        return torch.stack(squares).sum(0).clamp(min=0).sqrt().clamp(min=MIN_NORM)

    @cached_property
    def stacked(self) -> Tensor:
        """The dense descriptors (B, 248, rows * columns) in `dtype`, not of unit length."""
        dtype = self.dtype or self.maps[0].dtype
        return torch.cat([resized(each.values.to(dtype), each.factor).flatten(2) for each in self.layers], 1)

    def descriptors(self) -> Tensor:
        """Return the dense descriptors (B, 248, rows, columns) of unit length."""
        return unit(self.stacked, dim=1).unflatten(2, self.shape)

    def similarity(self, queries: Tensor, places_px: Tensor) -> Tensor:
        """Return (B, N): the cosine of queries (B, N, 248) at places (B, N, 2) row, column [px].

        Interpolated bilinearly between the cosines of the samples, the outermost of which go on outside.
        """
        last = places_px.new_tensor(self.shape) - 1
        places = ((places_px + 0.5) / self.stride - 0.5).clamp(min=0).minimum(last)
        corner = places.detach().floor()
        down, right = (places - corner).unbind(-1)
        total = torch.zeros_like(down)
        for row, shares_down in enumerate((1 - down, down)):
            for column, shares_right in enumerate((1 - right, right)):
                sample = (corner + corner.new_tensor([row, column])).minimum(last)
                total = total + shares_down * shares_right * (queries * self._at_samples(sample)).sum(-1)
        return total

    def _at_samples(self, samples: Tensor) -> Tensor:
        """Return the descriptors (B, N, 248) of unit length at samples (B, N, 2) row, column."""
        found = [sampled(each.values, (samples + 0.5) / each.factor - 0.5) for each in self.layers]
        return unit(torch.cat(found, -1))
