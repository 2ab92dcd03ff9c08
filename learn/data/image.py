"""The image that the model takes: a polar scan averaged over range, then resampled to a Cartesian grid.

Source: Barnes & Posner 2020, section IV (Cartesian images of 0.3456 or 0.6912 m a pixel). A scan is first
averaged to range cells of half a pixel, a tenth of the bytes, so that noise is not sampled at random points;
an image at any heading is then one interpolation of the cells, as sharp as at heading 0.
"""

import numpy as np
import torch
from numpy.typing import NDArray
from torch import Tensor
from torch.nn.functional import grid_sample, pad

from echoscape.learn.data.image_settings import ImageSettings
from echoscape.sim.datasets.cartesian import pixel_offsets, polar_places, range_averages

CODE_OF_ONE = 128
"""The code (64 dB above one count) that becomes 1 in the image; the strongest of real scans are 136."""


def range_cells(
    codes: NDArray[np.uint8], bin_m: float, settings: ImageSettings, *, range_offset_m: float = 0.0
) -> NDArray[np.uint8]:
    """Average a scan over range cells.

    Cell j reaches from j cell_m to (j + 1) cell_m; bin k begins at k bin_m + range_offset_m. Cells nearer
    than `near_m` or beyond the last bin are 0. Each average is rounded to half a decibel.

    Args:
        codes: Codes of the scan (azimuths, bins) uint8.
        bin_m: Length of a range bin [m].
        settings: How scans become images.
        range_offset_m: Added to the ranges of all bins [m].

    Returns:
        Mean codes (azimuths, cells) uint8.

    Raises:
        ValueError: `codes` is not a scan, or `bin_m` is not finite and above 0.
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
    """Resamples range cells to images."""

    def __init__(self, settings: ImageSettings, azimuths: int) -> None:
        """Prepare for scans of one size.

        Args:
            settings: How scans become images.
            azimuths: Azimuths of a scan.
        """
        self.settings, self.azimuths = settings, azimuths
        offsets = pixel_offsets(settings.size, pixel_m=settings.pixel_m, bin_m=settings.cell_m)
        self._offset = torch.from_numpy(offsets).float()

    def _places(self, first_rad: float, turn_rad: float, shift_m: tuple[float, float]) -> Tensor:
        """Return (size, size, 2): range and azimuth of every pixel, each from -1 to 1."""
        azimuth, cells = polar_places(
            self._offset,
            first_rad=first_rad,
            turn_rad=turn_rad,
            shift=(shift_m[0] / self.settings.cell_m, shift_m[1] / self.settings.cell_m),
            xp=torch,
        )
        cells = cells.clamp_(min=0).mul_(2 / (self.settings.cells - 1)).sub_(1)
        return torch.stack([cells, azimuth.mul_(2).sub_(1)], -1)

    def image(
        self,
        cells: NDArray[np.uint8],
        *,
        first_rad: float,
        turn_rad: float = 0.0,
        shift_m: tuple[float, float] = (0.0, 0.0),
    ) -> Tensor:
        """Resample range cells to an image, rotated about the radar and then shifted.

        An object at azimuth a appears at azimuth a + turn_rad, clockwise, as if the car had turned the other
        way. Pixels beyond the last cell have its value.

        Args:
            cells: Range cells (azimuths, cells) uint8.
            first_rad: Direction of the first azimuth, clockwise from ahead [rad].
            turn_rad: Clockwise rotation of the content about the radar [rad].
            shift_m: Shift of the content after that: forward, right [m].

        Returns:
            The image (1, size, size) float32 on the CPU: codes over `CODE_OF_ONE`, forward up.

        Raises:
            ValueError: `cells` has another shape.
        """
        if cells.shape != (self.azimuths, self.settings.cells):
            expected = (self.azimuths, self.settings.cells)
            raise ValueError(f"cells must have the shape {expected}, got {cells.shape}")
        polar = pad(torch.from_numpy(cells.astype(np.float32))[None, None], (0, 0, 0, 1))
        polar[:, :, -1] = polar[:, :, 0]  # the first azimuth follows the last
        grid = self._places(first_rad, turn_rad, shift_m)[None]
        return grid_sample(polar, grid, align_corners=True, padding_mode="border")[0] / CODE_OF_ONE


def image_of_codes(
    codes: NDArray[np.uint8],
    bin_m: float,
    settings: ImageSettings,
    *,
    first_rad: float,
    range_offset_m: float = 0.0,
) -> Tensor:
    """Make the image of a scan: `range_cells`, then `Projector.image`.

    Args:
        codes: Codes of the scan (azimuths, bins) uint8.
        bin_m: Length of a range bin [m].
        settings: How scans become images.
        first_rad: Direction of the first azimuth, clockwise from ahead [rad].
        range_offset_m: Added to the ranges of all bins [m].

    Returns:
        The image (1, size, size) float32 on the CPU.

    Raises:
        ValueError: `codes` is not a scan, or `bin_m` is not finite and above 0.
    """
    cells = range_cells(codes, bin_m, settings, range_offset_m=range_offset_m)
    return Projector(settings, codes.shape[0]).image(cells, first_rad=first_rad)
