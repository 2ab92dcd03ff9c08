"""README.md: its Python examples run and print what they say, and linked files exist."""

import re
import subprocess
import sys
from pathlib import Path

from tests.paths import ROOT

README = (ROOT / "README.md").read_text()


def test_python_examples_run_in_order_and_print_what_they_say(tmp_path: Path) -> None:
    examples = re.findall(r"```python\n(.*?)```", README, re.DOTALL)
    assert len(examples) == 4
    assert max(len(example.strip().splitlines()) for example in examples) < 12
    prose = re.sub(r"```.*?```", "", README, flags=re.DOTALL)
    assert not re.search(r"^ {4}\S", prose, re.MULTILINE)  # code outside of blocks would not be run
    code = "".join(examples)
    done = subprocess.run(
        [sys.executable, "-W", "error", "-c", code],
        cwd=tmp_path,
        capture_output=True,
        text=True,
        check=False,
        timeout=300,
    )
    assert done.returncode == 0, done.stderr
    promised = re.findall(r"print\(.*\)  # (.*)", code)
    assert len(promised) == len(examples)
    assert done.stdout.splitlines() == promised


def test_linked_files_exist() -> None:
    links = re.findall(r"\]\((?!http)([^)#]+)\)", README) + re.findall(r'src="(?!http)([^"]+)"', README)
    assert links
    assert [link for link in links if not (ROOT / link).exists()] == []


def test_preview_is_small() -> None:
    assert (ROOT / "docs" / "preview.png").stat().st_size < 500_000
