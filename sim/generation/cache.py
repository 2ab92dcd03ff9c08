"""What takes seconds to build, kept in a folder of the user for the next run: towns, and their traffic.

A file is used only where it was made from the same settings by the same code and packages, belongs to the
user and is undamaged; otherwise it is replaced. It holds arrays and JSON (`sim.datasets.files.record_file`)
and can run no code. Without a folder that can be written, everything is built anew.
"""

import hashlib
import json
import logging
import os
import platform
import re
import stat
import threading
import time
from collections.abc import Callable, Mapping
from contextlib import suppress
from functools import lru_cache
from importlib import metadata
from pathlib import Path
from typing import Any, TypeVar

import numpy as np

import echoscape.scenes as scenes
from echoscape.sim.datasets.files.atomic_write import write_atomic
from echoscape.sim.datasets.files.record_file import RecordError, record_bytes, record_of

CACHE_VARIABLE = "ECHOSCAPE_CACHE"
"""Environment variable with the folder of the cache; "off", "0" or nothing switches the cache off."""
MOST_BYTES = 4 * 2**30
"""Largest size of the cache; what was not used for longest is removed first."""
ABANDONED_S = 86_400.0
"""Age at which the temporary file of a process that was killed is removed [s]."""

_LOG = logging.getLogger(__name__)
_OFF = ("", "0", "off")
_PACKAGES = ("echoscape", "numpy", "scipy", "shapely", "trimesh")
_NAME = re.compile(r"[a-z]+-[0-9a-f]{32}\.echoscape")
_TEMPORARY = re.compile(r"\.[a-z]+-[0-9a-f]{32}\.echoscape\.\d+\.part")
_STARTED_NS = time.time_ns()
_STORING = threading.Lock()

T = TypeVar("T")


def cache_folder() -> Path | None:
    """Return the folder of the cache.

    Returns:
        The one that `ECHOSCAPE_CACHE` names, or by default echoscape in `XDG_CACHE_HOME`, else in ~/.cache;
        None where the cache is switched off or the user has no home.
    """
    given = os.environ.get(CACHE_VARIABLE)
    if given is not None:
        return None if given.lower() in _OFF else Path(given).absolute()
    base = Path(os.environ.get("XDG_CACHE_HOME", ""))
    if not base.is_absolute():  # as the XDG base directory specification says
        try:
            base = Path.home() / ".cache"
        except RuntimeError:
            return None
    return base / "echoscape"


def cached(
    name: str,
    kind: Any,
    settings: Mapping[str, Any],
    build: Callable[[], T],
    *,
    code: tuple[str, ...] = ("scenes",),
) -> T:
    """Return what was built before from the same settings, or build and keep it.

    Args:
        name: What is built, in small letters.
        kind: Its type, made of dataclasses, see `sim.datasets.files.record_file`.
        settings: All that decides it, as JSON takes it; numbers may be NumPy's.
        build: Builds it.
        code: Top-level packages whose code builds it.

    Returns:
        What `build` returns or has returned.
    """
    folder, digest = cache_folder(), code_digest(code)
    if folder is None or digest is None:
        return build()
    key = json.dumps(
        {"name": name, "settings": settings, "code": digest, "versions": _versions()},
        sort_keys=True,
        default=plain_number,
    )
    path = folder / f"{name}-{hashlib.sha256(key.encode()).hexdigest()[:32]}.echoscape"
    try:
        return _load(path, kind, key)
    except FileNotFoundError:
        pass
    except (OSError, RecordError) as error:
        _LOG.warning("%s is built again: %s", path, error)
    built = build()
    try:
        with _STORING:
            _store(path, record_bytes(built, kind, key=key))
    except (OSError, RecordError) as error:
        _LOG.warning("%s of this run is not kept in the cache: %s", name, error)
    return built


def plain_number(value: object) -> object:
    """Convert a number of NumPy, which JSON does not take.

    Args:
        value: The number.

    Returns:
        The Python number of this value.

    Raises:
        TypeError: The value is something else.
    """
    if isinstance(value, np.generic):
        return value.item()
    raise TypeError(f"a setting must be made of numbers, words and lists, got {value!r}")


@lru_cache(maxsize=8)
def code_digest(packages: tuple[str, ...] = ("scenes",)) -> str | None:
    """Return a digest of code, so that changed code never reads what older code has built.

    Args:
        packages: Top-level packages with this code.

    Returns:
        SHA-256 of their source files; None, so that nothing is cached, where they cannot be found or are
        newer than this process, which may then run older code.
    """
    folder = Path(str(scenes.__file__)).parent.parent
    digest = hashlib.sha256()
    files = [path for package in packages for path in sorted((folder / package).rglob("*.py"))]
    for path in files:
        if path.stat().st_mtime_ns > _STARTED_NS:
            _LOG.info("nothing is cached: %s is newer than this process", path)
            return None
        source = path.read_bytes()
        digest.update(f"{path.relative_to(folder)} {len(source)}\n".encode())
        digest.update(source)
    return digest.hexdigest() if files else None


@lru_cache(maxsize=1)
def _versions() -> dict[str, str]:
    return {"python": platform.python_version(), **{name: package_version(name) for name in _PACKAGES}}


def package_version(package: str) -> str:
    """Look up the version of a package.

    Args:
        package: Its name.

    Returns:
        The version, "not installed" where there is none.
    """
    try:
        return metadata.version(package)
    except metadata.PackageNotFoundError:  # a checkout that is on the path without having been installed
        return "not installed"


def _load(path: Path, kind: Any, key: str) -> Any:
    """Read a file of the cache; links and files that others can write are refused."""
    # A pipe of this name would otherwise wait for a writer.
    with open(os.open(path, os.O_RDONLY | os.O_NOFOLLOW | os.O_NONBLOCK), "rb") as file:
        state = os.fstat(file.fileno())
        if not stat.S_ISREG(state.st_mode) or state.st_uid != os.geteuid() or state.st_mode & 0o022:
            raise RecordError("is not a file that this user alone can write")
        if state.st_size > MOST_BYTES:
            raise RecordError("is larger than the cache may be")
        data = bytearray(state.st_size)
        if file.readinto(data) != len(data):
            raise RecordError("was cut short while it was read")
        found = record_of(data, kind, key=key)
        with suppress(OSError):
            os.utime(file.fileno())  # the time of its last use, by which files are removed
    return found


def _store(path: Path, data: bytes) -> None:
    path.parent.mkdir(mode=0o700, parents=True, exist_ok=True)
    _make_room(path.parent, len(data))
    write_atomic(path, data)
    path.chmod(0o600)


def _make_room(folder: Path, size: int) -> None:
    """Remove the files that were not used for longest until `size` bytes more are allowed."""
    if size > MOST_BYTES:
        raise RecordError(f"{size} bytes are more than the cache may hold, {MOST_BYTES}")
    found = []
    for path in folder.iterdir():
        try:
            state = path.lstat()
        except FileNotFoundError:  # another process has removed it
            continue
        if _TEMPORARY.fullmatch(path.name) and time.time() - state.st_mtime > ABANDONED_S:
            path.unlink(missing_ok=True)
        elif _NAME.fullmatch(path.name) and stat.S_ISREG(state.st_mode):
            found.append((state.st_mtime_ns, state.st_size, path))
    total = size + sum(each for _, each, _ in found)
    for _, each, path in sorted(found):
        if total <= MOST_BYTES:
            return
        path.unlink(missing_ok=True)
        total -= each
