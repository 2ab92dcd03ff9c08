"""The public names: imported on first use, typed, and listed in docs/api.md, whose examples run."""

import ast
import json
import os
import re
import subprocess
import sys
from importlib import import_module
from pathlib import Path

import pytest

import echoscape
from tests.paths import ROOT

HEAVY = ("torch", "drjit", "mitsuba", "matplotlib")
PACKAGES = (
    "echoscape",
    "echoscape.scenes",
    "echoscape.sim",
    "echoscape.learn",
    "echoscape.eval",
    "echoscape.testing",
)
NAMES = [f"{package}.{name}" for package in PACKAGES for name in import_module(package).__all__]
PAGE = (ROOT / "docs" / "api.md").read_text()


def _loaded_by(code: str) -> set[str]:
    """Return the top-level modules that a fresh interpreter has loaded after some code."""
    report = "; import sys, json; print(json.dumps(sorted({name.split('.')[0] for name in sys.modules})))"
    command = [sys.executable, "-c", code + report]
    done = subprocess.run(command, capture_output=True, text=True, check=True, timeout=60, cwd="/")
    return set(json.loads(done.stdout))


def _example(package: str) -> str:
    """Return the only Python block in the section of a package."""
    section = PAGE.partition(f"\n## {package}\n")[2].partition("\n## ")[0]
    (block,) = re.findall(r"```python\n(.*?)```", section, re.DOTALL)
    return block


@pytest.mark.parametrize("package", PACKAGES)
def test_the_example_of_a_package_runs_by_itself(package: str, tmp_path: Path) -> None:
    done = subprocess.run(
        [sys.executable, "-W", "error", "-c", _example(package)],
        cwd=tmp_path,
        env={**os.environ, "OMP_NUM_THREADS": "1"},  # PyTorch's threads would wait for those of other tests
        capture_output=True,
        text=True,
        check=False,
        timeout=120,
    )
    assert done.returncode == 0, done.stderr
    assert done.stdout


@pytest.mark.parametrize("package", [*PACKAGES, "echoscape.cli"])
def test_importing_a_package_loads_nothing_heavy(package: str) -> None:
    assert _loaded_by(f"import {package}").isdisjoint((*HEAVY, "numpy"))


@pytest.mark.parametrize(
    "name", ["Artefacts", "Sensor", "PolarScan", "EchoFilter", "open_folder", "kitti_drift"]
)
def test_names_that_trace_no_rays_load_neither_ray_tracer_nor_torch(name: str) -> None:
    assert _loaded_by(f"import echoscape; echoscape.{name}").isdisjoint(HEAVY)


def test_a_name_that_needs_the_ray_tracer_loads_it() -> None:
    assert {"drjit", "mitsuba"} <= _loaded_by("import echoscape; echoscape.Simulator")


@pytest.mark.parametrize("name", NAMES)
def test_every_public_name_is_there_listed_and_shown(name: str) -> None:
    package, _, attribute = name.rpartition(".")
    module = import_module(package)
    assert getattr(module, attribute) is getattr(module, attribute)
    assert attribute in dir(module)
    assert re.search(rf"^\| `{re.escape(name)}` \| \S.* \|$", PAGE, re.MULTILINE)
    assert re.search(rf"\b{attribute}\b", _example(package))


def test_the_page_lists_nothing_else() -> None:
    assert sorted(re.findall(r"^\| `(echoscape\.[\w.]+)` \|", PAGE, re.MULTILINE)) == sorted(NAMES)


@pytest.mark.parametrize("package", PACKAGES)
def test_type_checkers_see_the_names_that_are_imported(package: str) -> None:
    source = Path(str(import_module(package).__file__)).read_text()
    (branch,) = (node for node in ast.parse(source).body if isinstance(node, ast.If))
    typed = set()
    for node in branch.body:
        if isinstance(node, ast.ImportFrom):
            typed |= {alias.asname for alias in node.names if alias.asname == alias.name}
        elif isinstance(node, (ast.Assign, ast.AnnAssign)):
            target = node.target if isinstance(node, ast.AnnAssign) else node.targets[0]
            typed.add(ast.unparse(target))
    assert typed == set(import_module(package).__all__)


def test_unknown_names_are_refused() -> None:
    with pytest.raises(AttributeError, match="'echoscape' has no attribute 'nothing'"):
        getattr(echoscape, "nothing")  # noqa: B009


@pytest.mark.parametrize("name", ["Odometry", "KeypointModel", "learn.ScanPairs", "learn.KeypointDetector"])
def test_without_torch_the_error_says_how_to_install_it(name: str) -> None:
    code = f"import sys; sys.modules['torch'] = None; import echoscape; echoscape.{name}"
    name = name.removeprefix("learn.")
    done = subprocess.run(
        [sys.executable, "-c", code], capture_output=True, text=True, check=False, timeout=60
    )
    assert (
        done.stderr.splitlines()[-1] == f'ImportError: {name} needs PyTorch: pip install "echoscape[learn]"'
    )


def test_no_folder_of_the_checkout_hides_the_package() -> None:
    assert not (ROOT / "echoscape").exists()
    assert (ROOT / "api" / "py.typed").is_file()


@pytest.mark.slow
def test_pyright_sees_real_types(tmp_path: Path) -> None:
    (tmp_path / "use.py").write_text(
        "import echoscape\nimport echoscape.sim\n"
        "reveal_type(echoscape.scan('town', seed=7))\nreveal_type(echoscape.Artefacts(ghosts=0).ghosts)\n"
        "reveal_type(echoscape.sim.write_dataset)\nechoscape.nothing\n"
    )
    command = [Path(sys.executable).with_name("pyright"), "--outputjson", "--pythonpath", sys.executable]
    done = subprocess.run([*command, "use.py"], cwd=tmp_path, capture_output=True, text=True, check=False)
    said = [each["message"] for each in json.loads(done.stdout)["generalDiagnostics"]]
    assert re.search(r'is "PolarScan"$', said[0])
    assert re.search(r'is "float( \| None)?"$', said[1])
    assert re.search(r'is "\(out: Path, config: SimulationConfig', said[2])
    assert '"nothing" is not a known attribute of module "echoscape"' in said[3]
    assert len(said) == 4
