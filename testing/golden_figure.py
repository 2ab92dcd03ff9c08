"""The figure of a scan that differs from the stored one: both, and what has changed, in polar form."""

from pathlib import Path

import numpy as np
from matplotlib.axes import Axes
from matplotlib.image import AxesImage
from matplotlib.ticker import MaxNLocator

from echoscape.eval.figures.style import (
    ACCENT,
    CHANGE_COLOURMAP,
    ECHO_COLOURMAP,
    FAINT,
    FRAME,
    FULL_SCALE_CODE,
    INK,
    new_page,
    png_bytes,
)
from echoscape.sim.datasets.files.atomic_write import write_atomic
from echoscape.testing.golden_file import Golden

_LEAST_CODES = 4.0
"""Least difference that has full colour [codes]."""
_FULL_COLOUR_PERCENTILE = 98
_FEW = 60
"""Number of cells up to which each is circled, as single cells are hard to see."""


def write_difference(path: Path, stored: Golden, found: Golden) -> None:
    """Draw a stored scan, the scan that was found, and the difference of their codes.

    Args:
        path: PNG file to write; its folder is made.
        stored: The stored scan.
        found: Another one of the same shape.

    Raises:
        OSError: The file cannot be written.
    """
    change = found.codes.astype(np.int16) - stored.codes
    rows, columns = np.nonzero(change)
    sizes = np.abs(change[rows, columns])
    if found.mask:
        label, full, most = "cell is set", 1.0, 1.0
    else:
        label, full = "code [half dB]", FULL_SCALE_CODE
        most = max(float(np.percentile(sizes, _FULL_COLOUR_PERCENTILE)), _LEAST_CODES)
    panels = (
        ("stored", stored.codes, ECHO_COLOURMAP, 0.0, full),
        ("now", found.codes, ECHO_COLOURMAP, 0.0, full),
        (f"now minus stored: {len(rows)} cells differ", change, CHANGE_COLOURMAP, -most, most),
    )
    figure = new_page(11.0, 9.5)
    figure.set_layout_engine("constrained")
    axes = figure.subplots(len(panels), 1, sharex=True, sharey=True)
    for each, (title, values, colours, low, high) in zip(axes, panels, strict=True):
        image = each.imshow(
            values,
            aspect="auto",
            cmap=colours,
            vmin=low,
            vmax=high,
            interpolation="nearest",
            extent=_extent(found),
        )
        _style(each, title, image, label)
    if len(rows) <= _FEW:
        places = (columns + 0.5) * _bin_size(found)
        axes[-1].scatter(places, rows, s=90, facecolors="none", edgecolors=ACCENT, linewidths=0.8)
    axes[-1].set_xlabel("range [m]" if "bin_m" in found.axes else "bin", color=FAINT)
    path.parent.mkdir(parents=True, exist_ok=True)
    write_atomic(path, png_bytes(figure))


def _bin_size(golden: Golden) -> float:
    """Return the size of a bin on the axis [m], 1 for an array that is no scan."""
    return float(golden.axes.get("bin_m", 1.0))


def _extent(golden: Golden) -> tuple[float, float, float, float]:
    """Return left, right, bottom and top of an image: range or bin to the right, azimuths downwards."""
    rows, bins = golden.codes.shape
    return 0.0, bins * _bin_size(golden), rows - 0.5, -0.5


def _style(axes: Axes, title: str, image: AxesImage, label: str) -> None:
    axes.set_title(title, color=INK, fontsize=10, loc="left")
    axes.set_ylabel("azimuth", color=FAINT)
    axes.tick_params(colors=FAINT)
    axes.spines[:].set_color(FRAME)
    bar = axes.figure.colorbar(image, ax=axes, pad=0.01, aspect=12, ticks=MaxNLocator(6, integer=True))
    bar.set_label(label, color=FAINT)
    bar.ax.tick_params(colors=FAINT)
