"""README.md: its Python examples run and print what they say, and linked files exist."""

import re
import subprocess
import sys
from pathlib import Path

from tests.paths import ROOT

README = (ROOT / "README.md").read_text()

EXAMPLES = re.findall(r"```python\n(.*?)```", README, re.DOTALL)


def test_examples_are_short() -> None:
    assert max(len(example.strip().splitlines()) for example in EXAMPLES) < 12


def test_the_example_of_a_test_passes(tmp_path: Path) -> None:
    (example,) = (example for example in EXAMPLES if example.startswith("def test_"))
    (tmp_path / "test_readme_example.py").write_text(example)
    command = [sys.executable, "-m", "pytest", "-q", "-p", "no:cacheprovider"]
    done = subprocess.run(command, cwd=tmp_path, capture_output=True, text=True, check=False, timeout=120)
    assert done.returncode == 0, done.stdout


def test_python_examples_run_in_order_and_print_what_they_say(tmp_path: Path) -> None:
    examples = [example for example in EXAMPLES if not example.startswith("def test_")]
    assert len(examples) == 4
    prose = re.sub(r"```.*?```", "", README, flags=re.DOTALL)
    assert not re.search(r"^ {4}\S", prose, re.MULTILINE)  # code outside of blocks would not be run
    continued = [example for example in examples if "import echoscape\n" not in example]
    assert all("with_targets(town," in example for example in continued)  # in the same town, says the text
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
