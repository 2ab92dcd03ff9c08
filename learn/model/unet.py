"""The U-Net of `keypoint_model` with faster steps on the CPU; the weights have the same names.

Source: Barnes & Posner 2020, section III-A and figure 2.
"""

import torch
from torch import Tensor
from torch.nn.functional import interpolate, max_pool2d

from echoscape.learn.model.blurred_pooling import blurred_max_pool
from echoscape.learn.model.keypoint_model import Decoder, Encoder, Maps
from echoscape.learn.model.ops.channels_last import with_gradient_by_pixel
from echoscape.learn.model.ops.inference import blurred_maxima, upsampled_above


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
    """Decoder of the U-Net, which upsamples and concatenates in one step where no gradient is asked for."""

    def forward(self, maps: Maps) -> Tensor:
        """Compute one number per pixel.

        Args:
            maps: Maps of the encoder, finest first.

        Returns:
            The numbers (B, 1, H, W), unbounded.
        """
        values = maps[-1]
        for fine, layer in zip(maps[-2::-1], list(self.blocks)[::-1], strict=True):
            values = layer(_upsampled_above(values, fine))
        if values.dtype == torch.bfloat16:
            return self.head(values)
        weight, bias = self.head.parameters()
        return (values * weight[0]).sum(1, keepdim=True) + bias  # in float32 as `Decoder` computes it


def _upsampled_above(coarse: Tensor, fine: Tensor) -> Tensor:
    """Return (B, C + F, 2 H, 2 W): maps (B, C, H, W) upsampled bilinearly, and finer ones."""
    if not coarse.requires_grad:
        return upsampled_above(coarse, fine)
    wide = interpolate(coarse, scale_factor=2, mode="bilinear", align_corners=False)
    return torch.cat([with_gradient_by_pixel(wide), fine], 1)
