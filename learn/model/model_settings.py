"""Settings of the keypoint model, stored with its weights.

Source: Barnes & Posner 2020, section III: 20 x 20 cells, a matching softmax with a temperature. Imports no
PyTorch, so that the command line can list the settings without it.
"""

import math
from dataclasses import dataclass, field
from typing import Literal, get_args

from echoscape.learn.data.image_settings import ImageSettings

Pooling = Literal["max", "blurred"]
"""How the encoder halves its maps: by maxima of 2 x 2 as in the paper, or by maxima that are low-passed."""


@dataclass(frozen=True, kw_only=True)
class ModelSettings:
    """Settings of a model, stored with its weights.

    Attributes:
        image: How scans become images.
        cells: Cells a side of the image, each with one keypoint.
        temperature: T of the matching softmax.
        location_head: Whether keypoint locations are learned; otherwise they are the centres of the cells.
        score_head: Whether scores are learned; otherwise they are 1.
        pooling: How the encoder halves its maps.
    """

    image: ImageSettings = field(default_factory=ImageSettings)
    cells: int = 20
    temperature: float = 100.0
    location_head: bool = True
    score_head: bool = True
    pooling: Pooling = "max"

    def __post_init__(self) -> None:
        if not 2 <= self.cells <= self.image.size:
            raise ValueError(f"cells must be 2 to {self.image.size}, the image's pixels, got {self.cells}")
        if self.pooling not in get_args(Pooling):
            raise ValueError(f"pooling must be one of {get_args(Pooling)}, got {self.pooling!r}")
        if not 0 < self.temperature < float("inf"):
            raise ValueError(f"temperature must be finite and above 0, got {self.temperature}")

    @property
    def side(self) -> int:
        """Pixels a side of the padded image: a multiple of 16, for four poolings, and of the cells."""
        step = math.lcm(16, self.cells)
        return step * math.ceil(self.image.size / step)
