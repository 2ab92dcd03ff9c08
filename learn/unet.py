"""The network: an encoder of five blocks and two decoders, for where keypoints are and how far to trust them.

Source: Barnes & Posner 2020, section III-A and figure 2: blocks of 8, 16, 32, 64 and 128 channels, max-pool
between them, bilinear upsampling with concatenated skips, and a pointwise convolution to one channel without
activation. A block is two 3 x 3 convolutions, each with batch normalisation and ReLU.
"""

import torch
from torch import Tensor, nn
from torch.nn.functional import interpolate, max_pool2d

CHANNELS = (8, 16, 32, 64, 128)
"""Channels of the encoder's blocks; together the 248 of a descriptor."""

_MOMENTUM = 0.01
"""Share of a step in the running mean and variance: a step sees one pair, and scenes differ."""

Maps = tuple[Tensor, ...]
"""The encoder's outputs, finest first: map l is (B, CHANNELS[l], H / 2^l, W / 2^l)."""


def block(inputs: int, outputs: int) -> nn.Sequential:
    """Return two 3 x 3 convolutions, each with batch normalisation and ReLU."""
    layers: list[nn.Module] = []
    for channels in (inputs, outputs):
        layers += [nn.Conv2d(channels, outputs, 3, padding=1, bias=False)]
        layers += [nn.BatchNorm2d(outputs, momentum=_MOMENTUM), nn.ReLU(inplace=True)]
    return nn.Sequential(*layers)


class Encoder(nn.Module):
    """Pictures to maps of ever coarser resolution."""

    def __init__(self) -> None:
        super().__init__()
        self.blocks = nn.ModuleList(map(block, (1, *CHANNELS[:-1]), CHANNELS))

    def forward(self, images: Tensor) -> Maps:
        """Return the maps of images (B, 1, H, W) float32; H and W are multiples of 16."""
        maps: list[Tensor] = []
        for layer in self.blocks:
            maps.append(layer(max_pool2d(maps[-1], 2) if maps else images))
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
            wide = interpolate(coarse, scale_factor=2, mode="bilinear", align_corners=False)
            coarse = layer(torch.cat([wide, fine], 1))
        return self.head(coarse)
