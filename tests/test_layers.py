"""The house: imports go scenes -> sim -> learn -> eval -> cli, and every module says what it is for."""

import ast
from pathlib import Path

import pytest

from tests.paths import ROOT

LAYERS = ("scenes", "sim", "learn", "eval", "cli")
MODULES = sorted(path for layer in LAYERS for path in (ROOT / layer).rglob("*.py"))


def _imported(tree: ast.AST) -> set[str]:
    """The layers that a module imports, at its top or inside a function."""
    names: list[str] = []
    for node in ast.walk(tree):
        if isinstance(node, ast.Import):
            names += [alias.name for alias in node.names]
        elif isinstance(node, ast.ImportFrom) and node.module:
            names += [f"{node.module}.{alias.name}" for alias in node.names]
    return {name.split(".")[1] for name in names if name.startswith("echoscape.")}


@pytest.mark.parametrize("path", MODULES, ids=lambda path: str(path.relative_to(ROOT)))
def test_module_imports_only_what_flows_towards_it_and_says_its_job(path: Path) -> None:
    tree = ast.parse(path.read_text())
    own = LAYERS.index(path.relative_to(ROOT).parts[0])
    assert _imported(tree) <= set(LAYERS[: own + 1])
    assert ast.get_docstring(tree)


def test_there_are_modules_to_look_at() -> None:
    assert len(MODULES) > 50


def test_imports_are_seen_wherever_they_stand() -> None:
    source = (
        "def f():\n    from echoscape.cli import simulate\nimport echoscape.sim.simulator\nimport numpy\n"
    )
    assert _imported(ast.parse(source)) == {"cli", "sim"}
