"""How a polar scan becomes the image that the model takes: resolution, size and the range that is left out.

Source: Barnes & Posner 2020, section IV (Cartesian images of 0.3456 or 0.6912 m a pixel). Imports no PyTorch,
so that the command line can list the settings without it.
"""

import math
from dataclasses import dataclass


@dataclass(frozen=True, kw_only=True)
class ImageSettings:
    """How a scan becomes an image.

    Attributes:
        pixel_m: Width of a pixel [m].
        size: Pixels a side, even.
        near_m: Range below which the image is empty, where leakage and the car itself are [m].
    """

    pixel_m: float = 0.6912
    size: int = 320
    near_m: float = 3.0

    def __post_init__(self) -> None:
        if not (math.isfinite(self.pixel_m) and self.pixel_m > 0):
            raise ValueError(f"pixel_m must be finite and above 0, got {self.pixel_m}")
        if self.size < 16 or self.size % 2:
            raise ValueError(f"size must be even and 16 or more, got {self.size}")
        if not (math.isfinite(self.near_m) and self.near_m >= 0):
            raise ValueError(f"near_m must be finite and 0 or more, got {self.near_m}")

    @property
    def cell_m(self) -> float:
        """Length of a range cell [m]."""
        return self.pixel_m / 2

    @property
    def cells(self) -> int:
        """Range cells that reach the corners of the image, at any heading."""
        return math.ceil(math.sqrt(2) * self.size) + 1
