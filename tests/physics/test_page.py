"""docs/physics.md says what the tests hold, no more and no less."""

import pytest

from tests.physics.laws import PAGE, Laws, lasting_cells, page, stated


def test_page_states_every_law(laws: Laws, request: pytest.FixtureRequest) -> None:
    if request.config.getoption("write_physics", default=False):
        assert laws.complete, "--write-physics needs all of tests/physics"
        assert not request.session.testsfailed, "a law fails: docs/physics.md stays as it is"
        PAGE.write_text(page(laws.rows), encoding="utf-8")
    found = stated(PAGE.read_text(encoding="utf-8"))
    for row in laws.rows:
        cells = lasting_cells(row)
        assert found.get(cells[0]) == cells, f"docs/physics.md lacks: {row.name}"
    if laws.complete and not request.session.testsfailed:
        gone = set(found) - {row.cells[0] for row in laws.rows}
        assert not gone, f"docs/physics.md has laws that no test holds: {sorted(gone)}"
