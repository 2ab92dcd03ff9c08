"""The figure of hand-made keypoints: one scan from above for each extractor."""

from collections.abc import Sequence
from pathlib import Path

from matplotlib.axes import Axes

from echoscape.eval.figures.style import (
    ACCENT,
    FAINT,
    FRAME,
    INK,
    brightness,
    font_family,
    new_page,
    png_bytes,
)
from echoscape.eval.methods.keypoints import KeypointExtractor, Keypoints
from echoscape.eval.methods.registry import EXTRACTORS
from echoscape.sim.datasets.cartesian import polar_to_cartesian
from echoscape.sim.datasets.files.atomic_write import write_atomic
from echoscape.sim.datasets.polar_scan import PolarScan
from echoscape.sim.datasets.scan_folder import open_folder

REACH_M = 80.0
"""Range that is shown to each side [m]."""
_SIDE_IN = 5.0
_PIXELS = 480


def write_keypoints_figure(folder: Path, to: Path, *, scan: int = 0) -> None:
    """Draw the keypoints of one scan of a folder into a PNG file.

    Args:
        folder: A folder of scans, simulated or real.
        to: File to write.
        scan: Number of the scan, from 0.

    Raises:
        DatasetError: The folder lacks a file or one is damaged; the message names it.
        IndexError: There is no such scan.
    """
    shown = open_folder(folder).read(scan)
    write_atomic(to, keypoints_page(shown, [build() for build in EXTRACTORS.values()]))


def keypoints_page(scan: PolarScan, extractors: Sequence[KeypointExtractor]) -> bytes:
    """Draw a scan from above, forward up, with the keypoints of each extractor.

    Args:
        scan: The scan.
        extractors: The extractors, from left to right.

    Returns:
        The bytes of a PNG file.
    """
    page = new_page(_SIDE_IN * len(extractors), _SIDE_IN + 0.45)
    grid = page.add_gridspec(1, len(extractors), left=0.01, right=0.99, bottom=0.012, top=0.93, wspace=0.02)
    for place, extractor in enumerate(extractors):
        axes = page.add_subplot(grid[0, place])
        _draw_scan(axes, scan)
        _draw_keypoints(axes, extractor.name, extractor.extract(scan))
    return png_bytes(page)


def _draw_scan(axes: Axes, scan: PolarScan) -> None:
    image = polar_to_cartesian(
        scan.codes,
        scan.bin_m,
        first_rad=scan.first_azimuth_rad,
        pixel_m=2 * REACH_M / _PIXELS,
        size=_PIXELS,
    )
    extent = (-REACH_M, REACH_M, -REACH_M, REACH_M)
    axes.imshow(0.8 * brightness(image), cmap="gray", vmin=0, vmax=1, extent=extent)
    axes.set(xlim=(-REACH_M, REACH_M), ylim=(-REACH_M, REACH_M), xticks=[], yticks=[])
    axes.spines[:].set(color=FRAME, linewidth=0.8)


def _draw_keypoints(axes: Axes, name: str, found: Keypoints) -> None:
    axes.plot(found.y_m, found.x_m, "o", ms=3, mec="none", color=ACCENT)
    style = {"xycoords": "axes fraction", "textcoords": "offset points", "family": font_family()}
    axes.annotate(name, (0, 1), xytext=(0, 8), size=14, color=INK, weight="bold", **style)
    text = f"{len(found)} keypoints, {(found.range_m < REACH_M).sum()} within {REACH_M:g} m"
    axes.annotate(text, (1, 1), xytext=(0, 8), size=11, color=FAINT, ha="right", **style)
