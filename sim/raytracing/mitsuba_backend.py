"""Loads Dr.Jit and Mitsuba for the selected backend; every other module takes `mi` and `dr` from here."""

from echoscape.sim.raytracing.backend import (
    BACKEND_VARIABLE,
    LLVM_VARIABLE,
    OLDEST_LLVM,
    VARIANTS,
    BackendChoiceError,
    BackendError,
    choose_llvm,
    selected_backend,
)

_BACKEND = selected_backend()
if _BACKEND == "llvm":
    choose_llvm()

import drjit as dr  # noqa: E402
import mitsuba as mi  # noqa: E402

if _BACKEND == "cuda" and not dr.has_backend(dr.JitBackend.CUDA):
    raise BackendChoiceError(f"{BACKEND_VARIABLE} must be llvm on this machine: no CUDA device was found")
mi.set_variant(VARIANTS[_BACKEND])


def _check_loaded_llvm() -> None:
    """Refuse an LLVM that aborts: Dr.Jit may have been imported, and have chosen one, before this module.

    Raises:
        BackendError: Dr.Jit has loaded an LLVM that is too old.
    """
    major = dr.detail.llvm_version()[0]
    if 0 < major < OLDEST_LLVM:
        raise BackendError(
            f"Dr.Jit has already loaded LLVM {major}, which aborts on ordinary kernels: import echoscape "
            f"before drjit or mitsuba, or set {LLVM_VARIABLE} to a libLLVM.so of version {OLDEST_LLVM} "
            "or newer"
        )


if _BACKEND == "llvm":
    _check_loaded_llvm()


def set_threads(count: int) -> None:
    """Set the number of threads that Dr.Jit uses in this process; results do not depend on it.

    Args:
        count: Number of threads; has no effect on CUDA.

    Raises:
        ValueError: `count` is below 1.
    """
    if count < 1:
        raise ValueError(f"count must be 1 or more, got {count}")
    if _BACKEND == "llvm":
        dr.set_thread_count(count)


__all__ = ["dr", "mi", "set_threads"]
