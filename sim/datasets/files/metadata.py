"""echoscape.json: the configuration of a data set, the versions that made it, and the names of its numbers.

It holds nothing of the machine or the hour, so that the same configuration writes the same bytes.
"""

import json
from pathlib import Path
from typing import Any

from echoscape.sim.datasets.files.atomic_write import DatasetError
from echoscape.sim.datasets.files.typed_json import from_json
from echoscape.sim.sensor.sensor import Sensor

FILE_NAME = "echoscape.json"
FORMAT = 3
"""Version of the folder's format; readers refuse others."""


def manifest_text(content: dict[str, Any]) -> str:
    """Format the content of echoscape.json.

    Args:
        content: Settings, versions and names.

    Returns:
        JSON text that ends with a line break.
    """
    return json.dumps(content, indent=1, allow_nan=False) + "\n"


def read_manifest(path: Path) -> dict[str, Any]:
    """Read an echoscape.json.

    Args:
        path: The file, or the folder of the data set that holds it.

    Returns:
        Its content.

    Raises:
        DatasetError: It is absent, no JSON, or of another format; the message names it and what to do.
    """
    path = Path(path)
    if path.is_file() and path.suffix != ".json":
        raise DatasetError(f"{path}: not an {FILE_NAME}")
    path = path / FILE_NAME if path.is_dir() or path.suffix != ".json" else path
    try:
        content = json.loads(path.read_text())
    except FileNotFoundError as error:
        raise DatasetError(f"{path}: no such file; {path.parent} is not a data set of echoscape") from error
    except (OSError, ValueError) as error:
        raise DatasetError(f"{path}: cannot be read ({error})") from error
    found = content.get("format") if isinstance(content, dict) else None
    if found != FORMAT:
        raise DatasetError(f"{path}: must be of format {FORMAT}, got {found!r}{_remedy(found)}")
    return content


def _remedy(found: Any) -> str:
    """Return what to do about another format, for the end of a message; nothing where it is no format."""
    if not isinstance(found, int) or isinstance(found, bool) or found < 1:
        return ""
    if found > FORMAT:
        return ", written by a later version of echoscape: install that one"
    return (
        ", written by an earlier version of echoscape: simulate the data set again from its options, "
        "or delete this file to read the scans without truth"
    )


def world_of(content: dict[str, Any]) -> str:
    """Name the world of a data set.

    Args:
        content: Content of echoscape.json.

    Returns:
        The preset, or the file name of a custom scene's mesh.
    """
    scene = content["config"].get("scene")
    return content["config"]["preset"] if scene is None else scene["file"]


def sensor_of(content: dict[str, Any]) -> Sensor:
    """Convert the recorded sensor of a data set.

    Args:
        content: Content of echoscape.json.

    Returns:
        The sensor.

    Raises:
        DatasetError: Its settings are absent or make no sensor; the message names the entry.
    """
    config = content.get("config")
    if not isinstance(config, dict) or "sensor" not in config:
        raise DatasetError(f"{FILE_NAME}: config.sensor is missing")
    try:
        return from_json(Sensor, config["sensor"], "config.sensor")
    except DatasetError as error:
        raise DatasetError(f"{FILE_NAME}: {error}") from error
