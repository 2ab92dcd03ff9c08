"""What all tests share: freed memory is given back whatever a test runs, and processes share the cores."""

import os
from pathlib import PurePosixPath
from typing import Any

import pytest
from xdist.scheduler import LoadScopeScheduling

TOGETHER = ("physics", "scenes")
"""Folders whose quick tests run in one process: the page of laws sees them all; towns are built once."""


def pytest_configure() -> None:
    """With a process for each core, a second thread in each would only wait for the others."""
    if "PYTEST_XDIST_WORKER" in os.environ:
        os.environ.setdefault("OMP_NUM_THREADS", "1")


class TogetherScheduling(LoadScopeScheduling):
    """Gives a file's tests to one process, and those of some folders."""

    def _split_scope(self, nodeid: str) -> str:
        path = PurePosixPath(nodeid.partition("::")[0])
        folders = () if "not slow" not in self.config.option.markexpr else TOGETHER
        return next((each for each in folders if each in path.parts), str(path))


def pytest_xdist_make_scheduler(config: pytest.Config, log: Any) -> TogetherScheduling:
    return TogetherScheduling(config, log)


@pytest.fixture(autouse=True, scope="session")
def memory_is_given_back() -> None:
    """Commands keep freed memory for good; in one process with 2,000 tests that adds up to gigabytes."""
    pytest.MonkeyPatch().setattr("echoscape.sim.heap.keep_freed_memory", lambda: True)
