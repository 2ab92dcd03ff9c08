"""`echoscape odometry`: files and figures of a run, or one line on what is wrong, and nothing left behind."""

import json
from pathlib import Path
from typing import Any

import pytest
import torch

from echoscape.cli.__main__ import main
from echoscape.eval.odometry.learned import learned_odometry
from echoscape.learn.data.image_settings import ImageSettings
from echoscape.learn.model.keypoint_model import KeypointModel
from echoscape.learn.model.model_settings import ModelSettings
from echoscape.learn.model.weights import write_weights
from echoscape.sim.datasets.layouts.oxford import read_odometry
from echoscape.sim.sensor.cts350x import CTS350X
from tests.eval.drives import write_points

MOTION = (2.0, 0.3, 0.05)


@pytest.fixture(scope="module")
def points(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return write_points(tmp_path_factory.mktemp("drive") / "set", MOTION)


@pytest.fixture
def weights(tmp_path: Path) -> Path:
    torch.manual_seed(1)
    settings = ModelSettings(image=ImageSettings(pixel_m=2.0, size=64), cells=4)
    write_weights(tmp_path / "w.safetensors", KeypointModel(settings), {})
    return tmp_path / "w.safetensors"


def refusal(capsys: pytest.CaptureFixture[str], *words: str) -> str:
    """The line by which the command refuses."""
    assert main(["odometry", *words]) == 2
    captured = capsys.readouterr()
    assert captured.out == ""
    line = captured.err.splitlines()[-1]
    assert line.startswith("echoscape odometry: ")
    return line


@pytest.mark.parametrize("method", ["fourier", "cen2018", "cen2019"])
def test_run_writes_motion_figures_and_pictures(
    method: str, points: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    out = tmp_path / "new" / "out"
    assert main(["odometry", str(points), "--out", str(out), "--method", method]) == 0
    output = capsys.readouterr().out
    assert "none failed" in output
    assert str(out / "metrics.json") in output
    found = json.loads((out / "metrics.json").read_text())
    assert (found["method"], found["pairs"], found["failed_pairs"]) == (method, 1, 0)
    assert found["translation_error_m_mean"] < 0.1
    assert found["rotation_error_deg_mean"] < 0.45
    assert read_odometry(out / "odometry.csv")[0].x == pytest.approx(MOTION[0], abs=0.1)
    for name in ("trajectory.png", "pairs.png", "matches.png"):
        assert (out / name).read_bytes().startswith(b"\x89PNG")
    assert not [path for path in out.iterdir() if path.name.startswith(".")]


def test_learned_run_writes_its_matches(points: Path, weights: Path, tmp_path: Path) -> None:
    out = tmp_path / "out"
    assert main(["odometry", str(points), "--out", str(out), "--weights", str(weights)]) == 0
    found = json.loads((out / "metrics.json").read_text())
    assert (found["method"], found["pairs"], found["failed_pairs"]) == ("learned", 1, 0)
    line = (out / "pairs.csv").read_text().splitlines()[1].split(",")
    assert line[5] == "16"  # 4 x 4 keypoints
    assert (out / "matches.png").is_file()


@pytest.mark.parametrize(
    ("options", "method"),
    [
        ("", "learned"),
        ("--solver keyframe --no-compensate", "learned, not compensated"),
        ("--solver robust", "learned, robust"),
        ("--solver robust --no-compensate", "learned, robust, not compensated"),
        ("--solver paper", "learned, paper"),
        ("--solver paper --device cpu", "learned, paper"),
    ],
)
def test_solver_and_compensation_are_chosen_by_options(
    points: Path, weights: Path, tmp_path: Path, options: str, method: str
) -> None:
    out = tmp_path / "out"
    words = ["odometry", str(points), "--out", str(out), "--weights", str(weights)]
    assert main([*words, *options.split()]) == 0
    assert json.loads((out / "metrics.json").read_text())["method"] == method


def test_the_doppler_shift_is_that_of_the_sensor(
    points: Path, weights: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    asked: list[float | None] = []

    def odometry(*args: Any, doppler_beta_s: float | None, **words: Any) -> Any:
        asked.append(doppler_beta_s)
        return learned_odometry(*args, doppler_beta_s=doppler_beta_s, **words)

    monkeypatch.setattr("echoscape.eval.odometry.learned.learned_odometry", odometry)
    words = ["odometry", str(points), "--weights", str(weights), "--out"]
    assert main([*words, str(tmp_path / "one")]) == 0
    assert main([*words, str(tmp_path / "two"), "--no-compensate"]) == 0
    assert asked == [pytest.approx(CTS350X.doppler_beta_s), None]


@pytest.mark.parametrize(
    "flag",
    [
        *(("--solver", "robust"), ("--loop-pairs", "3"), ("--resolution", "0.3456"), ("--threads", "2")),
        *(("--device", "cpu"), ("--no-compensate",), ("--compensate",)),
    ],
)
def test_what_only_the_learned_method_has_is_refused_with_others(
    flag: tuple[str, ...], points: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    line = refusal(capsys, str(points), "--out", str(tmp_path / "out"), "--method", "fourier", *flag)
    assert f"{flag[0]} goes with --method learned only" in line


def test_learned_method_without_weights_says_what_to_do(
    points: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("echoscape.learn.model.weights.shipped_weights", dict)
    line = refusal(capsys, str(points), "--out", str(tmp_path / "out"))
    assert "no weights" in line
    assert "--weights" in line
    assert "--method fourier" in line
    assert not (tmp_path / "out").exists()


def test_loop_pairs_need_a_matcher_of_single_pairs(
    points: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    words = (str(points), "--out", str(tmp_path / "out"), "--loop-pairs", "3", "--solver", "paper")
    assert "--loop-pairs goes with --solver keyframe or robust" in refusal(capsys, *words)


@pytest.mark.parametrize("in_file", [False, True])
def test_compensation_by_the_papers_solver_is_refused(
    in_file: bool, points: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    (tmp_path / "c.toml").write_text("compensate = true\n")
    asked = ("--config", str(tmp_path / "c.toml")) if in_file else ("--compensate",)
    words = (str(points), "--out", str(tmp_path / "out"), "--solver", "paper", *asked)
    assert "--compensate goes with --solver keyframe or robust, got --solver paper" in refusal(capsys, *words)


def test_run_in_which_every_pair_fails_is_written_and_fails(
    points: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    folder = tmp_path / "set"
    (folder / "radar").mkdir(parents=True)
    names = sorted(path.name for path in (points / "radar").iterdir())
    for name in names:
        (folder / "radar" / name).write_bytes((points / "radar" / name).read_bytes())
    broken = folder / "radar" / names[-1]
    broken.write_bytes(broken.read_bytes()[:200])
    out = tmp_path / "out"
    assert main(["odometry", str(folder), "--out", str(out), "--method", "fourier"]) == 1
    captured = capsys.readouterr()
    assert "1 failed" in captured.out
    assert str(broken) in captured.err.splitlines()[-1]
    found = json.loads((out / "metrics.json").read_text())
    assert (found["pairs"], found["failed_pairs"], found["pairs_with_truth"]) == (1, 1, 0)
    assert found["pairs_per_s"] is None
    assert not (out / "matches.png").exists()


def test_bad_input_is_refused(points: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    out = str(tmp_path / "out")
    assert "no such folder" in refusal(capsys, str(tmp_path / "absent"), "--out", out)
    assert "--method" in refusal(capsys, str(points), "--out", out, "--method", "magic")
    assert "--out is required" in refusal(capsys, str(points))
    assert "OUT must not be a data set" in refusal(capsys, str(points), "--out", str(points))
    both = ("--method", "fourier", "--weights", "w.safetensors")
    assert "--weights goes with --method learned" in refusal(capsys, str(points), "--out", out, *both)
    missing = str(tmp_path / "no.safetensors")
    assert missing in refusal(capsys, str(points), "--out", out, "--weights", missing)
    (tmp_path / "file").write_text("")
    place = str(tmp_path / "file")
    assert "OUT must be a folder" in refusal(capsys, str(points), "--out", place, "--method", "fourier")
    assert not Path(out).exists()


@pytest.mark.parametrize("solver", ["keyframe", "robust", "paper"])
@pytest.mark.parametrize("dtype", ["fast", "float32"])
def test_the_number_of_threads_does_not_change_a_byte(
    points: Path, tmp_path: Path, solver: str, dtype: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    """By the bundled weights, at 320 pixels: large enough that two threads share the work.

    In the number format that this processor is fast with, and in float32, which others take.
    """
    if dtype == "float32":
        monkeypatch.setattr("torch.cpu.get_capabilities", dict)
    for threads in ("1", "2"):
        words = ["--out", str(tmp_path / threads), "--threads", threads, "--solver", solver]
        assert main(["odometry", str(points), *words]) == 0
        assert torch.get_num_threads() == int(threads)
    for name in ("odometry.csv", "trajectory.txt", "trajectory.tum"):  # pairs.csv has times
        one, two = ((tmp_path / threads / name).read_bytes() for threads in ("1", "2"))
        assert one == two, name


def test_one_thread_is_the_default(points: Path, weights: Path, tmp_path: Path) -> None:
    torch.set_num_threads(2)
    assert main(["odometry", str(points), "--out", str(tmp_path / "out"), "--weights", str(weights)]) == 0
    assert torch.get_num_threads() == 1


def test_bad_threads_and_devices_are_refused(
    points: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    out = ("--out", str(tmp_path / "out"))
    assert "threads must be 1 or more, got 0" in refusal(capsys, str(points), *out, "--threads", "0")
    assert "--device" in refusal(capsys, str(points), *out, "--device", "moon")
    if not torch.cuda.is_available():
        assert "PyTorch finds no CUDA device" in refusal(capsys, str(points), *out, "--device", "cuda")
    assert not (tmp_path / "out").exists()
