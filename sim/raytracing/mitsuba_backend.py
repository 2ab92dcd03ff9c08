"""Chooses the Mitsuba variant and Dr.Jit's LLVM; everyone else takes `mi` and `dr` from here.

Dr.Jit loads whatever LLVM the system offers. Some of those abort the process on ordinary kernels, so the
library is chosen before Dr.Jit loads: the user's own `DRJIT_LIBLLVM_PATH`, else the one of
`karellen-llvm-core`.
"""

import ctypes
import importlib.metadata
import logging
import os
from pathlib import Path
from typing import Literal

log = logging.getLogger(__name__)

Device = Literal["cpu", "cuda"]

OLDEST_LLVM = 16
"""Older LLVMs cannot select `llvm.maximum` ("Cannot select: fmaximum") and abort; seen with LLVM 15."""

_LIBRARY_VARIABLE = "DRJIT_LIBLLVM_PATH"
_DEVICE_VARIABLE = "ECHOSCAPE_DEVICE"
_VARIANTS: dict[str, str] = {"cpu": "llvm_ad_mono", "cuda": "cuda_ad_mono"}


class BackendError(RuntimeError):
    """The machine lacks what the ray tracer needs; the message says what to install or set."""


def packaged_llvm() -> Path | None:
    """Return the LLVM library that the package `karellen-llvm-core` installed, or None without it."""
    try:
        files = importlib.metadata.files("karellen-llvm-core") or []
    except importlib.metadata.PackageNotFoundError:
        return None
    found = [Path(str(file.locate())).resolve() for file in files if file.name.startswith("libLLVM")]
    return next((path for path in sorted(found) if path.exists()), None)


def llvm_major_version(library: Path) -> int:
    """Ask an LLVM library for its major version through its C interface.

    Raises:
        BackendError: the file cannot be loaded or is no LLVM.
    """
    try:
        handle = ctypes.CDLL(str(library))
    except OSError as error:
        raise BackendError(f"{_LIBRARY_VARIABLE}: cannot load {library}: {error}") from error
    if not hasattr(handle, "LLVMGetVersion"):
        # The call is there from LLVM 16 on: what lacks it is older, or is no LLVM at all.
        raise BackendError(
            f"{library} is no LLVM, or one older than {OLDEST_LLVM}, which aborts on ordinary kernels; "
            f"install karellen-llvm-core or point {_LIBRARY_VARIABLE} at a newer libLLVM.so"
        )
    major = ctypes.c_uint()
    handle.LLVMGetVersion(ctypes.byref(major), None, None)
    return major.value


def choose_llvm() -> Path | None:
    """Set `DRJIT_LIBLLVM_PATH` to an LLVM that works, and return it (None: Dr.Jit searches by itself).

    Raises:
        BackendError: the library is known to abort, or there is none.
    """
    own = os.environ.get(_LIBRARY_VARIABLE)
    library = Path(own) if own else packaged_llvm()
    if library is None:
        if os.uname().sysname == "Linux":
            raise BackendError(
                "no LLVM to compile ray-tracing kernels with: install karellen-llvm-core (Linux x86-64) or "
                f"set {_LIBRARY_VARIABLE} to a libLLVM.so of version {OLDEST_LLVM} or newer"
            )
        return None
    version = llvm_major_version(library)
    if version < OLDEST_LLVM:
        raise BackendError(
            f"LLVM {version} ({library}) aborts on ordinary kernels; version {OLDEST_LLVM} or newer is "
            f"needed: install karellen-llvm-core or point {_LIBRARY_VARIABLE} at a newer libLLVM.so"
        )
    os.environ[_LIBRARY_VARIABLE] = str(library)
    return library


def requested_device() -> Device:
    """Return the device that the environment variable `ECHOSCAPE_DEVICE` asks for: "cpu" (default) or "cuda".

    Raises:
        BackendError: another value.
    """
    device = os.environ.get(_DEVICE_VARIABLE, "cpu")
    if device == "cpu" or device == "cuda":
        return device
    raise BackendError(f"{_DEVICE_VARIABLE} must be cpu or cuda, got {device!r}")


_DEVICE = requested_device()
if _DEVICE == "cpu":
    choose_llvm()

import drjit as dr  # noqa: E402
import mitsuba as mi  # noqa: E402

if _DEVICE == "cuda" and not dr.has_backend(dr.JitBackend.CUDA):
    raise BackendError(f"{_DEVICE_VARIABLE}=cuda, but no CUDA device is there")
mi.set_variant(_VARIANTS[_DEVICE])


def _check_loaded_llvm() -> None:
    """Refuse an LLVM that aborts: Dr.Jit may have been imported, and have chosen one, before us.

    Raises:
        BackendError: Dr.Jit has loaded an LLVM that is too old.
    """
    major = dr.detail.llvm_version()[0]
    if 0 < major < OLDEST_LLVM:
        raise BackendError(
            f"Dr.Jit has already loaded LLVM {major}, which aborts on ordinary kernels: import echoscape "
            f"before drjit or mitsuba, or set {_LIBRARY_VARIABLE} to a libLLVM.so of version {OLDEST_LLVM} "
            "or newer"
        )


if _DEVICE == "cpu":
    _check_loaded_llvm()


def set_threads(count: int) -> None:
    """Let Dr.Jit use `count` threads in this process; results do not depend on it.

    Raises:
        ValueError: `count` is below 1.
    """
    if count < 1:
        raise ValueError(f"count must be 1 or more, got {count}")
    if _DEVICE == "cpu":
        dr.set_thread_count(count)


__all__ = ["BackendError", "choose_llvm", "dr", "mi", "requested_device", "set_threads"]
