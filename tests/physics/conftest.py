"""The fixture `law`, and the option that writes docs/physics.md from what it recorded."""

from pathlib import Path

import pytest

from tests.physics.laws import Law, LawRecorder, Laws

HERE = Path(__file__).parent
LAWS = pytest.StashKey[Laws]()


def pytest_addoption(parser: pytest.Parser) -> None:
    parser.addoption("--write-physics", action="store_true", help="write docs/physics.md from the tests")


def pytest_collection_modifyitems(session: pytest.Session, items: list[pytest.Item]) -> None:
    """The page comes last, when all laws are recorded; it is whole if every file is there."""
    items.sort(key=lambda item: item.path == HERE / "test_page.py")
    present = {item.path for item in items}
    laws = _laws(session.config)
    laws.complete &= present >= set(HERE.glob("test_*.py"))


def pytest_deselected(items: list[pytest.Item]) -> None:
    for item in items:
        records = isinstance(item, pytest.Function) and "law" in item.fixturenames
        if records and item.path.parent == HERE:
            _laws(item.config).complete = False


def _laws(config: pytest.Config) -> Laws:
    return config.stash.setdefault(LAWS, Laws())


@pytest.fixture(scope="session")
def laws(pytestconfig: pytest.Config) -> Laws:
    """All that the run has recorded so far."""
    return _laws(pytestconfig)


@pytest.fixture
def law(laws: Laws, request: pytest.FixtureRequest) -> LawRecorder:
    """Records a law under the section that the test's module names as SECTION, and fails if it does not hold.

    law("Energy ...", source="...", expected=1.0, simulated=found, tolerance=0.1, unit="dB", why="...")
    """

    def record(
        name: str,
        *,
        source: str,
        expected: float,
        simulated: float,
        tolerance: float,
        why: str,
        unit: str = "",
    ) -> None:
        row = Law(
            section=request.module.SECTION,
            name=name,
            source=source,
            expected=float(expected),
            simulated=float(simulated),
            tolerance=float(tolerance),
            unit=unit,
            why=why,
        )
        laws.record(row)

    return record
