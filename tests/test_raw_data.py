"""docs/raw_data.md: its command and its examples run in order and print what they say."""

import re
import shlex
import subprocess
import sys
from pathlib import Path

import pytest

from echoscape.cli.__main__ import main
from tests.paths import ROOT

PAGE = (ROOT / "docs" / "raw_data.md").read_text()


def test_command_and_examples_run_and_print_what_they_say(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)
    (command,) = re.findall(r"```\n(echoscape .*)\n```", PAGE)
    assert main([*shlex.split(command)[1:], "--no-preview", "--trace.rays", "16"]) == 0
    examples = re.findall(r"```python\n(.*?)```", PAGE, re.DOTALL)
    assert len(examples) == 2
    for example in examples:
        (promised,) = re.findall(r"print\(.*\)  # (.*)", example)
        assert set(_printed(example, tmp_path)) == {promised}


def _printed(code: str, folder: Path) -> list[str]:
    """Return the lines that some Python prints."""
    done = subprocess.run(
        [sys.executable, "-W", "error", "-c", code],
        cwd=folder,
        capture_output=True,
        text=True,
        check=False,
        timeout=120,
    )
    assert done.returncode == 0, done.stderr
    return done.stdout.splitlines()
