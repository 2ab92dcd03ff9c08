"""The network: an encoder of five blocks and two decoders, for where keypoints are and how far to trust them.

Source: Barnes & Posner 2020, section III-A and figure 2: blocks of 8, 16, 32, 64 and 128 channels, max-pool
between them, bilinear upsampling with concatenated skips, and a pointwise convolution to one channel without
activation. A block is two 3 x 3 convolutions, each with batch normalisation and ReLU.
"""

from functools import partial
from typing import Literal

import torch
from torch import Tensor, nn
from torch.nn.functional import avg_pool2d, interpolate, max_pool2d, pad

from echoscape.learn.model.ops.batch_norm import BatchNorm
from echoscape.learn.model.ops.channels_last import with_gradient_by_pixel
from echoscape.learn.model.ops.inference import blurred_maxima, upsampled_above

CHANNELS = (8, 16, 32, 64, 128)
"""Channels of the encoder's blocks; together the 248 of a descriptor."""

_MOMENTUM = 0.01
"""Share of a step in the running mean and variance: a step sees one pair, and scenes differ."""

Pooling = Literal["max", "blurred"]
"""How the encoder halves its maps: by plain maxima, as in the paper, or by `blurred_max_pool`."""

Maps = tuple[Tensor, ...]
"""The encoder's outputs, finest first: map l is (B, CHANNELS[l], H / 2^l, W / 2^l)."""


def block(inputs: int, outputs: int) -> nn.Sequential:
    """Return two 3 x 3 convolutions, each with batch normalisation and ReLU."""
    layers: list[nn.Module] = []
    for channels in (inputs, outputs):
        layers += [nn.Conv2d(channels, outputs, 3, padding=1, bias=False)]
        layers += [BatchNorm(outputs, momentum=_MOMENTUM), nn.ReLU(inplace=True)]
    return nn.Sequential(*layers)


def blurred_max_pool(values: Tensor) -> Tensor:
    """Return (B, C, H / 2, W / 2): maxima of 2 x 2, low-passed by 1-2-1 before every second is taken.

    Plain max-pooling gives the same when things move within a pool, so that what moved by a pixel or two
    looks most alike where it has been. Sample j stays at 2 j + 1/2; edges go on. Source: Zhang, Making
    convolutional networks shift-invariant again, ICML 2019.
    """
    if not values.requires_grad:
        return blurred_maxima(values)
    wide = pad(values, (1, 1, 1, 1), mode="replicate")
    return avg_pool2d(avg_pool2d(max_pool2d(wide, 2, stride=1), 2, stride=1), 2)


class Encoder(nn.Module):
    """Pictures to maps of ever coarser resolution."""

    def __init__(self, pooling: Pooling = "max") -> None:
        super().__init__()
        self._pooled = blurred_max_pool if pooling == "blurred" else partial(max_pool2d, kernel_size=2)
        self.blocks = nn.ModuleList(map(block, (1, *CHANNELS[:-1]), CHANNELS))

    def forward(self, images: Tensor) -> Maps:
        """Return the maps of images (B, 1, H, W) float32; H and W are multiples of 16."""
        maps: list[Tensor] = []
        for layer in self.blocks:
            maps.append(layer(self._pooled(maps[-1]) if maps else images))
        return tuple(maps)


class Decoder(nn.Module):
    """Maps to one number a pixel."""

    def __init__(self) -> None:
        super().__init__()
        pairs = zip(CHANNELS[1:], CHANNELS[:-1], strict=True)
        self.blocks = nn.ModuleList([block(coarse + fine, fine) for coarse, fine in pairs])
        self.head = nn.Conv2d(CHANNELS[0], 1, 1)

    def forward(self, maps: Maps) -> Tensor:
        """Return (B, 1, H, W), unbounded."""
        coarse = maps[-1]
        for fine, layer in zip(maps[-2::-1], list(self.blocks)[::-1], strict=True):
            coarse = layer(_upsampled_above(coarse, fine))
        return self.head(coarse)


def _upsampled_above(coarse: Tensor, fine: Tensor) -> Tensor:
    """Return (B, C + F, 2 H, 2 W): maps (B, C, H, W) upsampled bilinearly, and finer ones."""
    if not coarse.requires_grad:
        return upsampled_above(coarse, fine)
    wide = interpolate(coarse, scale_factor=2, mode="bilinear", align_corners=False)
    return torch.cat([with_gradient_by_pixel(wide), fine], 1)
