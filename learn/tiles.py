"""Resizing as matrices: on a tile of a picture, every map is a small patch times a constant matrix.

Bilinear resizing by 2^l takes each tile of the picture from the patch of map l that lies under it and one
sample around, by the same weights for every tile (`align_corners=False`; at the picture's edge the outermost
samples are repeated). Where a patch has fewer samples than the map has channels, correlations with the patch
are resized in place of the descriptors: the sum over channels and the resizing are both linear and commute.
"""

from dataclasses import dataclass
from functools import lru_cache

import torch
from torch import Tensor
from torch.nn.functional import avg_pool2d, pad

from echoscape.learn.unet import Maps

_TILE_PX = 16
"""Side of a tile in pixels of the picture: one sample of the coarsest map."""


@dataclass(frozen=True, kw_only=True)
class Layer:
    """A map prepared for tiles: `values` (C, h, w) with its border repeated unless factor is 1.

    factor: how many samples of the picture a sample of the map is wide; side: of a tile in samples of the
    picture; step, patch: of a tile's patch in samples of the map.
    """

    values: Tensor
    factor: int
    side: int

    @property
    def step(self) -> int:
        """Samples from one tile's patch to the next."""
        return self.side // self.factor

    @property
    def patch(self) -> int:
        """Samples a side of a tile's patch."""
        return self.step if self.factor == 1 else self.step + 2

    @property
    def narrow(self) -> bool:
        """Whether correlations are cheaper to resize than channels."""
        return self.factor > 1 and self.patch**2 < self.values.shape[0]

    def weights(self) -> Tensor | None:
        """Return the matrix (patch^2, side^2) that resizes a patch, None where nothing is resized."""
        return None if self.factor == 1 else resizing(self.factor, self.side).to(self.values)

    def patches(self, rows: Tensor) -> Tensor:
        """Return (tiles, C, patch^2) of a row of tiles, from its `rows` (C, patch, w)."""
        cut = rows.unfold(2, self.patch, self.step)  # (C, patch, tiles, patch)
        return cut.permute(2, 0, 1, 3).reshape(cut.shape[2], rows.shape[0], -1)


def layers(maps: Maps, stride: int) -> list[Layer]:
    """Return the maps of one picture, each (C, h, w), for a picture sampled at every `stride`-th pixel.

    Samples then stand in the middle of stride x stride pixels; finer maps are averaged there, which is their
    bilinear interpolation for a stride of 2.
    """
    found = []
    for level, values in enumerate(maps):
        width = 2**level
        if width < stride:
            values, width = avg_pool2d(values[None], stride // width)[0], stride
        if width > stride:
            values = pad(values[None], (1, 1, 1, 1), mode="replicate")[0]
        found.append(Layer(values=values, factor=width // stride, side=_TILE_PX // stride))
    return found


@lru_cache
@torch.inference_mode(False)  # kept: what inference asks for first must serve training as well
def resizing(factor: int, side: int) -> Tensor:
    """Return (patch^2, side^2) float32: what each sample of a patch adds to each sample of a tile."""
    place = (torch.arange(side) + 0.5) / factor + 0.5  # in the patch, whose sample 0 lies around the tile
    distance = (place[None, :] - torch.arange(side // factor + 2)[:, None]).abs()
    line = (1 - distance).clamp(min=0)
    return torch.kron(line, line)
