"""The command: help, bad input refused in one line, nothing left behind, a good run whole."""

import json
import subprocess
import sys
from dataclasses import replace
from pathlib import Path

import pytest
from PIL import Image

from echoscape.cli import simulate
from echoscape.cli.__main__ import COMMANDS, main
from echoscape.sim.datasets import scan_folder as folders
from echoscape.sim.datasets.files.atomic_write import DatasetError
from echoscape.sim.datasets.files.metadata import manifest_text
from echoscape.sim.generation import dataset
from echoscape.sim.generation.config import SimulationConfig
from echoscape.sim.generation.manifest import manifest
from echoscape.sim.sensor.cts350x import CTS350X
from echoscape.sim.sensor.registry import SENSORS
from echoscape.sim.sensor.sensor import Sensor
from echoscape.sim.settings.artefacts import Artefacts
from tests.paths import ROOT

EXAMPLES = ROOT / "examples"
SMALL = ["--preset", "empty", "--seed", "3", "--scans", "2", "--trace.rays", "16"]

BAD = {
    "--scans 0": "--scans must be 1 or more, got 0",
    "--scans -3": "--scans must be 1 or more, got -3",
    "--scans 9999999": "--scans must be",
    "--scans many": "--scans must be a whole number, got 'many'",
    "--seed -1": "--seed must be 0 or more, got -1",
    "--seed 1.5": "--seed must be a whole number, got '1.5'",
    "--radar moon": "--radar: a sensor must be one of cts350x, cir204, cir304, cir304_rt, cts_small or a",
    "--radar nowhere.toml": "--radar: nowhere.toml: cannot be read",
    "--radar=cir304_rt --sensor.fft-size 8192": "--sensor.fft-size must be a power of two of 13696 or more",
    "--layout moon": "--layout must be one of oxford, mulran, boreas, got 'moon'",
    "--sensor.name=": "--sensor.name must not be empty, got ''",
    "--randomize --sensor.mount-tilt-deg 89": "got 89.029, as --randomize drew it around the given values",
    "--preset moon": "--preset must be one of town, suburb,",
    "--workers 0": "--workers must be 1 or more, got 0",
    "--threads 0": "--threads must be 1 or more, got 0",
    "--trace.rays 17": "--trace.rays must be a power of two",
    "--trace.rays -1": "--trace.rays must be a power of two",
    "--trace.draw -1": "--trace.draw must be 0 or more, got -1",
    "--trace.max-bounces 0": "--trace.max-bounces must be between 1 and 9",
    "--trace.rays 1000000": "--trace.rays must be a power of two from 16 to 4096, got 1000000",
    "--trace.floor-db nan": "--trace.floor-db must be between -60 and 60, got nan",
    "--trace.floor-db 1e9": "--trace.floor-db must be between -60 and 60, got 1000000000",
    "--trace.floor-db=-1000": "--trace.floor-db must be between -60 and 60, got -1000",
    "--sensor.bandwidth-hz nan": "--sensor.bandwidth-hz must be finite, got nan",
    "--sensor.bandwidth-hz -1": "--sensor.bandwidth-hz must be above 0",
    "--sensor.bin-m inf": "--sensor.bin-m must be finite, got inf",
    "--sensor.azimuths 0": "--sensor.azimuths must be above 0",
    "--sensor.rotation-jitter-s -1": "--sensor.rotation-jitter-s must be 0 or more",
    "--sensor.window square": "--sensor.window must be",
    "--drive.wander-m nan": "--drive.wander-m must be between 0 and 2, got nan",
    "--drive.wander-m 1e9": "--drive.wander-m must be between 0 and 2, got 1e+09",
    "--drive.route.revisit-share 2": "--drive.route.revisit-share must be between 0 and 1, got 2",
    "--drive.speed.stop-chance 2": "--drive.speed.stop-chance must be between 0 and 1, got 2",
    "--drive.speed.town-cruise-mps 9 5 2": "town-cruise-mps must not decrease from low to high, got 9 5 2",
    "--drive.speed.brake-mps2 2 1": "--drive.speed.brake-mps2 must not decrease from low to high, got 2 1",
    "--drive.speed.brake-mps2 0 0": "--drive.speed.brake-mps2 must be finite and above 0, got 0 0",
    "--drive.speed.bend-mps2 0 0": "--drive.speed.bend-mps2 must be finite and above 0, got 0 0",
    "--drive.speed.stop-s -1": "--drive.speed.stop-s must be 0 or more, got -1",
    "--traffic.near-m 0": "--traffic.near-m must be between 1 and 2000, got 0",
    "--traffic.vehicles-per-km2 inf": "--traffic.vehicles-per-km2 must be between 0 and 1000, got inf",
    "--traffic.vehicles-per-km2 1e9": "--traffic.vehicles-per-km2 must be between 0 and 1000, got 1e+09",
    "--no-such-option": "unknown option --no-such-option\n",
    "--scene none.toml": "none.toml: cannot be read (No such file or directory)",
    "--targets none.toml": "none.toml: cannot be read (No such file or directory)",
    f"--scene {EXAMPLES}/targets.toml": "targets.toml: file is missing",
    f"--targets {EXAMPLES}/yard.toml": "yard.toml: unknown key 'file'",
    f"--scene {EXAMPLES}/yard.toml --preset open": "--preset must not be given beside a scene, got 'open'",
    f"--scene {EXAMPLES}/yard.toml --traffic.near-m 200": "--traffic.near-m must not be given beside a scene",
    f"--scene {EXAMPLES}/yard.toml --drive.speed.bend-mps2 1 2": "--drive.speed.bend-mps2 must not be given",
    f"--scene {EXAMPLES}/yard.toml --scans 0": "--scans must be 1 or more, got 0",
}


@pytest.mark.parametrize("words", BAD)
def test_bad_input_is_refused_and_leaves_nothing(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], words: str
) -> None:
    assert _exit_code(["simulate", str(tmp_path / "set"), *words.split()]) == 2
    captured = capsys.readouterr()
    assert BAD[words] in captured.err
    assert captured.err.startswith("echoscape simulate: ")
    assert len(captured.err.splitlines()) == 1
    assert captured.out == ""
    assert list(tmp_path.iterdir()) == []


def test_without_arguments_the_folder_is_asked_for(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.chdir(tmp_path)
    assert main(["simulate"]) == 2
    (line,) = capsys.readouterr().err.splitlines()
    assert line == "echoscape simulate: OUT is required"
    assert list(tmp_path.iterdir()) == []


@pytest.mark.parametrize("command", ["simulate", "scene", "artefacts", "view"])
def test_empty_argument_is_not_the_current_folder(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str], command: str
) -> None:
    monkeypatch.chdir(tmp_path)
    assert main([command, ""]) == 2
    assert capsys.readouterr().err == f"echoscape {command}: argument 1 must not be empty, got ''\n"
    assert main(["simulate", "set", "--scene", ""]) == 2
    assert "argument 3 (after --scene) must not be empty" in capsys.readouterr().err
    assert list(tmp_path.iterdir()) == []


def _exit_code(words: list[str]) -> int:
    """What the shell would see: the parser leaves by SystemExit, our own checks by their return value."""
    try:
        return main(words)
    except SystemExit as leaving:
        return int(leaving.code or 0)


def test_full_folder_is_refused_and_left_alone(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    (tmp_path / "diary.txt").write_text("dear")
    assert main(["simulate", str(tmp_path), *SMALL]) == 2
    assert "OUT must be empty or new" in capsys.readouterr().err
    assert [path.name for path in tmp_path.iterdir()] == ["diary.txt"]


def test_file_in_the_place_of_the_folder_is_refused(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    (tmp_path / "file").write_text("")
    assert main(["simulate", str(tmp_path / "file"), *SMALL]) == 2
    assert "OUT must be a folder" in capsys.readouterr().err
    assert main(["simulate", str(tmp_path / "file" / "set"), *SMALL]) == 2
    assert "OUT" in capsys.readouterr().err


def test_run_makes_a_dataset_with_a_preview_and_sums_up(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    assert main(["simulate", str(tmp_path / "set"), *SMALL]) == 0
    assert len(list((tmp_path / "set" / "radar").glob("*.png"))) == 2
    with Image.open(tmp_path / "set" / "preview.png") as page:
        assert page.size == (1800, 1140)
    assert "2 of 400 azimuths x 3768 bins" in capsys.readouterr().out


def test_damage_that_only_the_summary_meets_is_reported_in_one_line(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    def damaged(*arguments: object, **settings: object) -> None:
        raise DatasetError("radar/1.png: not a complete PNG file")

    monkeypatch.setattr(dataset, "write_dataset", lambda *arguments, **settings: None)
    monkeypatch.setattr(folders, "open_folder", damaged)
    assert main(["simulate", str(tmp_path / "set"), *SMALL, "--no-preview"]) == 2
    assert capsys.readouterr().err.splitlines()[-1] == (
        "echoscape simulate: radar/1.png: not a complete PNG file"
    )


@pytest.fixture
def configs(monkeypatch: pytest.MonkeyPatch) -> list[SimulationConfig]:
    """What the command would make."""
    made: list[SimulationConfig] = []
    monkeypatch.setattr(simulate, "_simulate", lambda options, config: made.append(config) or 0)
    return made


@pytest.mark.parametrize(
    ("words", "sensor", "layout"),
    [
        ("", CTS350X, "oxford"),
        ("--radar cir204", SENSORS["cir204"], "mulran"),
        ("--radar=cir304", SENSORS["cir304"], "boreas"),
        ("--radar cir304_rt --layout oxford", SENSORS["cir304_rt"], "oxford"),
        (
            "--sensor.noise-figure-db 12 --radar cir204",
            replace(SENSORS["cir204"], noise_figure_db=12.0),
            "mulran",
        ),
    ],
)
def test_radar_decides_the_sensor_and_the_layout_and_single_numbers_override_it(
    tmp_path: Path, configs: list[SimulationConfig], words: str, sensor: Sensor, layout: str
) -> None:
    assert main(["simulate", str(tmp_path / "set"), *words.split()]) == 0
    assert configs[0].sensor == sensor
    assert configs[0].folder_layout.name == layout


def test_radar_from_a_file(tmp_path: Path, configs: list[SimulationConfig]) -> None:
    path = tmp_path / "mine.toml"
    path.write_text('base = "cir204"\nname = "mine"\nbins = 2000\n')
    words = ["--radar", str(path), "--sensor.adc-bits", "10"]
    assert main(["simulate", str(tmp_path / "set"), *words]) == 0
    assert configs[0].sensor == replace(SENSORS["cir204"], name="mine", bins=2000, adc_bits=10)
    assert configs[0].folder_layout.name == "oxford"


def test_custom_scene_that_does_not_fit_is_refused_and_leaves_nothing(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    out = tmp_path / "set"
    assert main(["simulate", str(out), "--scene", str(EXAMPLES / "yard.toml"), "--scans", "99"]) == 2
    (output,) = capsys.readouterr().err.splitlines()  # without a progress bar
    assert output.startswith("echoscape simulate: --scans must be 29 or fewer: the drive lasts 7.59 s")
    assert list(tmp_path.iterdir()) == []


def test_custom_scene_and_targets_make_a_dataset(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    files = ["--scene", str(EXAMPLES / "yard.toml"), "--targets", str(EXAMPLES / "targets.toml")]
    small = ["--scans", "1", "--trace.rays", "16", "--no-preview"]
    assert main(["simulate", str(tmp_path / "set"), *files, *small]) == 0
    assert "yard.obj, seed 0" in capsys.readouterr().out
    config = json.loads((tmp_path / "set" / "echoscape.json").read_text())["config"]
    assert len(config["scene"]["targets"]) == 1
    assert len(config["targets"]) == 3


def test_contents_of_files_are_not_options(capsys: pytest.CaptureFixture[str]) -> None:
    assert _exit_code(["simulate", "--help"]) == 0
    output = capsys.readouterr().out
    assert "--scene {None}|PATH" in output
    assert "--scene." not in output
    assert "(default: town)" in output


def _contents(folder: Path) -> dict[str, bytes]:
    """The bytes of every file below a folder."""
    return {
        str(path.relative_to(folder)): path.read_bytes()
        for path in folder.rglob("*")
        if path.is_file() and "cache" not in path.parts
    }


def test_a_dataset_from_another_ones_manifest_has_the_same_bytes(tmp_path: Path) -> None:
    words = ["--randomize", "--artefacts.rain", "5", "--radar", "cir304", "--layout", "mulran", "--keep-beat"]
    assert main(["simulate", str(tmp_path / "one"), *SMALL, *words]) == 0
    again = ["--from", str(tmp_path / "one" / "echoscape.json")]
    assert main(["simulate", str(tmp_path / "two"), *again]) == 0
    one, two = _contents(tmp_path / "one"), _contents(tmp_path / "two")
    assert len(one) >= 9
    assert one.keys() == two.keys()
    assert [name for name in one if one[name] != two[name]] == []


def test_options_win_over_the_manifest_of_another_dataset(
    tmp_path: Path, configs: list[SimulationConfig], capsys: pytest.CaptureFixture[str]
) -> None:
    made = replace(
        SimulationConfig(preset="empty", seed=3, scans=2, sensor=SENSORS["cir204"], layout="boreas"),
        randomized=True,
    )
    (tmp_path / "echoscape.json").write_text(manifest_text(manifest(made)))
    words = ["simulate", str(tmp_path / "set"), "--from", str(tmp_path / "echoscape.json")]
    assert main(words) == 0
    assert configs.pop() == made
    assert main([*words, "--scans", "5", "--preset", "open", "--artefacts.ghosts", "0"]) == 0
    assert configs.pop() == replace(made, scans=5, preset="open", artefacts=Artefacts(ghosts=0.0))
    assert main([*words, "--radar", "cir304", "--sensor.adc-bits", "9"]) == 0
    assert configs.pop() == replace(made, sensor=replace(SENSORS["cir304"], adc_bits=9))
    assert main([*words, "--scene", str(EXAMPLES / "yard.toml")]) == 0
    found = configs.pop()
    assert found.scene is not None
    assert (found.preset, found.scene.file, found.sensor.name) == ("custom", "yard.obj", "cir204")
    (tmp_path / "run.toml").write_text(f'from = "{tmp_path}/echoscape.json"\nscans = 7\n')
    assert main(["simulate", str(tmp_path / "set"), "--config", str(tmp_path / "run.toml")]) == 0
    assert configs.pop() == replace(made, scans=7)
    assert main([*words, "--randomize"]) == 2
    assert "was randomized already" in capsys.readouterr().err


def test_a_missing_manifest_is_refused_by_name(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["simulate", str(tmp_path / "set"), "--from", str(tmp_path / "echoscape.json")]) == 2
    (line,) = capsys.readouterr().err.splitlines()
    assert str(tmp_path) in line
    assert not (tmp_path / "set").exists()


def test_a_manifest_of_an_earlier_version_is_refused_in_one_line(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    path = tmp_path / "old" / "echoscape.json"
    path.parent.mkdir()
    path.write_text(manifest_text(manifest(SimulationConfig()) | {"format": 2}))
    for words in ([str(tmp_path / "set"), "--from", str(path)], [str(path.parent), "--resume"]):
        assert main(["simulate", *words]) == 2
        (line,) = capsys.readouterr().err.splitlines()
        assert line.startswith(
            f"echoscape simulate: {path}: must be of format 3, got 2, written by an earlier"
        )
    assert not (tmp_path / "set").exists()


def test_another_file_than_a_manifest_is_refused_by_name(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    path = tmp_path / "c1.toml"
    path.write_text("seed = 3\n")
    assert main(["simulate", str(tmp_path / "set"), "--from", str(path)]) == 2
    assert capsys.readouterr().err == f"echoscape simulate: {path}: not an echoscape.json\n"


def test_the_folder_of_a_manifest_stands_for_it(tmp_path: Path, configs: list[SimulationConfig]) -> None:
    made = SimulationConfig(preset="empty", seed=3, scans=2)
    (tmp_path / "echoscape.json").write_text(manifest_text(manifest(made)))
    assert main(["simulate", str(tmp_path / "set"), "--from", str(tmp_path)]) == 0
    assert configs == [made]


def test_unknown_command_is_refused(capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["stimulate"]) == 2
    assert "unknown command 'stimulate'; commands: simulate" in capsys.readouterr().err


def test_help_names_every_command_without_loading_the_ray_tracer() -> None:
    code = (
        "import sys; from echoscape.cli.__main__ import main; main(['--help']); "
        "sys.exit(any(name in sys.modules for name in ('mitsuba', 'numpy', 'torch')))"
    )
    done = subprocess.run(
        [sys.executable, "-c", code], capture_output=True, text=True, check=True, timeout=60
    )
    assert all(name in done.stdout for name in COMMANDS)


def test_version_is_printed(capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["--version"]) == 0
    assert capsys.readouterr().out.startswith("echoscape 0.1")
