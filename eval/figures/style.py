"""The colours, colour scales and page elements that every figure and the viewer share.

Component colours follow Okabe & Ito's rule for colour-blind readers: blue against orange for the two most
frequent ones. tests/eval/figures/test_style.py measures their distances.
"""

import io
from collections.abc import Iterable
from functools import cache

import numpy as np
from matplotlib import font_manager
from matplotlib.axes import Axes
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.colors import LinearSegmentedColormap
from matplotlib.figure import Figure
from numpy.typing import NDArray
from PIL import Image

# ---------------------------------------------------------------------- the page

PAGE, PANEL, FRAME = "#0d1014", "#131820", "#2a313b"
"""Background of a page, of a panel with curves, and the colour of frames and grids."""
INK, FAINT = "#e8ecf1", "#8b95a3"
"""Colours of main and secondary text."""
SCREEN = "#0b0e13"
"""Background of a scan: the colour of no echo."""

# ---------------------------------------------------------------------- what is plotted

ACCENT = "#ffb454"
"""The radar's own car, its drive, and what is estimated."""
TRUTH_COLOUR = "#59d0ff"
"""True values, and the reference that estimates are compared with."""
ERROR_COLOUR = "#ff5f6d"
"""Failed pairs and statistics out of tolerance."""
MOVER_COLOUR = "#4cc9f0"
"""Moving objects on a plan."""
BOX_COLOUR = "#5dff8f"
"""True boxes of moving objects on a scan."""
TARGET_COLOUR = "#ff5fa2"
"""Test targets on a plan."""
MOVING_COLOUR = "#ff5a4f"
"""Cells whose echo comes from a moving object."""

IN_PLACE = "multipath in place"
"""Name of ghosts that are not displaced: a path of several bounces that shows one of its surfaces."""
COMPONENT_COLOURS = {
    "direct": "#5cc8ff",
    "ghost": "#ff6f3c",
    IN_PLACE: "#a3d998",
    "sidelobe": "#f7e95c",
    "spoke": "#c04ba6",
    "leakage": "#0f9a70",
    "noise": "#434c58",
    "rain": "#ffffff",
    "interference": "#5a4dff",
}
"""Colours of the strongest contribution to a cell, by component; ghosts in place have their own."""

BOUNCE_COLOURS = (
    COMPONENT_COLOURS["noise"],
    COMPONENT_COLOURS["direct"],
    COMPONENT_COLOURS["ghost"],
    COMPONENT_COLOURS["sidelobe"],
    COMPONENT_COLOURS["spoke"],
)
"""Colours of cells by the number of bounces: none, 1, 2, 3, and 4 or more."""

CLASS_GROUPS = {
    "road and ground": ("#6f7f95", ("ground", "road", "pavement", "kerb")),
    "building": ("#f2a65a", ("building",)),
    "wall, fence": ("#c9ada7", ("wall", "fence", "barrier")),
    "vegetation": ("#5fd068", ("hedge", "tree")),
    "street furniture": (
        "#e7e36b",
        ("lamp_post", "sign", "bollard", "bus_shelter", "bin", "container", "tank"),
    ),
    "vehicle": (MOVER_COLOUR, ("car", "van", "truck", "bus")),
    "people": ("#ff70a6", ("pedestrian", "cyclist")),
    "test target": ("#ffffff", ("target",)),
}
"""Groups of object classes: legend text to colour and names of the classes."""

MATERIAL_COLOURS = {
    "asphalt": "#343a44",
    "paving": "#566070",
    "soil": "#27352c",
    "foliage": "#3f7d4c",
    "brick": "#b07a62",
    "concrete": "#a39c93",
    "plasterboard": "#cfc8ba",
    "wood": "#8f7a5f",
    "glass": "#7fa3b5",
    "metal": "#8d98a8",
    "rubber": "#22252b",
    "person": "#e0b090",
    "fittings": "#6f7a84",
    "water": "#2c4a63",
}
"""Colours of surfaces on a plan, by material."""
GROUND_COLOUR = "#1b2420"
"""Colour of a plan where nothing stands."""
OTHER_COLOUR = "#888888"
"""Colour of a component, class or material that has none of its own."""

# ---------------------------------------------------------------------- colour scales

ECHO_COLOURMAP = LinearSegmentedColormap.from_list(
    "echo", [SCREEN, "#172a46", "#1f5f8b", "#3fb0ac", "#d8d98a", "#fff7e0"]
)
"""Colours of levels, from no echo to full brightness."""
CHANGE_COLOURMAP = LinearSegmentedColormap.from_list(
    "change", ["#4fb3ff", "#1c4a7a", SCREEN, "#8a4a16", "#ffb454"]
)
"""Colours of differences of levels: blue where weaker, orange where stronger."""
OVERLAY_COLOURS = np.array([1.0, 0.25, 0.2]), np.array([0.15, 0.85, 0.95])
"""Colours (3,) of two scans laid over each other, red and cyan; where both have an echo they add to white."""

FULL_SCALE_CODE = 84.0
"""Code that is drawn in full brightness: 42 dB."""


def brightness(codes: NDArray) -> NDArray[np.float32]:
    """Return codes as brightness from 0 (no echo) to 1 (`FULL_SCALE_CODE` and above).

    Args:
        codes: Codes of any shape [half dB].

    Returns:
        Brightness of the same shape, float32.
    """
    return np.clip(np.asarray(codes, np.float32) / FULL_SCALE_CODE, 0, 1)


def class_colour(name: str) -> str:
    """Return the colour of an object class: that of its group.

    Args:
        name: Name of the class.

    Returns:
        The colour as #rrggbb, `OTHER_COLOUR` for a class without a group.
    """
    return next((colour for colour, members in CLASS_GROUPS.values() if name in members), OTHER_COLOUR)


def component_legend(present: Iterable[str]) -> dict[str, str]:
    """Return the legend of components, restricted to those that occur.

    Args:
        present: Names of the components that occur.

    Returns:
        Colour by name, in the order of `COMPONENT_COLOURS`.
    """
    names = set(present)
    return {name: colour for name, colour in COMPONENT_COLOURS.items() if name in names}


def class_legend(present: Iterable[str]) -> dict[str, str]:
    """Return the legend of the groups of classes, restricted to those that occur.

    Args:
        present: Names of the classes that occur.

    Returns:
        Colour by name of the group, in the order of `CLASS_GROUPS`.
    """
    names = set(present)
    return {group: colour for group, (colour, members) in CLASS_GROUPS.items() if names & set(members)}


# ---------------------------------------------------------------------- elements of a page


@cache
def font_family() -> tuple[str, ...]:
    """Return the sans-serif typefaces that are installed, best first."""
    known = {font.name for font in font_manager.fontManager.ttflist}
    return tuple(name for name in ("Inter", "Source Sans 3", "Open Sans", "DejaVu Sans") if name in known)


def new_page(width_in: float, height_in: float, *, dpi: int = 100) -> Figure:
    """Return an empty figure with the background of a page.

    Args:
        width_in: Width [inch].
        height_in: Height [inch].
        dpi: Pixels per inch.

    Returns:
        The figure, drawn without a display.
    """
    figure = Figure(figsize=(width_in, height_in), dpi=dpi, facecolor=PAGE)
    FigureCanvasAgg(figure)
    return figure


def style_curves(axes: Axes, x_label: str, y_label: str) -> None:
    """Give axes with curves the colours of the page, a grid and labels.

    Args:
        axes: Axes to style.
        x_label: Label of the x axis with its unit.
        y_label: Label of the y axis with its unit.
    """
    axes.set_facecolor(PAGE)
    axes.set_xlabel(x_label, color=FAINT)
    axes.set_ylabel(y_label, color=FAINT)
    axes.tick_params(colors=FAINT)
    axes.grid(color=FAINT, alpha=0.15, lw=0.8)
    axes.spines[:].set_color(FRAME)


def rgb_pixels(figure: Figure) -> NDArray[np.uint8]:
    """Render a figure.

    Args:
        figure: A figure, for example from `new_page`.

    Returns:
        Pixels (height, width, 3) uint8, without transparency.
    """
    canvas = FigureCanvasAgg(figure)
    canvas.draw()
    return np.asarray(canvas.buffer_rgba())[..., :3]


def png_bytes(figure: Figure) -> bytes:
    """Render a figure to a PNG file.

    Args:
        figure: A figure, for example from `new_page`.

    Returns:
        The bytes of the file, RGB without transparency.
    """
    data = io.BytesIO()
    Image.fromarray(rgb_pixels(figure)).save(data, "png", optimize=True)
    return data.getvalue()
