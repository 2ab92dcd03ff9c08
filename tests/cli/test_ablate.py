"""`echoscape ablate`: tables and figures of an ablation, or one line on what is wrong and nothing left."""

import csv
import json
import shutil
from pathlib import Path

import pytest

from echoscape.cli.__main__ import main
from echoscape.cli.ablate import Options, _one_by_one
from echoscape.cli.arguments import with_config_file
from tests.paths import ROOT

YARD = "--worlds yard:1 --scans 2 --radar cts_small --trace.rays 16 --methods fourier"


def test_a_difference_is_printed_and_files_are_named(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    out = tmp_path / "res"
    words = f"--out {out} {YARD} --artefact ghosts=0,1 --artefact gain_step=-20"
    assert main(["ablate", *words.split()]) == 0
    said = capsys.readouterr()
    for text in ("fourier [m]", "ghosts off", "ghosts ×1", "gain step -20 dB", str(out / "report.html")):
        assert text in said.out
    assert "1 drive gives no interval" in said.err
    rows = list(csv.DictReader((out / "table.csv").read_text().splitlines()))
    assert list(dict.fromkeys(row["condition"] for row in rows)) == [
        *("default", "ghosts=0", "ghosts=1", "gain_step=-20")
    ]
    assert {row["low"] for row in rows} == {""}
    assert main(["ablate", *f"--out {out} {YARD} --artefact ghosts=0".split()]) == 2
    assert "OUT holds another ablation, which this one cannot continue: " in capsys.readouterr().err


def test_failed_pairs_and_drives_of_one_seed_are_told(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    """Scans without any echo cannot be compared; the yard's few points are too few for cen2018."""
    for path in (ROOT / "examples").glob("yard.*"):
        shutil.copy(path, tmp_path)
    (tmp_path / "yard.toml").rename(tmp_path / "a.toml")
    words = f"--out {tmp_path / 'res'} {YARD} --worlds yard:1 {tmp_path / 'a.toml'}:1"
    words += " --methods fourier,cen2018 --artefact blank_azimuths=1"
    assert main(["ablate", *words.split()]) == 0
    said = capsys.readouterr()
    (line,) = (line for line in said.out.splitlines() if line.startswith("blank azimuths 100 %"))
    assert line.count("2 of 2 (100 %) failed") == 2
    for text in (
        "of the pairs of cen2018, 2 of 2 (100 %) fail under the default condition",
        "yard_1 and a_1 have the same seed, 1",
    ):
        assert text in said.err
        assert text in (tmp_path / "res" / "report.html").read_text()
        assert text in (tmp_path / "res" / "table.md").read_text()
    assert "of fourier" not in said.err


def test_all_methods_are_in_the_help(capsys: pytest.CaptureFixture[str]) -> None:
    from echoscape.eval.odometry.methods import HAND_MADE

    with pytest.raises(SystemExit):
        main(["ablate", "--help"])
    said = " ".join(capsys.readouterr().out.replace("│", " ").split())
    for name in HAND_MADE:
        assert f" {name}" in said


def test_options_may_come_from_a_file(tmp_path: Path) -> None:
    (tmp_path / "a.toml").write_text(
        'worlds = ["yard:1", "yard:2"]\nartefact = ["ghosts=0", "speckle=0"]\nscans = 3\ngrid = true\n'
    )
    given = ["--config", str(tmp_path / "a.toml"), "--out", "res"]
    words = _one_by_one(given, with_config_file(Options, given))
    assert words == [
        *("--worlds", "yard:1", "yard:2", "--artefact", "ghosts=0", "--artefact", "speckle=0", "--scans=3"),
        *("--grid", *given),
    ]
    given += ["--artefact", "rain=5", "ghosts=2"]
    words = _one_by_one(given, with_config_file(Options, given))
    assert words[3:] == [
        *("--scans=3", "--grid", *given[:-3], "--artefact", "rain=5", "--artefact", "ghosts=2")
    ]


def test_the_default_condition_takes_the_options_of_a_simulation(tmp_path: Path) -> None:
    words = f"--out {tmp_path}/res {YARD} --artefacts.rain 5 --artefact rain=default,off"
    assert main(["ablate", *words.split()]) == 0
    content = json.loads((tmp_path / "res" / "ablation.json").read_text())
    assert content["worlds"]["yard_1"]["artefacts"]["rain"] == 5.0
    assert [each["artefacts"]["rain"] for each in content["conditions"].values()] == [5.0, 5.0, 0.0]


@pytest.mark.parametrize(
    ("words", "message"),
    [
        ("", "an artefact or a suite must be given"),
        ("--artefact ghosts=default", "--artefact must have a strength other than that of the default"),
        ("--artefact snow=1", "--artefact: must name an artefact"),
        ("--artefact rain=1000", "--artefact: rain must be between 0 and 150, got 1000"),
        ("--artefact rain=5 --artefact rain=9 --suite stress", "--artefact: rain must be given once"),
        ("--suite hard", "--suite"),
        ("--suite stress --grid", "--grid combines the strengths of --artefact: not with --suite"),
        ("--suite stress --methods sift", "--methods: a method must be one of fourier, "),
        ("--suite stress --methods learned:none.safetensors", "none.safetensors: cannot be read"),
        ("--suite stress --worlds city:1", "--worlds: preset must be one of town"),
        ("--suite stress --worlds town", "--worlds: a world must be PRESET:SEED"),
        ("--suite stress --worlds yard:1 yard:01", "--worlds must differ, got yard:1 2 times"),
        ("--suite stress --worlds none.toml:1", "none.toml"),
        ("--suite stress --scans 1", "--scans must be 2 or more, got 1"),
        ("--suite stress --workers 0", "--workers must be 1 or more, got 0"),
        ("--suite stress --radar xyz", "--radar: "),
        ("--suite stress --seed 3", "--seed"),
        ("--suite stress --layout boreas", "--layout"),
    ],
)
def test_bad_input_is_refused_in_one_line_and_leaves_nothing(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], words: str, message: str
) -> None:
    assert main(["ablate", "--out", str(tmp_path / "res"), *YARD.split(), *words.split()]) == 2
    (line,) = capsys.readouterr().err.splitlines()
    assert line.startswith("echoscape ablate: ")
    assert message in line
    assert list(tmp_path.iterdir()) == []


def test_a_file_in_place_of_the_folder_is_refused(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    (tmp_path / "res").write_text("dear")
    assert main(["ablate", "--out", str(tmp_path / "res"), *YARD.split(), "--suite", "stress"]) == 2
    assert "OUT must be a folder" in capsys.readouterr().err
    assert (tmp_path / "res").read_text() == "dear"
