"""Files of an odometry agree with each other, and are written whole or not at all."""

import json
from pathlib import Path

import pytest
from numpy.testing import assert_allclose

from echoscape.eval.odometry.report import write_odometry_report
from echoscape.eval.odometry.run import OdometryResult, run_odometry
from echoscape.eval.odometry.trajectory_io import read_kitti, read_tum
from echoscape.sim.datasets.layouts.oxford import read_odometry
from tests.eval.drives import LAST_AZIMUTH_US, START_US, TURN_US, Knowing, opened, square, write_drive

ALWAYS = {
    "metrics.json",
    "odometry.csv",
    "pairs.csv",
    "pairs.png",
    "trajectory.png",
    "trajectory.tum",
    "trajectory.txt",
}


def run(folder: Path, method: Knowing) -> OdometryResult:
    return run_odometry(opened(folder), method)


def test_files_agree_with_each_other_and_with_the_drive(tmp_path: Path) -> None:
    folder, out = write_drive(tmp_path / "set", square(20)), tmp_path / "out"
    odometry = run(folder, Knowing(square(20)))
    paths = write_odometry_report(out, odometry, opened(folder))
    names = {path.name for path in paths}
    assert names == {path.name for path in out.iterdir()}
    assert names == ALWAYS | {"truth.txt", "truth.tum", "matches.png"}
    rows, true = read_odometry(out / "odometry.csv"), read_odometry(folder / "gt" / "radar_odometry.csv")
    assert rows == true  # times at mid-scan, source the later one, and the motion itself
    poses = read_kitti(out / "trajectory.txt")
    assert_allclose(poses, read_kitti(out / "truth.txt"), atol=1e-4)
    assert_allclose(poses[10, :3, 3], [20, 0, 0], atol=1e-9)
    assert_allclose(poses[20, :3, 3], [20, 20, 0], atol=1e-9)  # right is y
    times, tum = read_tum(out / "trajectory.tum")
    assert_allclose(tum, poses, atol=1e-7)
    assert times[1] == START_US + TURN_US + LAST_AZIMUTH_US // 2
    assert json.loads((out / "metrics.json").read_text())["pairs"] == 40
    assert len((out / "pairs.csv").read_text().splitlines()) == 41


def test_folder_without_truth_gets_everything_but_errors(tmp_path: Path) -> None:
    folder, out = write_drive(tmp_path / "set", square(20), truth=False), tmp_path / "out"
    method = Knowing(square(20), failing=[3])
    odometry = run(folder, method)
    assert odometry.truth is None
    out.mkdir()
    (out / "truth.txt").write_text("of a run before\n")
    write_odometry_report(out, odometry, opened(folder))
    assert {path.name for path in out.iterdir()} == ALWAYS | {"matches.png"}
    found = json.loads((out / "metrics.json").read_text())
    assert (found["pairs"], found["failed_pairs"], found["pairs_with_truth"]) == (40, 1, 0)
    assert found["translation_error_m_mean"] is found["path_m"] is None
    assert found["kitti_drift"]["translation_percent"] is found["kitti_drift"]["rotation_deg_per_m"] is None
    line = (out / "pairs.csv").read_text().splitlines()[4].split(",")
    assert line[2:6] == ["1", "", "", ""]
    assert line[-1] == '"asked to fail"'


def test_a_run_without_a_pose_draws_no_pair(tmp_path: Path) -> None:
    folder, out = write_drive(tmp_path / "set", [(1.0, 0.0, 0.0)] * 3), tmp_path / "out"
    odometry = run(folder, Knowing([(1.0, 0.0, 0.0)] * 3, failing=[0, 1, 2]))
    assert odometry.worst is None
    write_odometry_report(out, odometry, opened(folder))
    assert {path.name for path in out.iterdir()} == ALWAYS | {"truth.txt", "truth.tum"}


def test_nothing_is_written_when_figures_cannot_be_drawn(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    folder, out = write_drive(tmp_path / "set", square(20)), tmp_path / "out"
    odometry = run(folder, Knowing(square(20)))

    def refuse(*words: object) -> bytes:
        raise KeyboardInterrupt

    monkeypatch.setattr("echoscape.eval.odometry.report.pairs_figure", refuse)
    with pytest.raises(KeyboardInterrupt):
        write_odometry_report(out, odometry, opened(folder))
    assert not out.exists()
