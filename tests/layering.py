"""The graph of imports within the package, and the rules that it keeps.

The rules are functions of a graph or of a list of paths, so that tests check that each finds what it forbids.
"""

import ast
from collections.abc import Callable, Iterable, Mapping, Sequence
from pathlib import Path, PurePosixPath

Graph = Mapping[str, set[str]]
"""Modules by their dotted name below the root package, each with the modules that it imports.

The root package itself, which offers the public names of all layers, has its own name.
"""

ROOT_PACKAGE = "echoscape"
LAYERS = ("scenes", "sim", "learn", "eval", "testing", "cli")
"""Top-level folders: each imports itself and those before it only."""
PACKAGE_ORDER: Mapping[str, Sequence[Sequence[str]]] = {
    "scenes": (("core",), ("geometry", "driving"), ("assets", "roads"), ("town", "traffic"), ("io",)),
    "sim": (
        ("numerics", "echoes"),
        ("sensor",),
        ("datasets", "settings"),
        ("receiver", "kinematics"),
        ("raytracing",),
        ("effects", "ground_truth"),
        ("simulator",),
        ("generation",),
    ),
    "learn": (("geometry",), ("data",), ("model",), ("training", "odometry")),
    "eval": (
        ("figures", "statistics"),
        ("methods",),
        ("odometry", "fidelity", "viewer", "scene_report"),
        ("ablation", "detections"),
    ),
}
"""Packages (and modules beside them) of a layer by level: each imports itself and lower levels only."""
FORBIDDEN = (("sim.raytracing", "sim.receiver"), ("sim.receiver", "sim.raytracing"))
"""Pairs (importing, imported) that must not meet although their levels would allow it."""
LEARN_TAKES = "sim.datasets"
"""The only package of the simulator that learning may import."""
MAX_MODULES = 15
"""Most modules that a folder may hold, its __init__ aside."""


def import_graph(sources: Mapping[str, str]) -> dict[str, set[str]]:
    """Return who imports whom, in functions and under TYPE_CHECKING as well.

    Args:
        sources: Source texts by the module's dotted name below the root package; a package's __init__ has the
            name of the package.

    Returns:
        The graph. Strings given to `import_module` count, of an f-string the packages before its first
        variable. Names of `lazy_loader.attach` are strings and count as no import.

    Raises:
        ValueError: A relative import leads out of the root package.
    """
    return {name: _imports(name, ast.parse(text), sources) for name, text in sources.items()}


def _imports(name: str, tree: ast.AST, modules: Iterable[str]) -> set[str]:
    modules = set(modules)
    is_package = any(each.startswith(f"{name}.") for each in modules)
    package = f"{ROOT_PACKAGE}.{name}" if is_package else f"{ROOT_PACKAGE}.{name}".rpartition(".")[0]
    found: set[str] = set()
    for node in ast.walk(tree):
        if isinstance(node, ast.Import):
            found |= {alias.name for alias in node.names}
        elif isinstance(node, ast.ImportFrom):
            module = _absolute("." * node.level + (node.module or ""), package)
            for alias in node.names:
                inner = f"{module}.{alias.name}"
                found.add(inner if inner.partition(".")[2] in modules else module)
        elif isinstance(node, ast.Call):
            found.add(_absolute(_module_by_name(node), package))
    inside = {each for each in found if _within(each, ROOT_PACKAGE)}
    return {each.partition(".")[2] or ROOT_PACKAGE for each in inside}


def _absolute(module: str, package: str) -> str:
    """Return the full name of a module; leading dots are relative to a package."""
    name = module.lstrip(".")
    level = len(module) - len(name)
    if level == 0:
        return name
    parents = package.split(".")
    if level > len(parents):
        raise ValueError(f"{module} in {package} leads out of {ROOT_PACKAGE}")
    return ".".join([*parents[: len(parents) - level + 1], *([name] if name else [])])


def _module_by_name(call: ast.Call) -> str:
    """Return the module that a call of `import_module` names, or an empty string."""
    called = call.func.attr if isinstance(call.func, ast.Attribute) else getattr(call.func, "id", "")
    given = [*call.args, *(each.value for each in call.keywords if each.arg == "name")]
    if called not in ("import_module", "__import__") or not given:
        return ""
    if isinstance(given[0], ast.JoinedStr):
        return _string(given[0].values[0]).rpartition(".")[0]
    return _string(given[0])


def _string(node: ast.expr) -> str:
    return node.value if isinstance(node, ast.Constant) and isinstance(node.value, str) else ""


def circles(graph: Graph) -> list[list[str]]:
    """Return the groups of modules that import each other, directly or by way of others (Tarjan 1972)."""
    number: dict[str, int] = {}
    lowest: dict[str, int] = {}
    stack: list[str] = []
    found: list[list[str]] = []

    def visit(name: str) -> None:
        number[name] = lowest[name] = len(number)
        stack.append(name)
        for other in graph.get(name, ()):
            if other not in number:
                visit(other)
                lowest[name] = min(lowest[name], lowest[other])
            elif other in stack:
                lowest[name] = min(lowest[name], number[other])
        if lowest[name] == number[name]:
            start = stack.index(name)
            group = sorted(stack[start:])
            del stack[start:]
            if len(group) > 1 or name in graph.get(name, ()):
                found.append(group)

    for name in graph:
        if name not in number:
            visit(name)
    return found


def wrong_layers(graph: Graph) -> list[tuple[str, str]]:
    """Return the imports (importing, imported) from a later top-level folder.

    The root package is later than all of them: its names are imported from any of them on first use.
    """
    return _imports_where(graph, lambda a, b: _level(LAYERS, b) > _level(LAYERS, a))


def own_public_names(graph: Graph) -> list[tuple[str, str]]:
    """Return the imports, within a layer with an order of packages, of the public names of that layer.

    They come from all of its packages, so that they are above each of them: import the module itself.
    """
    return _imports_where(graph, lambda a, b: b in PACKAGE_ORDER and a.startswith(f"{b}."))


def wrong_packages(graph: Graph) -> list[tuple[str, str]]:
    """Return the imports between packages of one layer that go against the order of packages.

    Raises:
        ValueError: A package has no place in the order.
    """

    def wrong(importing: str, imported: str) -> bool:
        layer, _, rest = importing.partition(".")
        other_layer, _, other_rest = imported.partition(".")
        if layer != other_layer or layer not in PACKAGE_ORDER or not rest or not other_rest:
            return False
        own, other = rest.partition(".")[0], other_rest.partition(".")[0]
        return own != other and _place(layer, own) <= _place(layer, other)

    return _imports_where(graph, wrong)


def forbidden_imports(graph: Graph) -> list[tuple[str, str]]:
    """Return the imports that the levels allow and `FORBIDDEN` or `LEARN_TAKES` does not."""

    def wrong(importing: str, imported: str) -> bool:
        if any(_within(importing, one) and _within(imported, other) for one, other in FORBIDDEN):
            return True
        from_sim = _within(importing, "learn") and _within(imported, "sim")
        return from_sim and not _within(imported, LEARN_TAKES)

    return _imports_where(graph, wrong)


def crowded_folders(paths: Iterable[str]) -> list[str]:
    """Return the folders that hold more than `MAX_MODULES` modules, __init__ aside."""
    count: dict[str, int] = {}
    for path in map(PurePosixPath, paths):
        if path.suffix == ".py" and path.name != "__init__.py":
            count[str(path.parent)] = count.get(str(path.parent), 0) + 1
    return sorted(folder for folder, modules in count.items() if modules > MAX_MODULES)


def unmirrored_tests(tests: Iterable[str], modules: Iterable[str]) -> list[str]:
    """Return the tests that belong to no module of the same folder.

    tests/sim/receiver/test_quantiser.py belongs to sim/receiver/quantiser.py. A name may go on after that of
    the module (test_quantiser_steps.py), and test_receiver_....py may be of the whole package. Tests in
    tests and in tests/physics belong to the whole project.
    """
    known = set()
    for path in map(PurePosixPath, modules):
        known |= {str(path.parent / path.stem.strip("_")), str(path.parent / path.parent.name)}
    found = []
    for path in map(PurePosixPath, tests):
        folder = path.parent.relative_to("tests")
        name = path.stem.removeprefix("test_")
        starts = {name, *(name[:place] for place, letter in enumerate(name) if letter == "_")}
        if str(folder) not in (".", "physics") and not {str(folder / each) for each in starts} & known:
            found.append(str(path))
    return sorted(found)


def untested_packages(tests: Iterable[str], modules: Iterable[str]) -> list[str]:
    """Return the packages with modules but without a test in the same folder below tests."""
    tested = {str(PurePosixPath(test).parent.relative_to("tests")) for test in tests}
    packages = {str(PurePosixPath(module).parent) for module in modules if not module.endswith("__init__.py")}
    return sorted(packages - tested)


def sources_of(root: Path) -> dict[str, str]:
    """Return the sources of the checkout by dotted name, a package's __init__ under the package's name."""
    found = {}
    for layer in LAYERS:
        for path in sorted((root / layer).rglob("*.py")):
            parts = path.relative_to(root).with_suffix("").parts
            found[".".join(parts[:-1] if parts[-1] == "__init__" else parts)] = path.read_text()
    return found


def _imports_where(graph: Graph, wrong: Callable[[str, str], bool]) -> list[tuple[str, str]]:
    return sorted((name, other) for name, others in graph.items() for other in others if wrong(name, other))


def _level(order: Sequence[str], name: str) -> int:
    return len(order) if name == ROOT_PACKAGE else order.index(name.partition(".")[0])


def _place(layer: str, package: str) -> int:
    for level, packages in enumerate(PACKAGE_ORDER[layer]):
        if package in packages:
            return level
    raise ValueError(f"{layer}.{package} has no place in the order of packages")


def _within(name: str, package: str) -> bool:
    return name == package or name.startswith(f"{package}.")
