"""The figure of a scan that differs from the stored one: both, and what has changed, in polar form."""

from pathlib import Path

import numpy as np
from matplotlib.axes import Axes
from matplotlib.image import AxesImage
from numpy.typing import NDArray

from echoscape.eval.figures.style import (
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

_LEAST_CODES = 4
"""Least difference that has full colour [codes]."""
_ROWS = 3


def write_difference(path: Path, stored: Golden, found: Golden) -> None:
    """Draw a stored scan, the scan that was found, and the difference of their codes.

    Args:
        path: PNG file to write; its folder is made.
        stored: The stored scan.
        found: The other one, of the same shape.

    Raises:
        OSError: The file cannot be written.
    """
    change = found.codes.astype(np.int16) - stored.codes
    most = max(int(np.abs(change).max()), _LEAST_CODES)
    full = 1.0 if max(stored.codes.max(), found.codes.max()) <= 1 else FULL_SCALE_CODE
    figure = new_page(11.0, 9.5)
    panels = (
        ("stored", stored.codes, ECHO_COLOURMAP, (0.0, full)),
        ("now", found.codes, ECHO_COLOURMAP, (0.0, full)),
        (f"now minus stored: {np.count_nonzero(change)} cells", change, CHANGE_COLOURMAP, (-most, most)),
    )
    axes = figure.subplots(_ROWS, 1, sharex=True, sharey=True)
    for each, (title, values, colours, limits) in zip(axes, panels, strict=True):
        image = each.imshow(
            values, aspect="auto", cmap=colours, vmin=limits[0], vmax=limits[1], interpolation="nearest",
            extent=_extent(found),
        )  # fmt: skip
        _style(each, title, image)
    rows, columns = np.nonzero(change)
    axes[-1].scatter(
        *_places(found, rows, columns), s=40, facecolors="none", edgecolors=FAINT, linewidths=0.5
    )
    axes[-1].set_xlabel("bin" if "bin_m" not in found.axes else "range [m]", color=FAINT)
    figure.tight_layout()
    path.parent.mkdir(parents=True, exist_ok=True)
    write_atomic(path, png_bytes(figure))


def _bin_m(golden: Golden) -> float:
    return float(golden.axes.get("bin_m", 1.0))


def _extent(golden: Golden) -> tuple[float, float, float, float]:
    """Return left, right, bottom and top of an image: range or bin to the right, azimuths downwards."""
    rows, bins = golden.codes.shape
    return 0.0, bins * _bin_m(golden), rows - 0.5, -0.5


def _places(golden: Golden, rows: NDArray[np.intp], columns: NDArray[np.intp]) -> tuple[NDArray, NDArray]:
    return (columns + 0.5) * _bin_m(golden), rows


def _style(axes: Axes, title: str, image: AxesImage) -> None:
    axes.set_title(title, color=INK, fontsize=10, loc="left")
    axes.set_ylabel("azimuth", color=FAINT)
    axes.tick_params(colors=FAINT)
    axes.spines[:].set_color(FRAME)
    figure = axes.figure
    bar = figure.colorbar(image, ax=axes, pad=0.01)
    bar.set_label("code [half dB]", color=FAINT)
    bar.ax.tick_params(colors=FAINT)
    bar.outline.set_edgecolor(FRAME)  # pyright: ignore[reportCallIssue]
