"""The example of somebody else's project passes its tests, which use the fixtures and a golden scan."""

import shutil
import subprocess
import sys
from pathlib import Path

from tests.paths import ROOT

PROJECT = ROOT / "examples" / "foreign_project"


def test_the_foreign_project_passes_its_tests(tmp_path: Path) -> None:
    project = tmp_path / "project"
    shutil.copytree(PROJECT, project, ignore=shutil.ignore_patterns("__pycache__", "*.difference.png"))
    command = [sys.executable, "-m", "pytest", "-q", "-p", "no:cacheprovider"]
    done = subprocess.run(command, cwd=project, capture_output=True, text=True, check=False, timeout=120)
    assert done.returncode == 0, done.stdout
    assert len(list(project.glob("tests/golden/*/*.png"))) == 1


def test_the_foreign_project_imports_nothing_of_echoscape() -> None:
    sources = [path.read_text() for path in PROJECT.rglob("*.py")]
    assert len(sources) >= 5
    assert not any("import echoscape" in source or "from echoscape" in source for source in sources)
