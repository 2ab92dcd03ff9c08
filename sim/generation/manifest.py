"""The manifest of a data set: the settings and versions that decide its bytes, and how two manifests differ.

Reading and writing the file itself: `sim.datasets.files.metadata`.
"""

import ctypes
import importlib.metadata
import platform
from typing import Any

from echoscape.scenes.core.materials import MATERIALS
from echoscape.scenes.core.scene import CLASSES
from echoscape.sim.datasets.files.metadata import FORMAT
from echoscape.sim.datasets.polar_scan import Component
from echoscape.sim.generation.config import SimulationConfig
from echoscape.sim.generation.config_json import config_content
from echoscape.sim.raytracing.backend import choose_llvm, selected_backend

_PACKAGES = ("echoscape", "numpy", "scipy", "shapely", "trimesh", "pillow", "mitsuba", "drjit")


def manifest(config: SimulationConfig) -> dict[str, Any]:
    """Describe the data set that this installation makes of a configuration.

    Args:
        config: The configuration.

    Returns:
        The content of echoscape.json, as it is read again: with lists for tuples.
    """
    return {
        "format": FORMAT,
        "config": config_content(config),
        "versions": _versions(),
        "classes": list(CLASSES),
        "components": [component.name.lower() for component in Component],
        "materials": list(MATERIALS),
    }


def difference(old: dict[str, Any], new: dict[str, Any]) -> str | None:
    """Name the first entry in which two manifests differ.

    Args:
        old: Content of an echoscape.json.
        new: The content that it is compared with.

    Returns:
        A sentence, None where they are equal. Entries of lists are counted from 0: targets[1].position_m[2].
    """
    return _difference("", old, new)


def version_difference(content: dict[str, Any]) -> str | None:
    """Name the first version in which this installation differs from the one that made a data set.

    Args:
        content: Content of its echoscape.json.

    Returns:
        A sentence, None where all versions are the same, and so the bytes of a repeated run.
    """
    return _difference("", content.get("versions", {}), _versions())


def _difference(name: str, old: Any, new: Any) -> str | None:
    """Return the first difference in or below the entry `name`."""
    if old == new:
        return None
    shown = name.removeprefix("config.")
    if isinstance(old, dict) and isinstance(new, dict):
        keys = dict.fromkeys((*new, *old))
        inner = [(f"{name}.{key}" if name else key, old.get(key), new.get(key)) for key in keys]
    elif isinstance(old, list) and isinstance(new, list):
        if len(old) != len(new):
            return f"{shown} had {_count(old)}, now it has {len(new)}"
        inner = [(f"{name}[{i}]", *pair) for i, pair in enumerate(zip(old, new, strict=True))]
    else:
        return f"{shown} was {_short(old)}, now it is {_short(new)}"
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
