"""docs/tutorials: the code of every page runs in order, prints what the page shows and draws its pictures.

A page is run in a folder that holds only `EXAMPLES`. Blocks of Python share one session, and their comments
after `print` are what they print. Lines of a console block after `$` are commands; the others are their
output, in which `...` stands for anything. A block that begins with the name of a file as a comment is that
file.

With ECHOSCAPE_TUTORIAL_FIGURES=1 the pictures beside the pages are replaced by those that their code draws.
"""

import contextlib
import io
import os
import re
import shutil
import subprocess
import sys
from collections.abc import Iterator
from doctest import ELLIPSIS, NORMALIZE_WHITESPACE, OutputChecker
from pathlib import Path
from typing import Any

import pytest
from PIL import Image

from tests.paths import ROOT

PAGES = ROOT / "docs" / "tutorials"
EXAMPLES = ("yard.obj", "yard.toml")
"""Files of examples/ that pages use."""
SLOW = ("ablation", "training")
"""Pages that take more than some ten seconds."""
NAMES = [
    pytest.param(page.stem, marks=[pytest.mark.slow] if page.stem in SLOW else [])
    for page in sorted(PAGES.glob("*.md"))
]
_BLOCK = re.compile(r"^```(\w+)\n(.*?)^```$", re.MULTILINE | re.DOTALL)
_FILE = re.compile(r"# (\w+\.\w+)\n")
_LARGEST_FIGURE = 200_000


class Session:
    """What the reader of a page has: a folder, and an interpreter that goes on from block to block."""

    def __init__(self, folder: Path) -> None:
        self.folder = folder
        self.names: dict[str, Any] = {"__name__": "__main__"}

    def run(self, language: str, text: str) -> None:
        """Run a block and compare what it prints with what the page shows."""
        file = _FILE.match(text)
        if file:
            (self.folder / file[1]).write_text(text)
        elif language == "python":
            self._python(text)
        elif language == "console":
            for command, shown in _commands(text):
                self._command(command, shown)

    def _python(self, code: str) -> None:
        printed = io.StringIO()
        with contextlib.chdir(self.folder), contextlib.redirect_stdout(printed):
            exec(compile(code, "<page>", "exec"), self.names)
        shown = re.findall(r"^print\(.*\)  # (.*)$", code, re.MULTILINE)
        assert printed.getvalue().splitlines() == shown, f"{code} printed\n{printed.getvalue()}"

    def _command(self, command: str, shown: str) -> None:
        path = os.pathsep.join([str(Path(sys.executable).parent), os.environ["PATH"]])
        done = subprocess.run(
            command,
            shell=True,
            cwd=self.folder,
            env={**os.environ, "PATH": path, "COLUMNS": "100"},
            stdout=subprocess.PIPE,
            stderr=subprocess.STDOUT,  # as on a terminal
            text=True,
            check=False,
            timeout=600,
        )
        assert done.returncode == 0, f"{command}\n{done.stdout}"
        same = OutputChecker().check_output(shown, done.stdout, ELLIPSIS | NORMALIZE_WHITESPACE)
        assert same or not shown, f"{command} printed\n{done.stdout}\nand the page shows\n{shown}"


def _commands(text: str) -> Iterator[tuple[str, str]]:
    """Split a console block into commands and the output shown for each, empty where none is shown."""
    for part in re.split(r"^\$ ", text, flags=re.MULTILINE)[1:]:
        whole = re.sub(r"\\\n\s*", "", part)
        command, _, shown = whole.partition("\n")
        yield command, shown


def _blocks(page: str) -> list[tuple[str, str]]:
    return _BLOCK.findall(page)


def _figures(page: str) -> list[str]:
    return re.findall(r"!\[[^\]]+\]\(([^)]+)\)", page)


def _write_small(drawn: Path, to: Path) -> None:
    """Write a copy of a picture in 128 colours, which has some third of the bytes."""
    with Image.open(drawn) as image:
        image.convert("RGB").quantize(128, Image.Quantize.MAXCOVERAGE).save(to, optimize=True)


@pytest.fixture
def session(tmp_path: Path, no_screen: None) -> Session:
    (tmp_path / "examples").mkdir()
    for name in EXAMPLES:
        shutil.copy(ROOT / "examples" / name, tmp_path / "examples")
    return Session(tmp_path)


@pytest.mark.parametrize("name", NAMES)
def test_the_code_of_a_page_runs_and_prints_what_it_says(name: str, session: Session) -> None:
    page = (PAGES / f"{name}.md").read_text()
    blocks = _blocks(page)
    assert len(blocks) == page.count("\n```") / 2  # each is seen
    for language, text in blocks:
        session.run(language, text)
    assert _figures(page)
    for figure in _figures(page):
        drawn, shown = session.folder / figure, PAGES / figure
        if os.environ.get("ECHOSCAPE_TUTORIAL_FIGURES"):
            _write_small(drawn, shown)
        with Image.open(drawn) as now, Image.open(shown) as then:
            assert now.size == then.size
        assert shown.stat().st_size < _LARGEST_FIGURE


@pytest.mark.parametrize(
    ("language", "text"),
    [
        ("python", "print(6 * 7)  # 41\n"),
        ("python", "print(6 * 7)\n"),
        ("python", "x = 1  # nothing\nraise ValueError(x)\n"),
        ("console", "$ echo 42\n41\n"),
        ("console", "$ echo 42; exit 3\n"),
        ("console", "$ echo 42\n$ cat absent\n"),
    ],
)
def test_a_page_that_says_something_else_fails(language: str, text: str, session: Session) -> None:
    with pytest.raises((AssertionError, ValueError)):
        session.run(language, text)


def test_blocks_share_files_and_names(session: Session) -> None:
    session.run("python", "# part.py\nVALUE = 6\n")
    session.run("python", "from pathlib import Path\nvalue = int(Path('part.py').read_text().split()[-1])\n")
    session.run("python", "print(7 * value)  # 42\n")
    session.run("console", "$ echo one \\\n      two; tail -n 1 part.py\none two\nVALUE = ...\n")
