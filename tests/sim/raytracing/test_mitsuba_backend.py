"""Loading Mitsuba: an unsuitable LLVM or backend is refused with what to do, before anything else happens."""

import os
import subprocess
import sys

import pytest


def _python(code: str, **environment: str) -> subprocess.CompletedProcess[str]:
    return subprocess.run(
        [sys.executable, "-c", code],
        env={**os.environ, **environment},
        capture_output=True,
        text=True,
        timeout=120,
        check=False,
    )


linux = pytest.mark.skipif(not sys.platform.startswith("linux"), reason="names of Linux libraries")


@linux
def test_library_that_is_no_llvm_is_refused_with_what_to_do() -> None:
    done = _python("import echoscape.sim.raytracing.mitsuba_backend", DRJIT_LIBLLVM_PATH="libc.so.6")
    assert done.returncode != 0
    assert "libc.so.6 is no LLVM, or one older than 16" in done.stderr
    assert "install karellen-llvm-core or point DRJIT_LIBLLVM_PATH" in done.stderr


@linux
def test_command_reports_a_bad_llvm_in_one_line() -> None:
    code = "from echoscape.cli.__main__ import main; raise SystemExit(main(['simulate', 'nowhere']))"
    done = _python(code, DRJIT_LIBLLVM_PATH="libc.so.6")
    assert done.returncode == 1
    assert done.stderr.startswith("echoscape simulate: libc.so.6 is no LLVM")
    assert "Traceback" not in done.stderr


def test_library_that_is_not_there_is_refused_by_name() -> None:
    done = _python("import echoscape.sim.raytracing.mitsuba_backend", DRJIT_LIBLLVM_PATH="no/such/libLLVM.so")
    assert done.returncode != 0
    assert "cannot load no/such/libLLVM.so" in done.stderr


def test_unknown_backend_is_refused_by_name() -> None:
    done = _python("import echoscape.sim.raytracing.mitsuba_backend", ECHOSCAPE_BACKEND="abacus")
    assert done.returncode != 0
    assert "ECHOSCAPE_BACKEND must be llvm or cuda, got 'abacus'" in done.stderr


@pytest.mark.parametrize("count", [0, -1])
def test_fewer_than_one_thread_is_refused(count: int) -> None:
    from echoscape.sim.raytracing.mitsuba_backend import set_threads

    with pytest.raises(ValueError, match="count must be 1 or more"):
        set_threads(count)
