"""Odometry over folders: a perfect estimate has no error, a failed pair is a result, and so in the files."""

import json
import math
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from numpy.testing import assert_allclose

from echoscape.eval.odometry.interface import MatchedPoints, PairMotion
from echoscape.eval.odometry.metrics import odometry_metrics, pair_errors, runs_of_true
from echoscape.eval.odometry.report import write_odometry_report
from echoscape.eval.odometry.run import OdometryResult, run_odometry
from echoscape.eval.odometry.trajectory_io import read_kitti, read_tum
from echoscape.sim.datasets.files.atomic_write import DatasetError
from echoscape.sim.datasets.layouts.layout import ScanRecord
from echoscape.sim.datasets.layouts.mulran import MulRan
from echoscape.sim.datasets.layouts.oxford import read_odometry
from echoscape.sim.datasets.polar_scan import PolarScan
from echoscape.sim.datasets.scan_folder import open_folder
from tests.eval.drives import LAST_ROW_US, START_US, TINY, TURN_US, Knowing, opened, square, write_drive

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


def test_perfect_estimate_has_no_error_from_scans_to_metrics(tmp_path: Path) -> None:
    folder = write_drive(tmp_path, square())
    method = Knowing(square())
    found = odometry_metrics(run(folder, method))
    assert method.seen == list(range(121))  # once a scan, in order
    assert (found["pairs"], found["failed_pairs"], found["pairs_with_truth"]) == (120, 0, 120)
    # The file of the truth has six decimals.
    assert found["translation_error_m_max"] == pytest.approx(0, abs=1e-6)
    assert found["rotation_error_deg_max"] == pytest.approx(0, abs=math.degrees(1e-6))
    assert found["kitti_drift"]["segments"] > 0
    assert found["kitti_drift"]["translation_percent"] == pytest.approx(0, abs=1e-3)
    assert found["kitti_drift"]["rotation_deg_per_m"] == pytest.approx(0, abs=1e-5)
    assert found["path_m"] == pytest.approx(240)
    assert found["pairs_per_s"] > 0


def test_square_ends_where_it_began(tmp_path: Path) -> None:
    found = run(write_drive(tmp_path, square()), Knowing(square()))
    assert_allclose(found.poses[[30, 60, 90, 120], :2], [[60, 0], [60, 60], [0, 60], [0, 0]], atol=1e-9)


def test_errors_are_of_the_motion_from_scan_to_scan(tmp_path: Path) -> None:
    folder = write_drive(tmp_path, [(2.0, 0.0, 0.1)] * 4)
    wrong = [(2.0, 0.0, 0.1), (2.3, 0.4, 0.1), (2.0, 0.0, 0.1 - math.radians(2)), (2.0, -0.1, 0.1)]
    found = odometry_metrics(run(folder, Knowing(wrong)))
    assert found["translation_error_m_mean"] == pytest.approx((0 + 0.5 + 0 + 0.1) / 4, abs=1e-6)
    assert found["translation_error_m_median"] == pytest.approx(0.05, abs=1e-6)
    assert found["translation_error_m_max"] == pytest.approx(0.5, abs=1e-6)
    assert found["rotation_error_deg_mean"] == pytest.approx(2 / 4, abs=1e-4)
    assert found["rotation_error_deg_median"] == pytest.approx(0, abs=1e-4)
    assert found["kitti_drift"]["translation_percent"] is found["kitti_drift"]["rotation_deg_per_m"] is None
    assert found["kitti_drift"]["segments"] == 0


def test_failed_pair_is_recorded_and_counts_as_no_motion(tmp_path: Path) -> None:
    folder = write_drive(tmp_path, square())
    odometry = run(folder, Knowing(square(), failing=[10]))
    found = odometry_metrics(odometry)
    assert (found["pairs"], found["failed_pairs"], found["pairs_with_truth"]) == (120, 1, 120)
    stamp = START_US + 10 * TURN_US
    assert found["failures"] == [
        {"pair": 10, "earlier": stamp, "later": stamp + TURN_US, "reason": "told to"}
    ]
    assert_allclose(odometry.poses[11], odometry.poses[10])
    assert pair_errors(odometry)[10, 0] == pytest.approx(2.0, abs=1e-6)
    assert found["translation_error_m_mean"] == pytest.approx(2 / 120, abs=1e-6)
    # The segments that hold the pair are two metres short: at 100 m that is 2 %.
    assert found["kitti_drift"]["translation_percent"] > 0.1
    assert found["kitti_drift"]["by_length"][0]["translation_percent"] > 0.1


def test_scan_without_features_fails_both_its_pairs(tmp_path: Path) -> None:
    folder = write_drive(tmp_path, [(1.0, 0.0, 0.0)] * 5)
    odometry = run(folder, Knowing([(1.0, 0.0, 0.0)] * 5, blind=2))
    assert odometry.failed.tolist() == [False, True, True, False, False]
    assert "nothing to see" in (odometry.pairs[1].failure or "")


def test_scan_that_cannot_be_read_fails_both_its_pairs_and_keeps_its_place(tmp_path: Path) -> None:
    folder = write_drive(tmp_path, [(1.0, 0.0, 0.0)] * 5)
    broken = folder / "radar" / f"{START_US + 3 * TURN_US}.png"
    broken.write_bytes(broken.read_bytes()[:60])
    odometry = run(folder, Knowing([(1.0, 0.0, 0.0)] * 5))
    assert odometry.failed.tolist() == [False, False, True, True, False]
    assert str(broken) in (odometry.pairs[2].failure or "")
    assert odometry.middle_us[3] == START_US + 3 * TURN_US + LAST_ROW_US // 2


def test_scans_that_cannot_be_read_in_a_row_and_at_the_start_are_told_each(tmp_path: Path) -> None:
    folder = write_drive(tmp_path, [(1.0, 0.0, 0.0)] * 6)
    drive = opened(folder)
    for number in (0, 3, 4):
        (folder / "radar" / f"{START_US + number * TURN_US}.png").write_bytes(b"nothing")
    odometry = run_odometry(drive, Knowing([(1.0, 0.0, 0.0)] * 6))
    assert odometry.failed.tolist() == [True, False, True, True, True, False]
    for pair, number in ((0, 0), (2, 3), (3, 4), (4, 4)):
        assert str(START_US + number * TURN_US) in (odometry.pairs[pair].failure or "")


def test_the_worst_pair_is_the_one_with_the_largest_error_and_is_drawn(tmp_path: Path) -> None:
    folder, out = write_drive(tmp_path / "set", [(1.0, 0.0, 0.0)] * 5), tmp_path / "out"
    sideways_m = (0.0, 0.0, 0.1, -0.3, 0.2)
    odometry = run(folder, Knowing([(1.0, each, 0.0) for each in sideways_m]))
    assert odometry.worst is not None
    assert (odometry.worst.index, odometry.worst.criterion) == (3, "largest translation error")
    assert odometry.worst.motion.y_m == -0.3
    write_odometry_report(out, odometry, opened(folder))
    assert (out / "matches.png").is_file()


def test_without_truth_the_worst_pair_has_the_lowest_sum_of_weights(tmp_path: Path) -> None:
    class Matching(Knowing):
        """Matches two points in each pair, less surely in the third."""

        def follow(self, state: int, scan: PolarScan) -> tuple[PairMotion, int]:
            motion, number = super().follow(state, scan)
            points, weights = np.zeros((2, 2)), np.full(2, 0.1 if number == 3 else 0.9)
            matches = MatchedPoints(earlier_m=points, later_m=points, weights=weights)
            return replace(motion, matches=matches), number

    folder = write_drive(tmp_path / "set", [(1.0, 0.0, 0.0)] * 5, truth=False)
    odometry = run(folder, Matching([(1.0, 0.0, 0.0)] * 5))
    assert odometry.worst is not None
    assert (odometry.worst.index, odometry.worst.criterion) == (2, "lowest sum of match weights")
    assert odometry.worst.motion.matches is not None
    assert [pair.matches for pair in odometry.pairs] == [2] * 5
    assert all(pair.motion is not None and pair.motion.matches is None for pair in odometry.pairs)


def test_a_run_without_a_pose_draws_no_pair(tmp_path: Path) -> None:
    folder, out = write_drive(tmp_path / "set", [(1.0, 0.0, 0.0)] * 3), tmp_path / "out"
    odometry = run(folder, Knowing([(1.0, 0.0, 0.0)] * 3, failing=[0, 1, 2]))
    assert odometry.worst is None
    write_odometry_report(out, odometry, opened(folder))
    assert {path.name for path in out.iterdir()} == ALWAYS | {"truth.txt", "truth.tum"}


def test_motion_that_is_no_number_is_a_failure(tmp_path: Path) -> None:
    folder = write_drive(tmp_path, [(1.0, 0.0, 0.0)] * 3)
    odometry = run(folder, Knowing([(1.0, 0.0, 0.0), (math.nan, 0.0, 0.0), (1.0, 0.0, 0.0)]))
    assert odometry.failed.tolist() == [False, True, False]
    assert_allclose(odometry.poses[-1], [2, 0, 0])


def test_speed_is_that_of_pairs_that_came_to_a_pose_after_the_start(tmp_path: Path) -> None:
    odometry = run(write_drive(tmp_path, [(1.0, 0.0, 0.0)] * 4), Knowing([(1.0, 0.0, 0.0)] * 4, failing=[2]))
    seconds = [8.0, 0.5, 0.001, 0.3]
    timed = [replace(pair, seconds=each) for pair, each in zip(odometry.pairs, seconds, strict=True)]
    assert replace(odometry, pairs=tuple(timed)).pairs_per_s == pytest.approx(2 / 0.8)
    assert replace(odometry, pairs=tuple(timed[:1])).pairs_per_s == pytest.approx(1 / 8)
    assert replace(odometry, pairs=(timed[2],)).pairs_per_s is None


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
    assert times[1] == START_US + TURN_US + LAST_ROW_US // 2
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
    assert line[-1] == '"told to"'


def test_stretches_whose_truth_is_unknown_are_not_judged(tmp_path: Path) -> None:
    odometry = run(write_drive(tmp_path, square()), Knowing(square()))
    assert odometry.truth is not None
    truth = odometry.truth.copy()
    truth[[0, 60]] = np.nan
    found = odometry_metrics(replace(odometry, truth=truth))
    assert found["pairs_with_truth"] == 120 - 3
    # 59 and 60 frames of 2 m are left on either side: segments of 100 m begin at their first frames only.
    assert found["kitti_drift"]["segments"] == 2
    assert found["kitti_drift"]["translation_percent"] == pytest.approx(0, abs=1e-3)


def test_stretches_are_the_runs_of_true() -> None:
    known = np.array([1, 1, 0, 0, 1, 0, 1, 1, 1], bool)
    assert runs_of_true(known) == [slice(0, 2), slice(4, 5), slice(6, 9)]
    assert runs_of_true(np.zeros(3, bool)) == []


def test_other_layouts_have_the_same_truth(tmp_path: Path) -> None:
    # A quarter of a circle to the left in the world of MulRan's poses: x ahead, then y (left) grows.
    layout, angles = MulRan(), np.linspace(0, math.pi / 2, 6)
    poses = np.stack([10 * np.sin(angles), 10 - 10 * np.cos(angles), np.zeros(6), angles], axis=1)
    for name in layout.folders:
        (tmp_path / name).mkdir(parents=True, exist_ok=True)
    source = write_drive(tmp_path / "oxford", [(1.0, 0.0, 0.0)] * 5)
    records = []
    for scan, pose in zip(opened(source), poses, strict=True):
        stem = layout.stem(scan.timestamp_us)
        layout.write_scan(layout.scan_path(tmp_path, stem), scan)
        middle_us = int(scan.timestamp_us[0] + scan.timestamp_us[-1]) // 2
        record = ScanRecord(stem=stem, middle_us=middle_us, middle_pose=pose, pose=np.tile(pose, (8, 1)))
        records.append(record)
    layout.write_motion(tmp_path, records, TINY)
    turn, chord = math.pi / 10, 20 * math.sin(math.pi / 20)
    step = (chord * math.cos(turn / 2), -chord * math.sin(turn / 2), -turn)
    sensor = replace(TINY, rotation_hz=1e6 / (LAST_ROW_US * 8 / 7))
    found = run_odometry(open_folder(tmp_path, layout="mulran", sensor=sensor), Knowing([step] * 5))
    assert odometry_metrics(found)["translation_error_m_max"] == pytest.approx(0, abs=1e-6)
    assert odometry_metrics(found)["rotation_error_deg_max"] == pytest.approx(0, abs=1e-6)
    assert found.names[0] == (START_US + LAST_ROW_US) * 1000


def test_one_scan_is_no_drive(tmp_path: Path) -> None:
    with pytest.raises(DatasetError, match="odometry needs 2 scans or more, found 1"):
        run(write_drive(tmp_path, [], truth=False), Knowing([]))


def test_errors_of_the_program_are_not_failures_of_a_pair(tmp_path: Path) -> None:
    with pytest.raises(IndexError):
        run(write_drive(tmp_path, [(1.0, 0.0, 0.0)] * 3), Knowing([(1.0, 0.0, 0.0)]))


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


def test_matches_have_points_for_every_weight() -> None:
    with pytest.raises(ValueError, match=r"points must be \(N, 2\) twice"):
        MatchedPoints(earlier_m=np.zeros((3, 2)), later_m=np.zeros((2, 2)), weights=np.zeros(3))
    assert not PairMotion(x_m=0.0, y_m=math.inf, yaw_rad=0.0).is_finite
