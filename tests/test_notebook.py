"""examples/first_scan.ipynb: a valid notebook without stored outputs, whose cells run."""

import json
from pathlib import Path

import pytest
from matplotlib import pyplot

from tests.paths import ROOT

NOTEBOOK = ROOT / "examples" / "first_scan.ipynb"
CELLS = json.loads(NOTEBOOK.read_text())["cells"]
CODE = ["".join(cell["source"]) for cell in CELLS if cell["cell_type"] == "code"]


def test_it_is_valid() -> None:
    nbformat = pytest.importorskip("nbformat", reason="comes with the packages of `make docs`")
    nbformat.validate(nbformat.read(NOTEBOOK, as_version=nbformat.NO_CONVERT))


def test_no_outputs_are_stored() -> None:
    assert len(CODE) > 3
    assert all(not cell["outputs"] and cell["execution_count"] is None for cell in CELLS if "outputs" in cell)
    assert NOTEBOOK.stat().st_size < 10_000


@pytest.mark.slow
def test_its_cells_run_and_draw(
    no_screen: None, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.chdir(tmp_path)
    names: dict[str, object] = {}
    for number, code in enumerate(CODE):
        exec(compile(code, f"cell {number}", "exec"), names)
    assert len(pyplot.get_fignums()) == sum("plt.subplots" in code for code in CODE)
    assert "direct" in capsys.readouterr().out
