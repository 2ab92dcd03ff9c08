"""`echoscape drift`: the figures as JSON or as a table, or one line on what is wrong."""

import json
from pathlib import Path

import numpy as np
import pytest

from echoscape.cli.__main__ import main
from echoscape.eval.odometry.trajectory_io import kitti_text, matrices
from echoscape.sim.datasets.se2 import chain
from tests.paths import SHARED


def write_drive(path: Path, *, frames: int, step_m: float) -> str:
    motions = np.tile([step_m, 0.0, 0.0], (frames - 1, 1))
    path.write_text(kitti_text(matrices(chain(motions))))
    return str(path)


def test_json_has_the_figures(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    truth = write_drive(tmp_path / "t.txt", frames=102, step_m=1.0)
    estimate = write_drive(tmp_path / "e.txt", frames=102, step_m=1.02)
    assert main(["drift", "--estimate", estimate, "--truth", truth, "--json"]) == 0
    found = json.loads(capsys.readouterr().out)
    assert found["translation_percent"] == pytest.approx(2.02)  # 2 % of 101 m, over 100 m
    assert found["rotation_deg_per_m"] == pytest.approx(0)
    assert found["segments"] == 1


def test_step_is_heeded(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    truth = write_drive(tmp_path / "t.txt", frames=121, step_m=1.0)
    counts = []
    for words in ([], ["--step", "4"], ["--step", "1"]):
        assert main(["drift", "--estimate", truth, "--truth", truth, "--json", *words]) == 0
        counts.append(json.loads(capsys.readouterr().out)["segments"])
    assert counts == [2, 5, 20]  # starts at 0..19 of 121 frames


def test_short_drive_is_null(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    truth = write_drive(tmp_path / "t.txt", frames=20, step_m=1.0)
    assert main(["drift", "--estimate", truth, "--truth", truth, "--json"]) == 0
    found = json.loads(capsys.readouterr().out)
    expected = {"translation_percent": None, "rotation_deg_per_m": None, "segments": 0, "by_length": []}
    assert found == expected
    assert main(["drift", "--estimate", truth, "--truth", truth]) == 0
    assert capsys.readouterr().out.split()[-4:] == ["all", "-", "-", "0"]


def test_table_has_a_row_a_length(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    truth = write_drive(tmp_path / "t.txt", frames=202, step_m=1.0)
    assert main(["drift", "--estimate", truth, "--truth", truth]) == 0
    lines = [line.split() for line in capsys.readouterr().out.splitlines()]
    assert [line[0] for line in lines[1:]] == ["100", "200", "all"]


def test_published_figures(capsys: pytest.CaptureFixture[str]) -> None:
    folder = SHARED / "kitti" / "21"
    if not folder.is_dir():
        pytest.skip("needs published trajectories in shared/kitti beside the checkout")
    words = ["--estimate", str(folder / "est.txt"), "--truth", str(folder / "gt.txt"), "--json"]
    assert main(["drift", *words]) == 0
    found = json.loads(capsys.readouterr().out)
    assert found["translation_percent"] == pytest.approx(1.252, abs=5e-5)
    assert 100 * found["rotation_deg_per_m"] == pytest.approx(0.39219, abs=5e-5)


@pytest.mark.parametrize(
    ("estimate", "words", "message"),
    [
        ("absent.txt", [], "absent.txt: cannot be read"),
        ("bad.txt", [], "bad.txt: line 1 is no pose"),
        ("short.txt", [], "estimate must have as many poses as truth, 20, got 19"),
        ("t.txt", ["--step", "0"], "step must be 1 or more, got 0"),
        ("t.txt", ["--speed", "3"], "--speed"),
    ],
)
def test_what_is_wrong_is_reported_in_one_line(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], estimate: str, words: list[str], message: str
) -> None:
    truth = write_drive(tmp_path / "t.txt", frames=20, step_m=1.0)
    write_drive(tmp_path / "short.txt", frames=19, step_m=1.0)
    (tmp_path / "bad.txt").write_text("1 2 nan\n")
    assert main(["drift", "--estimate", str(tmp_path / estimate), "--truth", truth, *words]) == 2
    captured = capsys.readouterr()
    assert captured.out == ""
    assert message in captured.err
    assert len(captured.err.splitlines()) == 1
