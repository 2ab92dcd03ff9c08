"""`echoscape artefacts`: figures and a table, or one line on what is wrong, and nothing left behind."""

from dataclasses import replace
from pathlib import Path

import pytest

from echoscape.cli.__main__ import main
from echoscape.sim.generation.config import SimulationConfig
from echoscape.sim.sensor.cts_small import CTS_SMALL

EMPTY = "--preset empty --seed 5 --scans 2"


def test_figures_are_written_and_changes_printed(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    out = tmp_path / "out"
    words = f"{out} {EMPTY} --artefacts.leakage 0.25 --only leakage quantisation".split()
    assert main(["artefacts", *words]) == 0
    message = capsys.readouterr().out
    assert {path.name for path in out.iterdir()} == {"leakage.png", "quantisation.png", "artefacts.md"}
    assert "×0.25" in message
    assert all(str(path) in message for path in out.iterdir())
    assert "| leakage | ×0.25 |" in (out / "artefacts.md").read_text()


def test_the_scan_is_of_the_chosen_radar(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    drawn: list[SimulationConfig] = []

    def drawing(
        _: Path, config: SimulationConfig, *__: object, **___: object
    ) -> tuple[list[object], tuple[()]]:
        drawn.append(config)
        return [], ()

    monkeypatch.setattr("echoscape.eval.ablation.figures.write_artefacts", drawing)
    words = f"{tmp_path / 'out'} {EMPTY} --radar cts_small --sensor.tx-power-w 3".split()
    assert main(["artefacts", *words]) == 0
    assert [config.sensor for config in drawn] == [replace(CTS_SMALL, tx_power_w=3.0)]


@pytest.mark.parametrize(
    ("words", "message"),
    [
        ("--scan 2", "scan must be between 0 and 1, got 2"),
        ("--scan -1", "scan must be between 0 and 1, got -1"),
        ("--only snow", "only must name some of speckle"),
        ("--artefacts.rain 1000", "rain must be between 0 and 150"),
        ("--fast", "--fast"),
        ("--radar xyz", "--radar: a sensor must be one of cts350x"),
        ("--keep-beat", "--keep-beat"),
        ("--layout oxford", "--layout"),
    ],
)
def test_bad_input_is_refused_in_one_line_and_leaves_nothing(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], words: str, message: str
) -> None:
    assert main(["artefacts", str(tmp_path / "a"), *EMPTY.split(), *words.split()]) == 2
    line = capsys.readouterr().err
    assert line.startswith("echoscape artefacts: ")
    assert message in line
    assert len(line.splitlines()) == 1
    assert list(tmp_path.iterdir()) == []


def test_help_has_no_options_for_folders(capsys: pytest.CaptureFixture[str]) -> None:
    with pytest.raises(SystemExit):
        main(["artefacts", "--help"])
    message = capsys.readouterr().out
    assert "--keep-beat" not in message
    assert "--layout" not in message
    assert "Scans to make" not in message
    assert "Length of the drive in scans" in message


def test_a_file_in_place_of_the_folder_is_refused(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    (tmp_path / "a").write_text("dear")
    assert main(["artefacts", str(tmp_path / "a"), *EMPTY.split()]) == 2
    assert "OUT must be a folder" in capsys.readouterr().err
    assert (tmp_path / "a").read_text() == "dear"
