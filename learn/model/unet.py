"""The U-Net of `keypoint_model` with two steps that are faster on the CPU; the weights have the same names.

Source: Barnes & Posner 2020, section III-A and figure 2.
"""

import torch
from torch import Tensor
from torch.nn.functional import interpolate, max_pool2d

from echoscape.learn.model.keypoint_model import Decoder, Encoder, Maps, blurred_max_pool
from echoscape.learn.model.ops.channels_last import with_gradient_by_pixel
from echoscape.learn.model.ops.inference import blurred_maxima


class FastEncoder(Encoder):
    """Encoder of the U-Net, whose low-passed maxima are faster where no gradient is asked for."""

    def forward(self, images: Tensor) -> Maps:
        """Compute the maps of images.

        Args:
            images: Images (B, 1, H, W); H and W are multiples of 16.

        Returns:
            Five maps, finest first.
        """
        maps: list[Tensor] = []
        for layer in self.blocks:
            maps.append(layer(self._halved(maps[-1]) if maps else images))
        return tuple(maps)

    def _halved(self, values: Tensor) -> Tensor:
        if self.pooling == "max":
            return max_pool2d(values, 2)
        return blurred_max_pool(values) if values.requires_grad else blurred_maxima(values)


class FastDecoder(Decoder):
    """Decoder of the U-Net, whose upsampled maps have gradients in the memory layout of convolutions."""

    def forward(self, maps: Maps) -> Tensor:
        """Compute one number per pixel.

        Args:
            maps: Maps of the encoder, finest first.

        Returns:
            The numbers (B, 1, H, W), unbounded.
        """
        values = maps[-1]
        for fine, layer in zip(maps[-2::-1], list(self.blocks)[::-1], strict=True):
            upsampled = interpolate(values, scale_factor=2, mode="bilinear", align_corners=False)
            values = layer(torch.cat([with_gradient_by_pixel(upsampled), fine], 1))
        return self.head(values)
