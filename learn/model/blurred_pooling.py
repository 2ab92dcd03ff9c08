"""Pooling that hides small shifts less than the maxima of the paper: an option of this project.

Source: Zhang, "Making convolutional networks shift-invariant again", ICML 2019.
"""

from torch import Tensor
from torch.nn.functional import avg_pool2d, max_pool2d, pad


def blurred_max_pool(values: Tensor) -> Tensor:
    """Halve maps by maxima that are low-passed by 1-2-1 before subsampling.

    Small motions are underestimated less than with the paper's max pooling, which hides shifts within a pool.

    Args:
        values: Maps (B, C, H, W), H and W even.

    Returns:
        Maps (B, C, H / 2, W / 2).
    """
    padded = pad(values, (1, 1, 1, 1), mode="replicate")
    return avg_pool2d(avg_pool2d(max_pool2d(padded, 2, stride=1), 2, stride=1), 2)
