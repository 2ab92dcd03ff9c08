"""Scans for tests in memory and on disk: what was simulated once is found again, and cannot be written to.

A kept scan is used only where the same code, packages and compiler made it (`sim.generation.cache`). It loads
without the ray tracer.
"""

import json
import platform
from collections.abc import Callable, Mapping, Sequence
from dataclasses import asdict, fields, is_dataclass
from functools import lru_cache
from pathlib import Path
from typing import Any, TypeVar

import numpy as np

from echoscape.sim.generation.cache import cached, package_version, plain_number
from echoscape.testing.settings import ScanSettings

_CODE = ("scenes", "sim", "testing")
_TRACER = ("drjit", "mitsuba", "karellen-llvm-core")
_MEMORY: dict[str, Any] = {}
"""What was asked for in this process, the last one at the end."""
MOST_BYTES = 256 * 2**20
"""Size up to which scans stay in memory [bytes]: a hundred small ones, or a few of the CTS350-X."""

Record = TypeVar("Record")


def kept(name: str, kind: Any, settings: Mapping[str, Any], build: Callable[[], Record]) -> Record:
    """Return what was made of the same settings before, or make and keep it.

    Args:
        name: What is made, in small letters.
        kind: Its type, a dataclass.
        settings: All that decides it, as JSON takes it; numbers may be NumPy's.
        build: Makes it.

    Returns:
        The record; its arrays cannot be written to, so that one test cannot change the scan of another.
    """
    key = json.dumps([name, settings], sort_keys=True, default=plain_number)
    if key in _MEMORY:
        found = _MEMORY.pop(key)
    else:
        found = _read_only(cached(name, kind, {**settings, "tracer": _tracer()}, build, code=_CODE))
    _MEMORY[key] = found
    _forget_oldest()
    return found


def _forget_oldest() -> None:
    """Forget what was not asked for longest, so that many large scans do not fill the memory."""
    sizes = {key: _size(each) for key, each in _MEMORY.items()}
    total = sum(sizes.values())
    for key in list(sizes)[:-1]:
        if total <= MOST_BYTES:
            return
        del _MEMORY[key]
        total -= sizes[key]


def _size(record: Any) -> int:
    """Return the size of the arrays of a record [bytes]."""
    if isinstance(record, np.ndarray):
        return record.nbytes
    if not is_dataclass(record):
        return 0
    return sum(_size(getattr(record, each.name)) for each in fields(record))


def settings_content(settings: ScanSettings, names: Sequence[str]) -> dict[str, Any]:
    """Convert settings to JSON; a sensor's file counts by what it says.

    Args:
        settings: The settings.
        names: Those that count.

    Returns:
        Their values by name, as JSON takes them but for NumPy's numbers.

    Raises:
        ValueError: The sensor's file cannot be read or describes none.
    """
    content = {name: _plain(getattr(settings, name)) for name in names}
    if isinstance(settings.sensor, str) and settings.sensor.endswith(".toml"):
        from echoscape.sim.sensor.registry import sensor_from

        content["sensor"] = asdict(sensor_from(settings.sensor))
    return content


@lru_cache(maxsize=1)
def _tracer() -> dict[str, str]:
    """Return what compiles the ray tracer's kernels, and for which machine."""
    from echoscape.sim.raytracing.backend import choose_llvm, selected_backend

    backend = selected_backend()
    library = choose_llvm() if backend == "llvm" else None
    llvm = "none" if library is None else Path(library).resolve().name
    versions = {name: package_version(name) for name in _TRACER}
    return {**versions, "backend": backend, "llvm": llvm, "machine": platform.machine()}


def _plain(value: Any) -> Any:
    """Return a setting without classes of one's own."""
    if is_dataclass(value) and not isinstance(value, type):
        return asdict(value)
    return dict(value) if isinstance(value, Mapping) else value


def _read_only(record: Record) -> Record:
    """Forbid writing to the arrays of a record."""
    for each in fields(record):  # pyright: ignore[reportArgumentType]
        value = getattr(record, each.name)
        if isinstance(value, np.ndarray):
            value.setflags(write=False)
        elif is_dataclass(value):
            _read_only(value)
    return record
