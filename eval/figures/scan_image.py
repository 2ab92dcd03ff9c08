"""A scan as a radar engineer knows it: seen from above, forward up, in grey, with nothing but a scale bar."""

import io
from pathlib import Path

import numpy as np
from numpy.typing import NDArray
from PIL import Image, ImageDraw

from echoscape.sim.datasets.cartesian import polar_to_cartesian
from echoscape.sim.datasets.files.atomic_write import write_whole
from echoscape.sim.datasets.polar_scan import PolarScan
from echoscape.sim.datasets.scan_folder import open_folder

WIDTH_M = 400.0
"""Width of the picture; its height is as far as the radar reaches to both sides [m]."""
BRIGHTEST = 84.0
"""Code that is drawn white: 42 dB."""
BAR_M = 50.0
_FINENESS = 2
_MARGIN = 0.02


def write_scan_picture(folder: Path, to: Path, *, scan: int = 0, pixels: int = 900) -> None:
    """Write scan number `scan` of a folder to the PNG `to`, `pixels` wide; `folder` may hold real scans.

    Raises:
        DatasetError: the folder lacks a file or one is damaged; the message names it.
        ValueError: there is no such scan, or `pixels` is below 100.
    """
    scans = open_folder(folder)
    if not 0 <= scan < len(scans):
        raise ValueError(f"scan must be between 0 and {len(scans) - 1}, got {scan}")
    picture = Image.fromarray(scan_picture(scans.read(scan), pixels=pixels))
    _draw_scale(picture, pixel_m=WIDTH_M / pixels)
    data = io.BytesIO()
    picture.save(data, "png", optimize=True)
    write_whole(to, data.getvalue())


def scan_picture(scan: PolarScan, *, pixels: int) -> NDArray[np.uint8]:
    """Return a scan seen from above (height, pixels) uint8, black to white over 0 to 42 dB.

    The radar is in the middle; pixels are means of smaller ones.

    Raises:
        ValueError: `pixels` is below 100.
    """
    if pixels < 100:
        raise ValueError(f"pixels must be 100 or more, got {pixels}")
    pixel_m = WIDTH_M / pixels
    height = 2 * round(scan.codes.shape[1] * scan.bin_m / pixel_m)
    size = max(height, pixels + pixels % 2)
    fine = polar_to_cartesian(scan.codes, scan.bin_m, pixel_m=pixel_m / _FINENESS, size=size * _FINENESS)
    whole = fine.reshape(size, _FINENESS, size, _FINENESS).mean(axis=(1, 3))
    top, left = (size - height) // 2, (size - pixels) // 2
    shown = whole[top : top + height, left : left + pixels]
    return np.rint(255 * np.clip(shown / BRIGHTEST, 0, 1)).astype(np.uint8)


def _draw_scale(picture: Image.Image, *, pixel_m: float) -> None:
    """Draw a bar of BAR_M into the lower right corner, where the scan does not reach."""
    draw = ImageDraw.Draw(picture)
    right, bottom = round(picture.width * (1 - _MARGIN)), round(picture.height * (1 - _MARGIN))
    left = right - round(BAR_M / pixel_m)
    draw.line([(left, bottom), (right, bottom)], fill=230, width=2)
    draw.text(((left + right) / 2, bottom - 4), f"{BAR_M:g} m", fill=230, anchor="ms", font_size=13)
