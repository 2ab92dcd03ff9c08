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
NOBODY_READS = 128 + signal.SIGPIPE
"""What a shell says of a command that SIGPIPE ended."""


@pytest.mark.parametrize("unbuffered", ["", "1"])
@pytest.mark.parametrize("words", [["--help"], ["simulate", "--help"], ["scene", "OUT", "--scene", YARD]])
def test_output_that_nobody_reads_ends_the_command_quietly(
    tmp_path: Path, words: list[str], unbuffered: str
) -> None:
    reader, writer = os.pipe()
    os.close(reader)
    try:
        told = subprocess.run(
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
    assert told.returncode == NOBODY_READS
    assert "Traceback" not in told.stderr
    assert "BrokenPipe" not in told.stderr


def test_another_broken_pipe_is_no_reader_gone(monkeypatch: pytest.MonkeyPatch) -> None:
    def lose_worker(name: str) -> None:
        raise BrokenPipeError("a worker's pipe")

    monkeypatch.setattr(command, "import_module", lose_worker)
    with pytest.raises(BrokenPipeError, match="a worker's pipe"):
        command.main(["scene"])
