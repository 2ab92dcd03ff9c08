"""What all tests share: the test process gives freed memory back, whatever commands it runs."""

import pytest


@pytest.fixture(autouse=True, scope="session")
def memory_is_given_back() -> None:
    """Commands keep freed memory for good; in one process with 2,000 tests that adds up to gigabytes."""
    pytest.MonkeyPatch().setattr("echoscape.sim.heap.keep_freed_memory", lambda: True)
