"""Settings of all tests: one thread and one cache of towns, and freed memory goes back to the system."""

import os
import shutil
import tempfile
from collections.abc import Iterator
from pathlib import PurePosixPath
from typing import Any

import pytest

# With one process per core, more threads would only wait for each other. PyTorch reads this once.
if "PYTEST_XDIST_WORKER" in os.environ:
    os.environ.setdefault("OMP_NUM_THREADS", "1")
    _CACHE = None
else:
    # The processes of a run share their towns, and neither read nor fill the cache of the user.
    _CACHE = os.environ["ECHOSCAPE_CACHE"] = tempfile.mkdtemp(prefix="echoscape-tests-")

TOGETHER = ("physics", "scenes")
"""Folders whose quick tests run in one process: docs/physics.md needs all laws, and towns are built once."""


@pytest.hookimpl(optionalhook=True)
def pytest_xdist_make_scheduler(config: pytest.Config, log: Any) -> Any:
    """Give the tests of a file to one process, and those of the folders `TOGETHER`, unless they are slow."""
    from xdist.scheduler import LoadScopeScheduling

    folders = () if config.option.markexpr == "slow" else TOGETHER

    class Together(LoadScopeScheduling):
        def _split_scope(self, nodeid: str) -> str:
            path = PurePosixPath(nodeid.partition("::")[0])
            return next((each for each in folders if each in path.parts), str(path))

    return Together(config, log)


def pytest_unconfigure() -> None:
    """Remove the cache with the process that made it."""
    if _CACHE is not None:
        shutil.rmtree(_CACHE, ignore_errors=True)


def pytest_runtest_setup(item: pytest.Item) -> None:
    """Skip tests marked `gpu` where PyTorch finds no CUDA device."""
    if item.get_closest_marker("gpu") and not pytest.importorskip("torch").cuda.is_available():
        pytest.skip("needs a CUDA device")


@pytest.fixture(autouse=True, scope="session")
def memory_is_given_back() -> None:
    """Commands keep freed memory, which in one process with 2,000 tests adds up to gigabytes."""
    pytest.MonkeyPatch().setattr("echoscape.sim.numerics.malloc.keep_freed_memory", lambda: True)


@pytest.fixture
def no_screen() -> Iterator[None]:
    """Let pyplot draw into memory, and forget its figures."""
    from matplotlib import get_backend, pyplot

    before = get_backend()
    pyplot.switch_backend("agg")
    yield
    pyplot.close("all")
    pyplot.switch_backend(before)
