"""The layouts of data set folders by name, and the layout in which each sensor's real scans are published."""

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
"""Layout in which a sensor's real scans are published; those of other sensors are written in Oxford's."""


def layout_named(name: str) -> Layout:
    """Look up a layout.

    Args:
        name: Its name.

    Returns:
        The layout.

    Raises:
        ValueError: There is none of this name.
    """
    if name not in LAYOUTS:
        raise ValueError(f"layout must be one of {', '.join(LAYOUTS)}, got {name!r}")
    return LAYOUTS[name]


def home_of(sensor_name: str) -> Layout:
    """Look up the layout in which a sensor's scans are written by default.

    Args:
        sensor_name: Name of the sensor.

    Returns:
        The layout; Oxford's for sensors without a published data set.
    """
    return LAYOUTS[HOMES.get(sensor_name, "oxford")]


def layout_of(content: Mapping[str, Any]) -> Layout:
    """Look up the layout of a simulated data set.

    Args:
        content: Content of its echoscape.json.

    Returns:
        The layout.

    Raises:
        DatasetError: The content names no layout.
    """
    try:
        name = content["config"].get("layout")
        return home_of(content["config"]["sensor"]["name"]) if name is None else layout_named(name)
    except (KeyError, TypeError, AttributeError, ValueError) as error:
        raise DatasetError(f"echoscape.json: config.layout names no layout ({error})") from error
