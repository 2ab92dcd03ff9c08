"""The machine that values were measured on."""

import os
import platform
from importlib.metadata import version
from pathlib import Path


def description() -> str:
    """Describe processor, cores, Python and the packages that matter, in one line.

    Returns:
        The text.
    """
    model = platform.processor() or platform.machine()
    if Path("/proc/cpuinfo").exists():
        lines = Path("/proc/cpuinfo").read_text().splitlines()
        model = next((line.split(":")[1].strip() for line in lines if line.startswith("model name")), model)
    packages = ", ".join(f"{name} {version(name)}" for name in ("numpy", "mitsuba", "drjit"))
    return f"{model}, {os.cpu_count()} cores, Python {platform.python_version()}, {packages}"
