"""The choice of backend and LLVM: made before Mitsuba is loaded, inherited by workers."""

import multiprocessing
import os
import sys

import pytest

from echoscape.sim.raytracing import backend
from echoscape.sim.raytracing.backend import (
    BACKEND_VARIABLE,
    Backend,
    BackendError,
    selected_backend,
    use_backend,
)


@pytest.fixture(autouse=True)
def _environment(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv(BACKEND_VARIABLE, "llvm")  # restored afterwards, whatever a test sets


def _selected_in_worker() -> str:
    with multiprocessing.get_context("spawn").Pool(1) as pool:
        return pool.apply(selected_backend)


def test_llvm_is_the_default(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.delenv(BACKEND_VARIABLE)
    assert selected_backend() == "llvm"


def test_unknown_backend_in_the_environment_is_refused(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv(BACKEND_VARIABLE, "cpu")
    with pytest.raises(BackendError, match="ECHOSCAPE_BACKEND must be llvm or cuda, got 'cpu'"):
        selected_backend()


def test_unknown_backend_is_refused_by_name() -> None:
    with pytest.raises(ValueError, match="backend must be llvm or cuda, got 'metal'"):
        use_backend("metal")  # pyright: ignore[reportArgumentType]


def test_workers_inherit_the_choice(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.delitem(sys.modules, "mitsuba", raising=False)
    use_backend("cuda")
    assert os.environ[BACKEND_VARIABLE] == "cuda"
    assert _selected_in_worker() == "cuda"


def test_choice_is_refused_once_mitsuba_runs_on_another_variant() -> None:
    from echoscape.sim.raytracing.mitsuba_backend import mi

    running: Backend = "llvm" if mi.variant() == "llvm_ad_mono" else "cuda"
    other: Backend = "cuda" if running == "llvm" else "llvm"
    use_backend(running)  # the one that runs may be selected again
    with pytest.raises(BackendError, match=f"backend {other} is selected too late"):
        use_backend(other)
    assert selected_backend() == running


def test_users_library_is_respected(monkeypatch: pytest.MonkeyPatch) -> None:
    packaged = backend.packaged_llvm()
    if packaged is None:
        pytest.skip("no packaged LLVM")
    given = packaged.parent / ".." / packaged.parent.name / packaged.name  # the same file under another name
    monkeypatch.setenv(backend.LLVM_VARIABLE, str(given))
    assert backend.choose_llvm() == given
    assert os.environ[backend.LLVM_VARIABLE] == str(given)


def test_version_is_asked_of_the_library(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv(backend.LLVM_VARIABLE, "libLLVM-15.so")
    monkeypatch.setattr(backend, "llvm_major_version", lambda library: 15)
    with pytest.raises(BackendError, match=r"LLVM 15 \(libLLVM-15\.so\) aborts"):
        backend.choose_llvm()
