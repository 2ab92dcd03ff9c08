"""Gradients lie as the network's maps do, whatever takes part in making them."""

import torch

from echoscape.learn.model.ops.channels_last import with_gradient_by_pixel


def test_values_and_gradients_are_kept_and_lie_pixel_by_pixel() -> None:
    plain = torch.rand(1, 3, 4, 5).contiguous(memory_format=torch.channels_last).requires_grad_()
    values = plain * 1
    seen: list[torch.Tensor] = []
    values.register_hook(seen.append)
    kept = with_gradient_by_pixel(values)
    assert torch.equal(kept, values)
    assert kept.stride() == values.stride()
    slope = torch.rand(1, 3, 4, 5)
    kept.backward(slope)
    assert torch.equal(seen[0], slope)
    assert seen[0].is_contiguous(memory_format=torch.channels_last)
