"""Metrics of an odometry: a perfect estimate has no error, a failed pair counts as no motion."""

import math
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from numpy.testing import assert_allclose

from echoscape.eval.odometry.metrics import odometry_metrics, pair_errors, runs_of_true
from echoscape.eval.odometry.run import OdometryResult, run_odometry
from echoscape.sim.datasets.layouts.layout import ScanRecord
from echoscape.sim.datasets.layouts.mulran import MulRan
from echoscape.sim.datasets.scan_folder import open_folder
from tests.eval.drives import LAST_AZIMUTH_US, START_US, TINY, TURN_US, Knowing, opened, square, write_drive


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
        {"pair": 10, "earlier": stamp, "later": stamp + TURN_US, "reason": "asked to fail"}
    ]
    assert_allclose(odometry.poses[11], odometry.poses[10])
    assert pair_errors(odometry)[10, 0] == pytest.approx(2.0, abs=1e-6)
    assert found["translation_error_m_mean"] == pytest.approx(2 / 120, abs=1e-6)
    # The segments that hold the pair are two metres short: at 100 m that is 2 %.
    assert found["kitti_drift"]["translation_percent"] > 0.1
    assert found["kitti_drift"]["by_length"][0]["translation_percent"] > 0.1


def test_stretches_without_truth_are_left_out(tmp_path: Path) -> None:
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
    sensor = replace(TINY, rotation_hz=1e6 / (LAST_AZIMUTH_US * 8 / 7))
    found = run_odometry(open_folder(tmp_path, layout="mulran", sensor=sensor), Knowing([step] * 5))
    assert odometry_metrics(found)["translation_error_m_max"] == pytest.approx(0, abs=1e-6)
    assert odometry_metrics(found)["rotation_error_deg_max"] == pytest.approx(0, abs=1e-6)
    assert found.names[0] == (START_US + LAST_AZIMUTH_US) * 1000
