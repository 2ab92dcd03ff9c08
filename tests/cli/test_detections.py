"""`echoscape detections`: files of a run, or one line on what is wrong, and nothing left behind."""

import json
import shutil
from pathlib import Path

import pytest

from echoscape.cli.__main__ import main
from echoscape.cli.arguments import parse
from echoscape.cli.detections import Options, _joined_methods, _names
from echoscape.sim.generation.config import SimulationConfig
from echoscape.sim.generation.dataset import write_dataset
from echoscape.sim.sensor.cts_small import CTS_SMALL
from echoscape.sim.settings.tracing import TraceSettings


@pytest.fixture(scope="module")
def yard(tmp_path_factory: pytest.TempPathFactory) -> Path:
    out = tmp_path_factory.mktemp("detections") / "yard"
    config = SimulationConfig(preset="yard", seed=4, scans=2, sensor=CTS_SMALL, trace=TraceSettings(rays=64))
    write_dataset(out, config)
    return out


def refusal(capsys: pytest.CaptureFixture[str], *words: str) -> str:
    """The line by which the command refuses."""
    assert main(["detections", *words]) == 2
    captured = capsys.readouterr()
    assert captured.out == ""
    line = captured.err.splitlines()[-1]
    assert line.startswith("echoscape detections: ")
    return line


def test_a_run_writes_its_files_and_prints_its_table(
    yard: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    out = tmp_path / "new" / "out"
    words = [str(yard), "--out", str(out), "--methods", "kstrongest, cfar", "--kstrongest.k", "3"]
    assert main(["detections", *words]) == 0
    printed = capsys.readouterr().out
    assert [line.split()[0] for line in printed.splitlines()[:3]] == ["method", "kstrongest", "cfar"]
    assert "No intervals: the way of " in printed
    assert "1 block gives no interval" in printed
    assert str(out / "detections.json") in printed
    found = json.loads((out / "detections.json").read_text())
    assert list(found["methods"]) == ["kstrongest", "cfar"]
    assert found["methods"]["kstrongest"]["figures"]["detections_per_scan"]["value"] <= 300
    assert (out / "detections.png").read_bytes().startswith(b"\x89PNG")
    assert not [path for path in out.iterdir() if path.name.startswith(".")]


def test_options_come_from_a_file_too(yard: Path, tmp_path: Path) -> None:
    (tmp_path / "o.toml").write_text('methods = "cfar"\n[judge]\nnear_m = 5\n[cfar]\ntraining_m = 8\n')
    out = tmp_path / "out"
    words = ["detections", str(yard), "--out", str(out), "--config", str(tmp_path / "o.toml")]
    assert main(words) == 0
    found = json.loads((out / "detections.json").read_text())
    assert list(found["methods"]) == ["cfar"]
    assert found["settings"]["near_m"] == 5


@pytest.mark.parametrize(
    ("words", "message"),
    [
        (["--methods", "cfar,orb"], ": --methods must be among cfar, "),
        (["--methods", ""], "argument 5 (after --methods) must not be empty, got ''"),
        (["--methods", ","], ": --methods must name at least one of cfar, "),
        (["--methods", "cfar", "kstrongest", "cfar"], ": --methods must be named once each, got cfar twice"),
        (["--methods", "cfar", "orb"], "unknown argument 'orb'"),
        (["--cfar.false-alarm-rate", "2"], "--cfar.false-alarm-rate must be above 0 and below 1, got 2.0"),
        (["--judge.near-m", "500"], "near_m must be below the last bin, "),
        (["--judge.targets", "all"], "--judge.targets must be one of static, direct, got 'all'"),
        (["--cfar.training-m", "1000"], "CFAR needs "),
        (["--every", "0"], "every must be 1 or more, got 0"),
        (["--kstrongest.k", "many"], "--kstrongest.k must be a whole number, got 'many'"),
        (["--learned.least-score", "2"], "--learned.least-score must be between 0 and 1, got 2.0"),
        (["--methods", "learned", "--learned.weights", "none.safetensors"], "none.safetensors"),
        (["--methods", "learned", "--learned.resolution", "0.1"], "resolution must be one of 0.6912"),
        (["--threads", "0"], "--threads must be 1 or more, got 0"),
    ],
)
def test_bad_options_are_refused_in_a_line(
    words: list[str], message: str, yard: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    assert message in refusal(capsys, str(yard), "--out", str(tmp_path / "out"), *words)
    assert not (tmp_path / "out").exists()


@pytest.mark.parametrize(
    "words",
    ["--methods cfar kstrongest --out res DATA", "--methods=cfar, kstrongest DATA --out res",
     "DATA --out res --methods cfar , kstrongest", "--methods cfar,kstrongest DATA --out res"],
)  # fmt: skip
def test_methods_are_separated_by_commas_or_spaces(words: str) -> None:
    options = parse(Options, prog="echoscape detections", words=_joined_methods(words.split()))
    assert _names(options.methods) == ["cfar", "kstrongest"]
    assert options.data == Path("DATA")


def test_results_go_beside_data_sets_not_into_them(yard: Path, capsys: pytest.CaptureFixture[str]) -> None:
    before = sorted(yard.rglob("*"))
    assert "OUT must not be a data set" in refusal(capsys, str(yard), "--out", f"{yard}/../{yard.name}")
    assert sorted(yard.rglob("*")) == before


def test_folders_without_truth_or_scans_are_refused(
    yard: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    out = str(tmp_path / "out")
    assert "no such folder" in refusal(capsys, str(tmp_path / "none"), "--out", out)
    (tmp_path / "empty").mkdir()
    assert "no scans (PNG files)" in refusal(capsys, str(tmp_path / "empty"), "--out", out)
    copy = Path(shutil.copytree(yard, tmp_path / "copy"))
    shutil.rmtree(copy / "truth")
    assert "truth" in refusal(capsys, str(copy), "--out", out)
    (copy / "echoscape.json").unlink()
    words = [str(copy), "--out", out]
    assert "not a scan of the layout oxford" in refusal(capsys, *words)  # of no radar that exists
    assert not Path(out).exists()


def test_a_file_in_place_of_the_output_is_refused(
    yard: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    (tmp_path / "file").write_text("")
    assert "OUT must be a folder" in refusal(capsys, str(yard), "--out", str(tmp_path / "file"))
