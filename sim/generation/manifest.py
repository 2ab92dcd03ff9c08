"""The manifest of a dataset: the settings and versions that make its bytes, and how two manifests differ.

Reading and writing the file itself: `sim.datasets.files.metadata`.
"""

import ctypes
import importlib.metadata
import json
import platform
from dataclasses import asdict
from typing import Any

from echoscape.scenes.core.materials import MATERIALS
from echoscape.scenes.core.scene import CLASSES
from echoscape.sim.datasets.files.metadata import FORMAT, manifest_text
from echoscape.sim.generation.config import SimulationConfig
from echoscape.sim.raytracing.backend import choose_llvm, selected_backend

_PACKAGES = ("echoscape", "numpy", "scipy", "shapely", "trimesh", "pillow", "mitsuba", "drjit")


def manifest(config: SimulationConfig) -> dict[str, Any]:
    """Return what echoscape.json says of a dataset that this installation makes of `config`."""
    from echoscape.sim.datasets.polar_scan import Component

    content = {
        "format": FORMAT,
        "config": _told(config),
        "versions": _versions(),
        "classes": list(CLASSES),
        "components": [component.name.lower() for component in Component],
        "materials": list(MATERIALS),
    }
    return json.loads(manifest_text(content))  # as it will be read: lists for tuples


def _told(config: SimulationConfig) -> dict[str, Any]:
    """Return the config as a dictionary, without the place of a scene's files on this machine."""
    content = asdict(config)
    if config.scene is not None:
        del content["scene"]["folder"]
    return content


def difference(old: dict[str, Any], new: dict[str, Any]) -> str | None:
    """Return a sentence on the first entry in which two manifests differ, or None if they are equal.

    Entries of lists are counted from 0: targets[1].position_m[2].
    """
    return _difference("", old, new)


def _difference(name: str, old: Any, new: Any) -> str | None:
    """Return the first difference in or below the entry `name`."""
    if old == new:
        return None
    told = name.removeprefix("config.")
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


def _versions() -> dict[str, str]:
    """Return the versions of what the bytes depend on."""
    packages = {name: importlib.metadata.version(name) for name in _PACKAGES}
    return {"python": platform.python_version(), **packages, "llvm": _llvm_version()}


def _llvm_version() -> str:
    """Return the version of the LLVM that compiles the kernels, "none" where another compiler does."""
    library = choose_llvm() if selected_backend() == "llvm" else None
    if library is None:
        return "none"
    version = [ctypes.c_uint() for _ in range(3)]
    ctypes.CDLL(str(library)).LLVMGetVersion(*(ctypes.byref(part) for part in version))
    return ".".join(str(part.value) for part in version)
