"""Pairs of one place at any heading: which are drawn, what is true of them, what counts as found."""

import math
from dataclasses import replace
from pathlib import Path
from typing import cast

import numpy as np
import pytest

from echoscape.eval.odometry.loop_closure import MAX_DISTANCE_M, loop_closure_recall, places_of, rotated_pairs
from echoscape.learn.odometry.pair_estimate import PairEstimate
from echoscape.learn.odometry.scan_matcher import ScanMatcher
from echoscape.sim.datasets.files.atomic_write import DatasetError
from echoscape.sim.datasets.polar_scan import PolarScan
from echoscape.sim.datasets.se2 import SE2
from tests.eval.drives import TINY, opened, write_drive

ROWS = TINY.azimuths


def _estimate(motion: SE2) -> PairEstimate:
    none = np.zeros((1, 2), np.float32)
    return PairEstimate(
        motion=motion, source_m=none, destination_m=none, weights=none[:, 0], certain=True, agreement=1.0
    )


class Blind:
    """A matcher that finds no rotation, unless it may try headings."""

    def features(self, scan: PolarScan) -> np.ndarray:
        return scan.codes

    def estimate(self, source: np.ndarray, destination: np.ndarray) -> PairEstimate:
        return _estimate(SE2(x_m=0.0, y_m=0.0, yaw_rad=0.0))

    def estimate_any_heading(
        self, source: np.ndarray, destination: np.ndarray, *, headings: int
    ) -> PairEstimate:
        """Find the turn by brute force: by how many rows one scan is the other."""
        rows = [n for n in range(ROWS) if np.array_equal(np.roll(destination, n, axis=0), source)]
        return _estimate(SE2(x_m=0.0, y_m=0.0, yaw_rad=-2 * math.pi * rows[0] / ROWS))


def _circle(count: int = 40, radius_m: float = 10.0) -> np.ndarray:
    angle = np.linspace(0, 2 * math.pi, count)
    return np.stack([radius_m * np.cos(angle), radius_m * np.sin(angle), angle], -1)


def test_drawn_pairs_are_near_each_other_at_every_distance_and_heading() -> None:
    poses = _circle()
    found = rotated_pairs(poses, 400, 3000, seed=1)
    away = np.array([np.hypot(*(poses[pair.source] - poses[pair.destination])[:2]) for pair in found])
    assert away.max() <= MAX_DISTANCE_M
    assert all(pair.source != pair.destination for pair in found)
    counts = np.histogram(away, np.arange(0, 6, 1.0))[0]
    assert (counts[counts > 0] > 0.8 * 3000 / (counts > 0).sum()).all()
    rows = np.array([pair.azimuths for pair in found])
    assert (np.histogram(rows, 8, (0, 400))[0] > 0.7 * 3000 / 8).all()
    later = np.mean([pair.source > pair.destination for pair in found])
    assert 0.45 < later < 0.55
    assert found == rotated_pairs(poses, 400, 3000, seed=1)


def test_scans_whose_pose_is_unknown_or_that_are_far_apart_make_no_pair() -> None:
    poses = np.array([[0.0, 0, 0], [np.nan] * 3, [1.0, 0, 0], [50.0, 0, 0]])
    assert {(pair.source, pair.destination) for pair in rotated_pairs(poses, 8, 20)} == {(0, 2), (2, 0)}
    with pytest.raises(DatasetError, match="within 5 m"):
        rotated_pairs(poses[[0, 3]], 8, 1)


def test_a_turn_is_found_by_who_can_and_missed_by_who_cannot(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    folder = opened(write_drive(tmp_path / "drive", [(0.0, 0.0, 0.0)] * 3))
    codes = np.random.default_rng(1).integers(0, 99, (ROWS, 16)).astype(np.uint8)
    read = type(folder).read

    def same(self: object, index: int) -> object:
        return replace(read(folder, index), codes=codes)

    monkeypatch.setattr(type(folder), "read", same)
    reported: list[int] = []
    places = places_of(folder, 40)
    found = loop_closure_recall(
        folder, cast(ScanMatcher, Blind()), places, progress=lambda stage, done, total: reported.append(done)
    )
    assert found["within"] == 1.0
    assert found["rotation_deg_median"] == pytest.approx(0, abs=1e-9)
    assert 0 < found["plain_within"] < 0.4  # one heading of eight is none
    assert reported == list(range(41))


def test_a_folder_without_poses_cannot_judge(tmp_path: Path) -> None:
    folder = opened(write_drive(tmp_path / "drive", [(1.0, 0.0, 0.0)], truth=False))
    with pytest.raises(DatasetError, match="needs true poses"):
        places_of(folder, 1)


def test_scans_that_cannot_be_read_are_pairs_not_found(tmp_path: Path) -> None:
    folder = opened(write_drive(tmp_path / "drive", [(0.0, 0.0, 0.0)] * 3))
    places = places_of(folder, 30)
    folder.paths[1].write_bytes(b"cut")
    broken = sum(1 in (pair.source, pair.destination) for pair in places.pairs)
    found = loop_closure_recall(folder, cast(ScanMatcher, Blind()), places)
    assert 0 < found["failed"] == broken < 30
    assert found["within"] <= 1 - broken / 30
    for path in folder.paths:
        path.write_bytes(b"cut")
    none = loop_closure_recall(folder, cast(ScanMatcher, Blind()), places)
    assert (none["failed"], none["within"], none["rotation_deg_median"]) == (30, 0.0, None)
