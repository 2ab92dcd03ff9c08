"""The layouts of dataset folders by name, and which of them is the home of which sensor."""

from collections.abc import Mapping
from typing import Any, Literal

from echoscape.sim.datasets.files.atomic_write import DatasetError
from echoscape.sim.datasets.layouts.boreas import Boreas
from echoscape.sim.datasets.layouts.layout import Layout
from echoscape.sim.datasets.layouts.mulran import MulRan
from echoscape.sim.datasets.layouts.oxford import Oxford

LayoutName = Literal["oxford", "mulran", "boreas"]

LAYOUTS: Mapping[str, Layout] = {each.name: each for each in (Oxford(), MulRan(), Boreas())}

HOMES: Mapping[str, LayoutName] = {
    "cts350x": "oxford",
    "cir204": "mulran",
    "cir304": "boreas",
    "cir304_rt": "boreas",
}
"""The layout in which a sensor's real scans are published; any other sensor's are written as Oxford's."""


def layout_named(name: str) -> Layout:
    """Return the layout of this name.

    Raises:
        ValueError: there is none.
    """
    if name not in LAYOUTS:
        raise ValueError(f"layout must be one of {', '.join(LAYOUTS)}, got {name!r}")
    return LAYOUTS[name]


def home_of(sensor_name: str) -> Layout:
    """Return the layout that a sensor's scans are written in unless another is asked for."""
    return LAYOUTS[HOMES.get(sensor_name, "oxford")]


def layout_of(content: Mapping[str, Any]) -> Layout:
    """Return the layout of the dataset that a manifest (echoscape.json) describes.

    Raises:
        DatasetError: it names none.
    """
    try:
        name = content["config"].get("layout")
        return home_of(content["config"]["sensor"]["name"]) if name is None else layout_named(name)
    except (KeyError, TypeError, AttributeError, ValueError) as error:
        raise DatasetError(f"echoscape.json: config.layout names no layout ({error})") from error
