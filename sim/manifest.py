"""echoscape.json: the recipe of a dataset, the versions that made it, and the names behind its numbers.

It holds nothing of the machine or the hour, so that the same recipe writes the same bytes.
"""

import ctypes
import importlib.metadata
import json
import os
import platform
from dataclasses import asdict, fields
from pathlib import Path
from typing import Any

from echoscape.scenes.materials import MATERIALS
from echoscape.scenes.world import CLASSES
from echoscape.sim.recipe import Recipe
from echoscape.sim.sensor import Sensor
from echoscape.sim.whole_files import DatasetError

FILE_NAME = "echoscape.json"
FORMAT = 1
"""Version of the folder's layout; readers refuse others."""

_PACKAGES = ("echoscape", "numpy", "scipy", "shapely", "trimesh", "pillow", "mitsuba", "drjit")


def manifest(recipe: Recipe) -> dict[str, Any]:
    """Return what echoscape.json says of a dataset that this installation makes of `recipe`."""
    from echoscape.sim.polar_scan import Component

    content = {
        "format": FORMAT,
        "recipe": _told(recipe),
        "versions": _versions(),
        "classes": list(CLASSES),
        "components": [component.name.lower() for component in Component],
        "materials": list(MATERIALS),
    }
    return json.loads(manifest_text(content))  # as it will be read: lists for tuples


def _told(recipe: Recipe) -> dict[str, Any]:
    """Return the recipe as a dictionary, without the place of a scene's files on this machine."""
    content = asdict(recipe)
    if recipe.scene is not None:
        del content["scene"]["folder"]
    return content


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
    scene = content["recipe"].get("scene")
    return content["recipe"]["preset"] if scene is None else scene["file"]


def sensor_of(content: dict[str, Any]) -> Sensor:
    """Return the sensor that a manifest describes.

    Raises:
        DatasetError: its settings make no sensor.
    """
    try:
        settings = dict(content["recipe"]["sensor"])
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
        raise DatasetError(f"{FILE_NAME}: recipe.sensor describes no sensor ({error})") from error


def difference(old: dict[str, Any], new: dict[str, Any]) -> str | None:
    """Return a sentence on the first entry in which two manifests differ, or None if they are equal.

    Entries of lists are counted from 0: targets[1].position_m[2].
    """
    return _difference("", old, new)


def _difference(name: str, old: Any, new: Any) -> str | None:
    """Return the first difference in or below the entry `name`."""
    if old == new:
        return None
    told = name.removeprefix("recipe.")
    if isinstance(old, dict) and isinstance(new, dict):
        keys = dict.fromkeys((*new, *old))
        inner = [(f"{name}.{key}" if name else key, old.get(key), new.get(key)) for key in keys]
    elif isinstance(old, list) and isinstance(new, list):
        if len(old) != len(new):
            return f"{told} had {_count(old)}, now it has {len(new)}"
        inner = [(f"{name}[{i}]", *pair) for i, pair in enumerate(zip(old, new, strict=True))]
    else:
        return f"{told} was {_short(old)}, now it is {_short(new)}"
    return next(filter(None, (_difference(*entry) for entry in inner)), None)


def _count(entries: list[Any]) -> str:
    return f"{len(entries)} entry" if len(entries) == 1 else f"{len(entries)} entries"


def _short(value: Any) -> str:
    """Return a value for a message; of a table or a list only that it is one."""
    if isinstance(value, dict):
        return f"a table of {', '.join(value)}"
    return f"a list of {_count(value)}" if isinstance(value, list) else repr(value)


def _as_tuples(value: Any) -> Any:
    return tuple(map(_as_tuples, value)) if isinstance(value, list) else value


def _versions() -> dict[str, str]:
    """Return the versions of what the bytes depend on."""
    packages = {name: importlib.metadata.version(name) for name in _PACKAGES}
    return {"python": platform.python_version(), **packages, "llvm": _llvm_version()}


def _llvm_version() -> str:
    """Return the version of the LLVM that compiles the kernels, "none" where another compiler does."""
    from echoscape.sim import backend

    library = os.environ.get("DRJIT_LIBLLVM_PATH")
    if library is None or backend.requested_device() != "cpu":
        return "none"
    version = [ctypes.c_uint() for _ in range(3)]
    ctypes.CDLL(library).LLVMGetVersion(*(ctypes.byref(part) for part in version))
    return ".".join(str(part.value) for part in version)
