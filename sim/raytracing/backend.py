"""Which compiler the ray tracer's kernels go through: LLVM (CPU) or CUDA (NVIDIA GPU).

Imports neither Mitsuba nor Dr.Jit, so that the choice can be made before either is loaded. It is kept in an
environment variable, which worker processes inherit.

Dr.Jit loads whatever LLVM the system offers. Some versions abort the process on ordinary kernels, so the
library is chosen before Dr.Jit loads: the user's `DRJIT_LIBLLVM_PATH`, else the one of `karellen-llvm-core`.
"""

import ctypes
import importlib.metadata
import os
import sys
from pathlib import Path
from typing import Literal, cast, get_args

Backend = Literal["llvm", "cuda"]

BACKENDS: tuple[Backend, ...] = get_args(Backend)
BACKEND_VARIABLE = "ECHOSCAPE_BACKEND"
"""Environment variable that holds the choice; "llvm" where it is not set."""
VARIANTS: dict[Backend, str] = {"llvm": "llvm_ad_mono", "cuda": "cuda_ad_mono"}
"""The Mitsuba variant of each backend."""
OLDEST_LLVM = 16
"""Older LLVMs cannot select `llvm.maximum` ("Cannot select: fmaximum") and abort; seen with LLVM 15."""

LLVM_VARIABLE = "DRJIT_LIBLLVM_PATH"


class BackendError(RuntimeError):
    """The machine lacks what the ray tracer needs, or the choice is too late; the message says what to do."""


class BackendChoiceError(BackendError):
    """The selected backend does not exist, or this machine lacks it; the message names what selected it."""


def selected_backend() -> Backend:
    """Return the backend that is selected.

    Returns:
        "llvm" or "cuda", from the environment variable `ECHOSCAPE_BACKEND`; "llvm" where it is not set.

    Raises:
        BackendChoiceError: The variable has another value.
    """
    name = os.environ.get(BACKEND_VARIABLE, "llvm")
    if name not in BACKENDS:
        raise BackendChoiceError(f"{BACKEND_VARIABLE} must be llvm or cuda, got {name!r}")
    return cast("Backend", name)


def use_backend(name: Backend) -> None:
    """Select the backend of this process and of the workers that it starts.

    Call it before the ray tracer is loaded, that is before `echoscape.sim.simulator` is imported.

    Args:
        name: "llvm" or "cuda".

    Raises:
        ValueError: `name` is neither.
        BackendError: Mitsuba already runs on another variant in this process.
    """
    if name not in BACKENDS:
        raise ValueError(f"backend must be llvm or cuda, got {name!r}")
    mitsuba = sys.modules.get("mitsuba")
    variant = mitsuba.variant() if mitsuba is not None else None
    if variant not in (None, VARIANTS[name]):
        raise BackendError(
            f"backend {name} is selected too late: Mitsuba already runs on {variant}; "
            f"call use_backend before the ray tracer is imported, or set {BACKEND_VARIABLE}={name}"
        )
    os.environ[BACKEND_VARIABLE] = name


def packaged_llvm() -> Path | None:
    """Return the LLVM library of the package `karellen-llvm-core`.

    Returns:
        Path of the shared library, None where the package is not installed.
    """
    try:
        files = importlib.metadata.files("karellen-llvm-core") or []
    except importlib.metadata.PackageNotFoundError:
        return None
    found = [Path(str(file.locate())).resolve() for file in files if file.name.startswith("libLLVM")]
    return next((path for path in sorted(found) if path.exists()), None)


def llvm_major_version(library: Path) -> int:
    """Ask an LLVM library for its major version through its C interface.

    Args:
        library: Path of the shared library.

    Returns:
        The major version.

    Raises:
        BackendError: The file cannot be loaded, or is not an LLVM of version 16 or newer.
    """
    try:
        handle = ctypes.CDLL(str(library))
    except OSError as error:
        raise BackendError(f"{LLVM_VARIABLE}: cannot load {library}: {error}") from error
    if not hasattr(handle, "LLVMGetVersion"):
        # LLVM has this call from version 16 on: a library without it is older, or is not LLVM.
        raise BackendError(
            f"{library} is no LLVM, or one older than {OLDEST_LLVM}, which aborts on ordinary kernels; "
            f"install karellen-llvm-core or point {LLVM_VARIABLE} at a newer libLLVM.so"
        )
    major = ctypes.c_uint()
    handle.LLVMGetVersion(ctypes.byref(major), None, None)
    return major.value


def choose_llvm() -> Path | None:
    """Set `DRJIT_LIBLLVM_PATH` to an LLVM that works.

    Returns:
        Path of the library, None where Dr.Jit searches for one (outside Linux).

    Raises:
        BackendError: The library is known to abort, or there is none.
    """
    given = os.environ.get(LLVM_VARIABLE)
    library = Path(given) if given else packaged_llvm()
    if library is None:
        if os.uname().sysname == "Linux":
            raise BackendError(
                "no LLVM to compile ray-tracing kernels with: install karellen-llvm-core (Linux x86-64) or "
                f"set {LLVM_VARIABLE} to a libLLVM.so of version {OLDEST_LLVM} or newer"
            )
        return None
    version = llvm_major_version(library)
    if version < OLDEST_LLVM:
        raise BackendError(
            f"LLVM {version} ({library}) aborts on ordinary kernels; version {OLDEST_LLVM} or newer is "
            f"needed: install karellen-llvm-core or point {LLVM_VARIABLE} at a newer libLLVM.so"
        )
    os.environ[LLVM_VARIABLE] = str(library)
    return library
