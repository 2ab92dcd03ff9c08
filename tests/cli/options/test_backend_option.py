"""--backend: what this machine lacks is refused by the name of what selected it, and nothing is written."""

import os
import subprocess
import sys
from pathlib import Path

import pytest

_WITHOUT_CUDA = "import drjit; drjit.has_backend = lambda backend: False; "
"""Run first: the machine has no CUDA device, whatever it has."""


def _run(folder: Path, command: str, **environment: str) -> subprocess.CompletedProcess[str]:
    words = f"{command} --preset empty --scans 2".split()
    code = f"{_WITHOUT_CUDA}from echoscape.cli.__main__ import main; raise SystemExit(main({words!r}))"
    return subprocess.run(
        [sys.executable, "-c", code],
        cwd=folder,
        env={**os.environ, **environment},
        capture_output=True,
        text=True,
        timeout=120,
        check=False,
    )


@pytest.mark.parametrize("command", ["simulate", "artefacts"])
@pytest.mark.parametrize(
    ("option", "variable", "message"),
    [
        (" --backend cuda", "llvm", "--backend must be llvm on this machine: no CUDA device was found"),
        ("", "cuda", "ECHOSCAPE_BACKEND must be llvm on this machine: no CUDA device was found"),
        ("", "abacus", "ECHOSCAPE_BACKEND must be llvm or cuda, got 'abacus'"),
    ],
)
def test_a_backend_that_is_not_there_is_refused_by_name(
    tmp_path: Path, command: str, option: str, variable: str, message: str
) -> None:
    done = _run(tmp_path, f"{command} OUT{option}", ECHOSCAPE_BACKEND=variable)
    assert (done.returncode, done.stdout) == (2, "")
    assert done.stderr == f"echoscape {command}: {message}\n"
    assert list(tmp_path.iterdir()) == []
