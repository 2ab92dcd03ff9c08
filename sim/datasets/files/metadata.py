"""echoscape.json: the config of a dataset, the versions that made it, and the names behind its numbers.

It holds nothing of the machine or the hour, so that the same config writes the same bytes.
"""

import json
from dataclasses import fields
from pathlib import Path
from typing import Any

from echoscape.sim.datasets.files.atomic_write import DatasetError
from echoscape.sim.sensor.sensor import Sensor

FILE_NAME = "echoscape.json"
FORMAT = 2
"""Version of the folder's layout; readers refuse others."""


def manifest_text(content: dict[str, Any]) -> str:
    """Return the text of echoscape.json."""
    return json.dumps(content, indent=1, allow_nan=False) + "\n"


def read_manifest(folder: Path) -> dict[str, Any]:
    """Read echoscape.json of a dataset folder.

    Raises:
        DatasetError: it is absent, no JSON, or of another format; the message names it.
    """
    path = Path(folder) / FILE_NAME
    try:
        content = json.loads(path.read_text())
    except FileNotFoundError as error:
        raise DatasetError(f"{path}: no such file; {folder} is no dataset of echoscape") from error
    except (OSError, ValueError) as error:
        raise DatasetError(f"{path}: cannot be read ({error})") from error
    if not isinstance(content, dict) or content.get("format") != FORMAT:
        raise DatasetError(f"{path}: not of format {FORMAT}")
    return content


def world_of(content: dict[str, Any]) -> str:
    """Return what the world of a manifest is called: its preset, or the mesh of a scene of one's own."""
    scene = content["config"].get("scene")
    return content["config"]["preset"] if scene is None else scene["file"]


def sensor_of(content: dict[str, Any]) -> Sensor:
    """Return the sensor that a manifest describes.

    Raises:
        DatasetError: its settings make no sensor.
    """
    try:
        settings = dict(content["config"]["sensor"])
        if "doppler_sign" in settings:  # until chirps could alternate
            settings["chirps"] = {-1: "rising", 1: "falling"}[settings.pop("doppler_sign")]
        settings = {
            "sweep_ripple_db": (),
            "blocking_db": ((0.0, 0.0), (360.0, 0.0)),
        } | settings  # younger fields
        return Sensor(
            **{each.name: _as_tuples(settings.pop(each.name)) for each in fields(Sensor)}, **settings
        )
    except (KeyError, TypeError, ValueError) as error:
        raise DatasetError(f"{FILE_NAME}: config.sensor describes no sensor ({error})") from error


def _as_tuples(value: Any) -> Any:
    return tuple(map(_as_tuples, value)) if isinstance(value, list) else value
