"""Colours and framing that all figures share."""

import numpy as np
from matplotlib.colors import LinearSegmentedColormap
from numpy.typing import NDArray

from echoscape.eval.figures.town_plan import Window

PAGE, INK, FAINT, ACCENT = "#0d1014", "#e8ecf1", "#8b95a3", "#ffb454"

COMPONENT_COLOURS = {
    "direct": "#59d0ff",
    "ghost": "#ff5fa2",
    "sidelobe": "#7d7bff",
    "spoke": "#ffc14d",
    "leakage": "#7ee081",
    "noise": "#39424e",
    "rain": "#3f8cff",
    "interference": "#ff5252",
}
"""Colours of what makes a cell, by component."""

THINGS = {
    "road and ground": ("#6f7f95", ("ground", "road", "pavement", "kerb")),
    "building": ("#f2a65a", ("building",)),
    "wall, fence": ("#c9ada7", ("wall", "fence", "barrier")),
    "greenery": ("#5fd068", ("hedge", "tree")),
    "street furniture": (
        "#e7e36b",
        ("lamp_post", "sign", "bollard", "bus_shelter", "bin", "container", "tank"),
    ),
    "vehicle": ("#4cc9f0", ("car", "van", "truck", "bus")),
    "people": ("#ff70a6", ("pedestrian", "cyclist")),
    "test target": ("#ffffff", ("target",)),
}
"""Groups of classes: legend, colour, names of the classes."""

HEAT = LinearSegmentedColormap.from_list(
    "echo", ["#0b0e13", "#172a46", "#1f5f8b", "#3fb0ac", "#d8d98a", "#fff7e0"]
)

BRIGHTEST = 84.0
"""Code that is drawn in full brightness: 42 dB."""


def drive_window(path: NDArray[np.float64]) -> Window:
    """Return the square that shows the drive with some room round it."""
    low, high = path[:, :2].min(axis=0), path[:, :2].max(axis=0)
    middle, half = (low + high) / 2, max(130.0, float((high - low).max()) / 2 + 40.0)
    return tuple(float(value) for value in (*(middle - half), *(middle + half)))  # type: ignore[return-value]
