"""An image to be searched: the encoder's maps, and what searches derive from them, on a grid of samples.

Samples lie on every pixel (stride 1) or at the centre of each 2 x 2 block (stride 2). The finest map is
averaged there; coarser ones are resized bilinearly with pixels as areas, so that a sample is 1 / factor of
their pixels.
"""

from dataclasses import dataclass
from functools import cached_property

import torch
from torch import Tensor
from torch.nn.functional import avg_pool2d

from echoscape.learn.model.keypoint_model import MIN_NORM, Maps, unit
from echoscape.learn.model.ops.bilinear import resized, squared_lengths
from echoscape.learn.model.pixel_coords import sampled

STRIDES = (1, 2)


@dataclass(frozen=True, kw_only=True)
class Layer:
    """Maps of one resolution.

    Attributes:
        values: Maps (B, C, h, w).
        factor: Samples per pixel of these maps, along each side.
    """

    values: Tensor
    factor: int


@dataclass(frozen=True, kw_only=True)
class FeaturePyramid:
    """B images as the maps of the encoder. What is derived from these is computed on first use and kept.

    Attributes:
        maps: Maps (B, C, h, w), finest first.
        stride: Pixels per sample, along each side.
        dtype: Number format of the dense descriptors and of products with them; None for that of the maps.

    Raises:
        ValueError: The stride is not one of `STRIDES`.
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
        """The maps by resolution, finest first; maps of equal resolution are one layer."""
        if self.stride == 1:
            return tuple(Layer(values=each, factor=2**level) for level, each in enumerate(self.maps))
        finest = torch.cat([avg_pool2d(self.maps[0], 2), *self.maps[1:2]], 1)
        coarser = (Layer(values=each, factor=2**level) for level, each in enumerate(self.maps[2:], 1))
        return (Layer(values=finest, factor=1), *coarser)

    @cached_property
    def lengths(self) -> Tensor:
        """Lengths of the descriptors (B, rows, columns), at least `MIN_NORM`."""
        squares = [squared_lengths(each.values, each.factor) for each in self.layers]
        return torch.stack(squares).sum(0).clamp(min=0).sqrt().clamp(min=MIN_NORM)

    @cached_property
    def stacked(self) -> Tensor:
        """Dense descriptors (B, 248, rows * columns) in `dtype`, not of unit length."""
        dtype = self.dtype or self.maps[0].dtype
        return torch.cat([resized(each.values.to(dtype), each.factor).flatten(2) for each in self.layers], 1)

    def descriptors(self) -> Tensor:
        """Return the dense descriptors (B, 248, rows, columns) of unit length."""
        return unit(self.stacked, dim=1).unflatten(2, self.shape)

    def similarity(self, queries: Tensor, places_px: Tensor) -> Tensor:
        """Compute cosine similarities at given locations, interpolated bilinearly between the samples'.

        Args:
            queries: Descriptors (B, N, 248) of unit length.
            places_px: Locations (B, N, 2): row, column [px]; beyond the outermost samples, those count.

        Returns:
            The similarities (B, N).
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
