"""docs/scenes.md keeps its word: its examples are read, built and run, and its tables list what there is."""

import re
import shutil
import subprocess
import sys
from pathlib import Path

import pytest

from echoscape.scenes.core.materials import MATERIAL_NAMES
from echoscape.scenes.core.targets import KINDS
from echoscape.scenes.io.target_toml import read_targets
from echoscape.scenes.io.user_scene import CLASS_NAMES, read_user_scene
from echoscape.sim.generation.config import SimulationConfig
from echoscape.sim.generation.setup import build_scene
from tests.paths import ROOT

PAGE = (ROOT / "docs" / "scenes.md").read_text()
SCENE, TARGETS = re.findall(r"```toml\n(.*?)```", PAGE, re.DOTALL)


@pytest.mark.parametrize("rest", ["", TARGETS])
def test_the_scene_of_the_page_can_be_driven_through(tmp_path: Path, rest: str) -> None:
    shutil.copy(ROOT / "examples" / "yard.obj", tmp_path)
    (tmp_path / "page.toml").write_text(SCENE + rest)
    setup = build_scene(SimulationConfig(scene=read_user_scene(tmp_path / "page.toml"), scans=20))
    assert len(setup.scene.targets) == rest.count("[[target]]")


def test_the_targets_of_the_page_can_be_read(tmp_path: Path) -> None:
    (tmp_path / "page.toml").write_text(TARGETS)
    assert len(read_targets(tmp_path / "page.toml")) == 3


def test_the_examples_can_be_used_together() -> None:
    scene = read_user_scene(ROOT / "examples" / "yard.toml")
    targets = read_targets(ROOT / "examples" / "targets.toml")
    assert len(build_scene(SimulationConfig(scene=scene, scans=20, targets=targets)).scene.targets) == 4


def test_the_tables_list_every_kind_material_and_class() -> None:
    for names in (MATERIAL_NAMES, CLASS_NAMES):
        assert f"| {', '.join(names)} |" in PAGE
    for kind, needs in KINDS.items():
        (sizes,) = re.findall(rf"^\| `{kind}` \| (.*?) \|", PAGE, re.MULTILINE)
        assert all(size in sizes for size in needs.sizes)


def test_the_python_example_runs_and_prints_what_it_says(tmp_path: Path) -> None:
    (example,) = re.findall(r"```python\n(.*?)```", PAGE, re.DOTALL)
    shutil.copytree(ROOT / "examples", tmp_path / "examples")
    command = [sys.executable, "-W", "error", "-c", example]
    done = subprocess.run(command, cwd=tmp_path, capture_output=True, text=True, check=False, timeout=300)
    assert done.returncode == 0, done.stderr
    (promised,) = re.findall(r"print\(.*\)  # (.*)", example)
    assert done.stdout.strip() == promised
