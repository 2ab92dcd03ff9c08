"""A polar scan as the picture that the model sees: codes averaged over range, from above, from 0 to about 1.

Source: Barnes & Posner 2020, section IV (Cartesian pictures of 0.3456 or 0.6912 m a pixel). A scan is first
averaged to range cells of half a pixel, which keeps noise from being picked at random and is a tenth of the
bytes; a picture at any heading then comes from the cells in one interpolation, as sharp as the one at 0.
"""

import math
from dataclasses import dataclass

import numpy as np
import torch
from numpy.typing import NDArray
from torch import Tensor
from torch.nn.functional import grid_sample, pad

from echoscape.sim.datasets.cartesian import pixel_offsets, polar_places, range_averages

CODE_OF_ONE = 128
"""The code (64 dB above one count) that becomes 1 in the picture; the strongest of real scans are 136."""


@dataclass(frozen=True, kw_only=True)
class ImageSettings:
    """How a scan becomes a picture.

    pixel_m: width of a pixel [m]; size: pixels a side, even; near_m: range below which the
    picture is empty, where leakage and the car itself are [m].
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
        """Range cells that reach the corners of the picture, at any heading."""
        return math.ceil(math.sqrt(2) * self.size) + 1


def range_cells(
    codes: NDArray[np.uint8], bin_m: float, settings: ImageSettings, *, range_offset_m: float = 0.0
) -> NDArray[np.uint8]:
    """Return codes (azimuths, bins) averaged over cells of `settings.cell_m`: (azimuths, cells) uint8.

    Cell j reaches from j cell_m to (j + 1) cell_m; bin k from k bin_m + range_offset_m on. What lies nearer
    than `near_m` or beyond the last bin is 0. Each average is rounded to half a decibel.

    Raises:
        ValueError: `codes` is no scan, or `bin_m` no length.
    """
    return range_averages(
        codes,
        bin_m,
        cell_m=settings.cell_m,
        cells=settings.cells,
        near_m=settings.near_m,
        range_offset_m=range_offset_m,
    )


class Projector:
    """Makes pictures of range cells."""

    def __init__(self, settings: ImageSettings, azimuths: int) -> None:
        """Prepare for scans of `azimuths` rows."""
        self.settings, self.azimuths = settings, azimuths
        offsets = pixel_offsets(settings.size, pixel_m=settings.pixel_m, bin_m=settings.cell_m)
        self._offset = torch.from_numpy(offsets).float()

    def _places(self, turn_rad: float, shift_m: tuple[float, float]) -> Tensor:
        """Return (size, size, 2): range and azimuth of every pixel, each from -1 to 1."""
        azimuth, cells = polar_places(
            self._offset,
            turn_rad=math.remainder(turn_rad, 2 * math.pi),
            shift=(shift_m[0] / self.settings.cell_m, shift_m[1] / self.settings.cell_m),
            xp=torch,
        )
        cells = cells.clamp_(min=0).mul_(2 / (self.settings.cells - 1)).sub_(1)
        return torch.stack([cells, azimuth.mul_(2).sub_(1)], -1)

    def image(
        self,
        cells: NDArray[np.uint8],
        *,
        turn_rad: float = 0.0,
        shift_m: tuple[float, float] = (0.0, 0.0),
    ) -> Tensor:
        """Return a picture (1, size, size) float32 of cells (azimuths, cells), codes over `CODE_OF_ONE`.

        What stands at azimuth a appears at azimuth a + turn_rad, clockwise: the picture's content is turned
        by `turn_rad` about the radar, as if the car had turned the other way; then it is shifted by
        `shift_m` forward and right. What lies beyond the farthest cell is as that is.

        Raises:
            ValueError: `cells` has another shape.
        """
        if cells.shape != (self.azimuths, self.settings.cells):
            wanted = (self.azimuths, self.settings.cells)
            raise ValueError(f"cells must have the shape {wanted}, got {cells.shape}")
        polar = pad(torch.from_numpy(cells.astype(np.float32))[None, None], (0, 0, 0, 1))
        polar[:, :, -1] = polar[:, :, 0]  # so that the last row is followed by the first
        grid = self._places(turn_rad, shift_m)[None]
        return grid_sample(polar, grid, align_corners=True, padding_mode="border")[0] / CODE_OF_ONE


def image_of_codes(
    codes: NDArray[np.uint8], bin_m: float, settings: ImageSettings, *, range_offset_m: float = 0.0
) -> Tensor:
    """Return a scan's picture (1, size, size) float32: `range_cells`, then `Projector.image`.

    Raises:
        ValueError: `codes` is no scan, or `bin_m` no length.
    """
    cells = range_cells(codes, bin_m, settings, range_offset_m=range_offset_m)
    return Projector(settings, codes.shape[0]).image(cells)
