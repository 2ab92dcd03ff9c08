"""A scan in the usual form of radar papers: from above, forward up, in grey, with a scale bar only."""

import io
from pathlib import Path

import numpy as np
from numpy.typing import NDArray
from PIL import Image, ImageDraw

from echoscape.eval.figures.style import brightness
from echoscape.sim.datasets.cartesian import polar_to_cartesian
from echoscape.sim.datasets.files.atomic_write import write_atomic
from echoscape.sim.datasets.polar_scan import PolarScan
from echoscape.sim.datasets.scan_folder import open_folder

WIDTH_M = 400.0
"""Width of the image; its height is the radar's range on both sides [m]."""
BAR_M = 50.0
"""Length of the scale bar [m]."""
_OVERSAMPLING = 2
_MARGIN = 0.02


def write_scan_image(folder: Path, to: Path, *, scan: int = 0, pixels: int = 900) -> None:
    """Write one scan of a folder to a PNG file, with a scale bar.

    Args:
        folder: A folder of scans, simulated or real.
        to: File to write.
        scan: Number of the scan, from 0.
        pixels: Width of the image.

    Raises:
        DatasetError: The folder lacks a file or one is damaged; the message names it.
        ValueError: There is no such scan, or `pixels` is below 100.
    """
    scans = open_folder(folder)
    if not 0 <= scan < len(scans):
        raise ValueError(f"scan must be between 0 and {len(scans) - 1}, got {scan}")
    image = Image.fromarray(scan_image(scans.read(scan), pixels=pixels))
    _draw_scale(image, pixel_m=WIDTH_M / pixels)
    data = io.BytesIO()
    image.save(data, "png", optimize=True)
    write_atomic(to, data.getvalue())


def scan_image(scan: PolarScan, *, pixels: int) -> NDArray[np.uint8]:
    """Return a scan seen from above, the radar in the middle.

    Args:
        scan: The scan.
        pixels: Width of the image, which is `WIDTH_M`.

    Returns:
        Grey levels (height, pixels) uint8, black to white over 0 to 42 dB; each pixel is the mean of smaller
        ones.

    Raises:
        ValueError: `pixels` is below 100.
    """
    if pixels < 100:
        raise ValueError(f"pixels must be 100 or more, got {pixels}")
    pixel_m = WIDTH_M / pixels
    height = 2 * round(scan.codes.shape[1] * scan.bin_m / pixel_m)
    size = max(height, pixels + pixels % 2)
    fine = polar_to_cartesian(
        scan.codes,
        scan.bin_m,
        first_rad=scan.first_azimuth_rad,
        pixel_m=pixel_m / _OVERSAMPLING,
        size=size * _OVERSAMPLING,
    )
    whole = fine.reshape(size, _OVERSAMPLING, size, _OVERSAMPLING).mean(axis=(1, 3))
    top, left = (size - height) // 2, (size - pixels) // 2
    return np.rint(255 * brightness(whole[top : top + height, left : left + pixels])).astype(np.uint8)


def _draw_scale(image: Image.Image, *, pixel_m: float) -> None:
    """Draw the scale bar into the lower right corner, which lies beyond the radar's range."""
    draw = ImageDraw.Draw(image)
    right, bottom = round(image.width * (1 - _MARGIN)), round(image.height * (1 - _MARGIN))
    left = right - round(BAR_M / pixel_m)
    draw.line([(left, bottom), (right, bottom)], fill=230, width=2)
    draw.text(((left + right) / 2, bottom - 4), f"{BAR_M:g} m", fill=230, anchor="ms", font_size=13)
