"""The command in a pipe: a reader that goes away, as `head` does, ends it quietly."""

import os
import signal
import subprocess
import sys
from pathlib import Path

import pytest

from echoscape.cli import __main__ as command
from tests.paths import ROOT

YARD = str(ROOT / "examples" / "yard.toml")
SIGPIPE_EXIT = 128 + signal.SIGPIPE
"""The exit code of a command that SIGPIPE ended."""


@pytest.mark.parametrize("unbuffered", ["", "1"])
@pytest.mark.parametrize("words", [["--help"], ["simulate", "--help"], ["scene", "OUT", "--scene", YARD]])
def test_a_closed_output_ends_the_command_quietly(tmp_path: Path, words: list[str], unbuffered: str) -> None:
    reader, writer = os.pipe()
    os.close(reader)
    try:
        done = subprocess.run(
            [sys.executable, "-m", "echoscape.cli.__main__", *words],
            stdout=writer,
            stderr=subprocess.PIPE,
            text=True,
            cwd=tmp_path,
            env=os.environ | {"PYTHONUNBUFFERED": unbuffered},
            check=False,
        )
    finally:
        os.close(writer)
    assert done.returncode == SIGPIPE_EXIT
    assert "Traceback" not in done.stderr
    assert "BrokenPipe" not in done.stderr


def test_another_broken_pipe_is_no_reader_gone(monkeypatch: pytest.MonkeyPatch) -> None:
    def lose_worker(name: str) -> None:
        raise BrokenPipeError("a worker's pipe")

    monkeypatch.setattr(command, "import_module", lose_worker)
    with pytest.raises(BrokenPipeError, match="a worker's pipe"):
        command.main(["scene"])
