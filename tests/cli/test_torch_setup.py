"""PyTorch for commands: threads by default are those of cores that nothing else uses."""

import os

import pytest

from echoscape.cli import torch_setup
from echoscape.cli.torch_setup import MissingTorchError, idle_cores, require_torch


@pytest.fixture
def machine(monkeypatch: pytest.MonkeyPatch):
    """Set the hardware threads, whether two share a core, and the load."""

    def set_to(hardware: int, shared: str, load: float) -> None:
        monkeypatch.delenv("OMP_NUM_THREADS", raising=False)
        monkeypatch.setattr(os, "sched_getaffinity", lambda process: set(range(hardware)), raising=False)
        monkeypatch.setattr(os, "getloadavg", lambda: (load, 9.0, 9.0), raising=False)

        class Smt:
            is_file = staticmethod(lambda: shared != "absent")
            read_text = staticmethod(lambda: f"{shared}\n")

        monkeypatch.setattr(torch_setup, "_SMT", Smt)

    return set_to


@pytest.mark.parametrize(
    ("hardware", "shared", "load", "expected"),
    [
        (16, "0", 0.2, 16),
        (16, "1", 0.2, 8),
        (16, "absent", 3.4, 13),
        (16, "1", 3.6, 4),
        (2, "0", 1.2, 1),
        (2, "0", 40.0, 1),
        (1, "1", 0.0, 1),
    ],
)
def test_idle_cores_are_physical_cores_less_the_load(
    machine, hardware: int, shared: str, load: float, expected: int
) -> None:
    machine(hardware, shared, load)
    assert idle_cores() == expected


def test_the_environment_decides_where_it_has_a_number(machine, monkeypatch: pytest.MonkeyPatch) -> None:
    machine(16, "0", 0.0)
    for text, expected in (("3", 3), ("", 16), ("0", 16), ("4,2", 16)):
        monkeypatch.setenv("OMP_NUM_THREADS", text)
        assert idle_cores() == expected


def test_torch_that_is_absent_is_asked_for_by_the_name_of_its_extra(monkeypatch: pytest.MonkeyPatch) -> None:
    require_torch("train")
    monkeypatch.setattr(torch_setup, "find_spec", lambda name: None)
    with pytest.raises(MissingTorchError, match=r'^train needs PyTorch: pip install "echoscape\[learn\]"$'):
        require_torch("train")
