"""PyTorch for the commands that use it: whether it is installed, and how many threads it takes.

PyTorch is the optional dependency `learn`; nothing here imports it before it is known to be there. By default
it starts a thread on every core, and its threads wait for each other in loops: beside other work on the same
cores that is many times slower than one thread.
"""

import os
from importlib.util import find_spec
from pathlib import Path

_SMT = Path("/sys/devices/system/cpu/smt/active")
_VARIABLE = "OMP_NUM_THREADS"


class MissingTorchError(ValueError):
    """PyTorch is not installed; the message says how to install it."""


def require_torch(use: str) -> None:
    """Check that PyTorch is installed, without importing it.

    Args:
        use: What needs it, for the message.

    Raises:
        MissingTorchError: It is not.
    """
    if find_spec("torch") is None:
        raise MissingTorchError(f'{use} needs PyTorch: pip install "echoscape[learn]"')


def check_threads(threads: int | None) -> None:
    """Check a number of threads.

    Args:
        threads: The number, or None.

    Raises:
        ValueError: It is below 1.
    """
    if threads is not None and threads < 1:
        raise ValueError(f"--threads must be 1 or more, got {threads}")


def use_threads(threads: int) -> None:
    """Set the threads of PyTorch's operators.

    The pool for operators that run side by side ("inter-op") stays as it is: only TorchScript uses it.

    Args:
        threads: Number of threads, 1 or more.
    """
    import torch

    torch.set_num_threads(threads)


def idle_cores() -> int:
    """Count the physical cores that nothing else uses, for work that lasts.

    Returns:
        `OMP_NUM_THREADS` where it is set, as torchrun does; else the cores that this process may use (half of
        the hardware threads where two share a core) less the load of the last minute, at least 1.
    """
    given = os.environ.get(_VARIABLE, "")
    if given.isdecimal() and int(given) > 0:
        return int(given)
    affinity = getattr(os, "sched_getaffinity", None)  # macOS and Windows lack it
    hardware = (os.cpu_count() or 1) if affinity is None else len(affinity(0))
    shared = _SMT.is_file() and _SMT.read_text().strip() == "1"
    load = os.getloadavg()[0] if hasattr(os, "getloadavg") else 0.0
    return max(1, hardware // (2 if shared else 1) - round(load))
