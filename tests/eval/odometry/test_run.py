"""Odometry over folders: every pair has a result, failures among them, and the worst one is found."""

import math
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from numpy.testing import assert_allclose

from echoscape.eval.odometry.interface import MatchedPoints, PairMotion
from echoscape.eval.odometry.report import write_odometry_report
from echoscape.eval.odometry.run import OdometryResult, run_odometry
from echoscape.sim.datasets.files.atomic_write import DatasetError
from echoscape.sim.datasets.polar_scan import PolarScan
from tests.eval.drives import LAST_AZIMUTH_US, START_US, TURN_US, Knowing, opened, square, write_drive


def run(folder: Path, method: Knowing) -> OdometryResult:
    return run_odometry(opened(folder), method)


def test_square_ends_where_it_began(tmp_path: Path) -> None:
    found = run(write_drive(tmp_path, square()), Knowing(square()))
    assert_allclose(found.poses[[30, 60, 90, 120], :2], [[60, 0], [60, 60], [0, 60], [0, 0]], atol=1e-9)


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
    assert odometry.middle_us[3] == START_US + 3 * TURN_US + LAST_AZIMUTH_US // 2


def test_each_unreadable_scan_is_named_in_its_failures(tmp_path: Path) -> None:
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


def test_one_scan_is_no_drive(tmp_path: Path) -> None:
    with pytest.raises(DatasetError, match="odometry needs 2 scans or more, found 1"):
        run(write_drive(tmp_path, [], truth=False), Knowing([]))


def test_errors_of_the_program_are_not_failures_of_a_pair(tmp_path: Path) -> None:
    with pytest.raises(IndexError):
        run(write_drive(tmp_path, [(1.0, 0.0, 0.0)] * 3), Knowing([(1.0, 0.0, 0.0)]))
