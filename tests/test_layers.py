"""The order of folders and packages, import circles, sizes of folders, and where tests lie."""

import pytest

from tests.layering import (
    LAYERS,
    MAX_MODULES,
    PACKAGE_ORDER,
    circles,
    crowded_folders,
    forbidden_imports,
    import_graph,
    own_public_names,
    sources_of,
    unmirrored_tests,
    untested_packages,
    wrong_layers,
    wrong_packages,
)
from tests.paths import ROOT

SOURCES = sources_of(ROOT)
GRAPH = import_graph(SOURCES)
MODULES = sorted(str(path.relative_to(ROOT)) for layer in LAYERS for path in (ROOT / layer).rglob("*.py"))
HELPERS = sorted(str(path.relative_to(ROOT / "tests")) for path in (ROOT / "tests").rglob("*.py"))
"""Modules of the tests, which may have tests of their own."""
TESTS = sorted(str(path.relative_to(ROOT)) for path in (ROOT / "tests").rglob("test_*.py"))

# ---------------------------------------------------------------------- the project


def test_the_graph_is_that_of_the_project() -> None:
    assert len(GRAPH) > 150
    assert sum(map(len, GRAPH.values())) > 500
    assert GRAPH["cli.drift"] >= {"eval.odometry.kitti_drift", "cli.arguments"}
    for layer, levels in PACKAGE_ORDER.items():
        named = {package for level in levels for package in level}
        assert named == {name.split(".")[1] for name in GRAPH if name.startswith(f"{layer}.")}


def test_imports_follow_the_order_of_layers() -> None:
    assert wrong_layers(GRAPH) == []


def test_no_module_imports_the_public_names_of_its_own_layer() -> None:
    assert own_public_names(GRAPH) == []


def test_imports_follow_the_order_of_packages() -> None:
    assert wrong_packages(GRAPH) == []


def test_ray_tracer_and_receiver_do_not_meet_and_learning_knows_the_datasets_only() -> None:
    assert forbidden_imports(GRAPH) == []


def test_no_modules_import_each_other() -> None:
    assert circles(GRAPH) == []


def test_no_folder_is_crowded() -> None:
    assert crowded_folders(MODULES) == []


def test_tests_lie_where_their_modules_lie() -> None:
    assert unmirrored_tests(TESTS, [*MODULES, *(each for each in HELPERS if "test_" not in each)]) == []
    assert untested_packages(TESTS, MODULES) == []


# ---------------------------------------------------------------------- the rules, on small graphs

SMALL = {
    "scenes": "",
    "scenes.core.scene": "",
    "scenes.core.checks": "",
    "scenes.io.user_scene": "from echoscape.scenes.core import scene, checks",
    "sim.echoes": "from echoscape.scenes.core.scene import Scene",
    "sim.datasets.polar_scan": "import numpy",
    "sim.receiver.receiver": "from echoscape.sim.echoes import Echoes",
    "sim.raytracing.tracer": "import echoscape.sim.echoes",
    "sim.simulator": "import echoscape.sim.raytracing.tracer, echoscape.sim.receiver.receiver",
    "learn.model.unet": "from echoscape.sim.datasets.polar_scan import PolarScan",
    "eval.figures.style": "",
    "eval.odometry.run": "from echoscape.eval.figures import style\nimport echoscape.learn.model.unet",
    "eval.fidelity.score": "import echoscape.eval.figures.style",
    "cli.main": "def main():\n    from echoscape.eval.odometry.run import run_odometry",
}
IN_FUNCTION = "def f():\n    {}"
FOR_TYPES = "from typing import TYPE_CHECKING\nif TYPE_CHECKING:\n    {}"
RULES = {
    "layers": wrong_layers,
    "own public names": own_public_names,
    "packages": wrong_packages,
    "forbidden": forbidden_imports,
    "circles": circles,
}
ADDED = [
    ("layers", "sim.echoes", "from echoscape.learn.model.unet import UNet", "learn.model.unet"),
    ("layers", "scenes.core.scene", "import echoscape.cli.main", "cli.main"),
    ("packages", "scenes.core.scene", "from echoscape.scenes.io import user_scene", "scenes.io.user_scene"),
    ("packages", "sim.raytracing.tracer", "import echoscape.sim.simulator", "sim.simulator"),
    ("packages", "eval.fidelity.score", "from echoscape.eval.odometry import run", "eval.odometry.run"),
    ("packages", "eval.figures.style", "from echoscape.eval.fidelity.score import A", "eval.fidelity.score"),
    (
        "forbidden",
        "sim.raytracing.tracer",
        "from echoscape.sim.receiver.receiver import received",
        "sim.receiver.receiver",
    ),
    ("forbidden", "sim.receiver.receiver", "import echoscape.sim.raytracing.tracer", "sim.raytracing.tracer"),
    ("forbidden", "learn.model.unet", "from echoscape.sim.echoes import Echoes", "sim.echoes"),
    ("forbidden", "learn.model.unet", "import echoscape.sim.simulator", "sim.simulator"),
    # The root package, from each layer.
    ("layers", "scenes.core.scene", "import echoscape", "echoscape"),
    ("layers", "scenes.io.user_scene", "from echoscape import Simulator", "echoscape"),
    ("layers", "sim.simulator", "from echoscape import Simulator", "echoscape"),
    ("layers", "learn.model.unet", "import echoscape as es", "echoscape"),
    ("layers", "eval.figures.style", "from echoscape import *", "echoscape"),
    ("layers", "cli.main", "from echoscape import __version__", "echoscape"),
    ("layers", "sim.simulator", "from .. import Simulator", "echoscape"),
    # The public names of a layer, from inside it.
    ("own public names", "sim.raytracing.tracer", "from echoscape.sim import Simulator", "sim"),
    ("own public names", "scenes.core.scene", "import echoscape.scenes", "scenes"),
    ("own public names", "learn.model.unet", "from ...learn import KeypointModel", "learn"),
    # By name.
    ("packages", "sim.echoes", 'import_module("echoscape.sim.simulator")', "sim.simulator"),
    ("layers", "sim.echoes", 'importlib.import_module(name="echoscape.cli.main")', "cli.main"),
    ("layers", "sim.echoes", 'import_module("echoscape")', "echoscape"),
    ("layers", "sim.echoes", 'import_module(f"echoscape.cli.{name}")', "cli"),
    ("forbidden", "learn.model.unet", '__import__("echoscape.sim.simulator")', "sim.simulator"),
    ("forbidden", "sim.receiver.receiver", 'import_module("..raytracing.tracer")', "sim.raytracing.tracer"),
    # Relative to the package.
    ("forbidden", "sim.receiver.receiver", "from ..raytracing import tracer", "sim.raytracing.tracer"),
    ("forbidden", "sim.receiver.receiver", "from ..raytracing.tracer import f", "sim.raytracing.tracer"),
    ("packages", "sim.echoes", "from . import simulator", "sim.simulator"),
    ("layers", "scenes.core.scene", "from ...cli.main import main", "cli.main"),
]


@pytest.mark.parametrize("rule", RULES.values(), ids=RULES)
def test_the_small_graph_breaks_no_rule(rule) -> None:
    assert rule(import_graph(SMALL)) == []


@pytest.mark.parametrize("where", ["{}", IN_FUNCTION, FOR_TYPES], ids=["top", "function", "types"])
@pytest.mark.parametrize(("rule", "module", "line", "imported"), ADDED)
def test_one_such_import_is_found(rule: str, module: str, line: str, imported: str, where: str) -> None:
    graph = import_graph({**SMALL, module: SMALL[module] + "\n" + where.format(line)})
    assert RULES[rule](graph) == [(module, imported)]


@pytest.mark.parametrize("where", ["{}", IN_FUNCTION, FOR_TYPES], ids=["top", "function", "types"])
def test_circles_are_found(where: str) -> None:
    added = where.format("import echoscape.scenes.core.checks")
    graph = import_graph({**SMALL, "scenes.core.scene": added})
    assert circles(graph) == []
    back = import_graph(
        {**SMALL, "scenes.core.scene": added, "scenes.core.checks": "import echoscape.sim.echoes"}
    )
    assert circles(back) == [["scenes.core.checks", "scenes.core.scene", "sim.echoes"]]


def test_relative_imports_of_a_package_start_at_the_package() -> None:
    graph = import_graph({**SMALL, "scenes": "from .core import scene\nfrom . import core"})
    assert graph["scenes"] == {"scenes.core.scene", "scenes"}  # core has no __init__ in the small graph


def test_relative_imports_that_leave_the_root_package_are_refused() -> None:
    with pytest.raises(ValueError, match=r"\.\.\.\.other in echoscape\.scenes\.core leads out of echoscape"):
        import_graph({**SMALL, "scenes.core.scene": "from ....other import thing"})


def test_the_dynamic_import_of_commands_breaks_no_rule() -> None:
    graph = import_graph({**SMALL, "cli.main": 'import_module(f"echoscape.cli.{command}").main(words)'})
    assert graph["cli.main"] == {"cli"}
    assert [rule(graph) for rule in RULES.values()] == [[]] * len(RULES)


def test_other_calls_with_names_of_modules_import_nothing() -> None:
    calls = 'print("echoscape.sim.simulator")\nimport_module(name)\nimport_module()\nimport_module(f"{a}.b")'
    assert import_graph({**SMALL, "sim.echoes": calls})["sim.echoes"] == set()


def test_a_module_that_imports_itself_is_a_circle() -> None:
    assert circles({"a": {"a"}, "b": {"a"}}) == [["a"]]


def test_packages_without_a_place_are_refused() -> None:
    graph = import_graph({**SMALL, "sim.other.thing": "from echoscape.sim.echoes import Echoes"})
    with pytest.raises(ValueError, match=r"sim\.other has no place in the order of packages"):
        wrong_packages(graph)


def test_crowded_folders_are_found() -> None:
    paths = [f"sim/a/m{number}.py" for number in range(MAX_MODULES)] + ["sim/a/__init__.py", "sim/a/b/c.py"]
    assert crowded_folders(paths) == []
    assert crowded_folders([*paths, "sim/a/one_more.py"]) == ["sim/a"]


def test_tests_elsewhere_and_packages_without_tests_are_found() -> None:
    modules = ["sim/__init__.py", "sim/echoes.py", "sim/receiver/quantiser.py"]
    tests = ["tests/test_api.py", "tests/physics/test_link.py", "tests/sim/test_echoes_origin.py"]
    assert unmirrored_tests(tests, modules) == []
    assert untested_packages(tests, modules) == ["sim/receiver"]
    moved = "tests/sim/test_quantiser.py"
    assert unmirrored_tests([*tests, moved], modules) == [moved]


@pytest.mark.parametrize("name", sorted(SOURCES))
def test_every_module_says_what_it_is_for(name: str) -> None:
    assert SOURCES[name].lstrip().startswith('"""')
