"""The learned odometry as an estimator: which scan is the source, whose points are whose, what fails."""

from pathlib import Path
from typing import cast

import numpy as np
import pytest
from numpy.testing import assert_allclose, assert_array_equal

from echoscape.eval.odometry.interface import PairFailed
from echoscape.eval.odometry.learned import (
    LearnedOdometry,
    chosen_weights,
    learned_odometry,
    shipped_weights,
)
from echoscape.learn.model.weights import read_weights
from echoscape.learn.odometry.keyframe_odometry import PAIRS_ALONE, KeyframeOdometry, OdometryConfig, Scan
from echoscape.learn.odometry.scan_matcher import PairEstimate, ScanMatcher
from echoscape.sim.datasets.files.atomic_write import DatasetError
from echoscape.sim.datasets.se2 import SE2
from tests.eval.drives import landmarks, scan_of


class Recorded:
    """A follower whose track is the scan itself, and whose motion tells which one was the source."""

    settings = OdometryConfig()
    compensates = True

    def __init__(self, *, certain: bool = True) -> None:
        self.certain = certain

    def start(self, scan: Scan) -> Scan:
        return scan

    def follow(self, track: Scan, scan: Scan) -> tuple[PairEstimate, Scan]:
        found = PairEstimate(
            motion=SE2(x_m=2.0, y_m=0.5, yaw_rad=0.1),
            source_m=np.full((3, 2), scan.middle_s, np.float32),
            destination_m=np.full((3, 2), track.middle_s, np.float32),
            weights=np.ones(3, np.float32),
            certain=self.certain,
            agreement=3.0,
        )
        return found, scan


def odometry(**words: bool) -> LearnedOdometry:
    return LearnedOdometry(cast(KeyframeOdometry, Recorded(**words)), range_offset_m=-0.3)


START = scan_of(landmarks(count=5), (0.0, 0.0, 0.0))
LATER = scan_of(landmarks(count=5), (0.0, 0.0, 0.0), number=1)


def test_points_are_told_by_whose_they_are() -> None:
    state = odometry().start(START)
    found, after = odometry().follow(state, LATER)
    assert (found.x_m, found.y_m, found.yaw_rad) == (2.0, 0.5, 0.1)
    assert found.matches is not None
    assert_allclose(found.matches.later_m, cast(Scan, after).middle_s, rtol=1e-6)
    assert_allclose(found.matches.earlier_m, cast(Scan, state).middle_s, rtol=1e-6)


def test_uncertain_rotation_is_a_failure() -> None:
    open_one = odometry(certain=False)
    with pytest.raises(PairFailed, match="the matches leave the rotation open"):
        open_one.follow(open_one.start(START), LATER)


def test_scan_goes_in_with_its_bins_offset_and_times() -> None:
    found = cast(Scan, odometry().start(START))
    assert_array_equal(found.codes, START.codes)
    assert (found.bin_m, found.range_offset_m) == (START.bin_m, -0.3)
    times_s = START.timestamp_us / 1e6
    assert found.middle_s == pytest.approx((times_s[0] + times_s[-1]) / 2, abs=1e-5)
    assert found.turn_s == pytest.approx(np.diff(times_s).mean() * len(times_s), abs=1e-5)


def test_the_name_says_how_it_is_done() -> None:
    estimator = cast(ScanMatcher, None)
    names = [
        LearnedOdometry(KeyframeOdometry(estimator, settings, doppler_beta_s=beta_s)).name
        for settings, beta_s in ((None, 0.05), (PAIRS_ALONE, 0.05), (None, None))
    ]
    assert names == ["learned", "learned, pairs alone", "learned, not compensated"]


def test_what_is_no_weights_is_told(tmp_path: Path) -> None:
    (tmp_path / "w.safetensors").write_bytes(b"nothing")
    with pytest.raises(DatasetError, match=r"w\.safetensors"):
        learned_odometry(tmp_path / "w.safetensors")


def test_weights_are_chosen_by_resolution_the_coarsest_by_default(monkeypatch: pytest.MonkeyPatch) -> None:
    files = {0.6912: Path("coarse"), 0.3456: Path("fine")}
    monkeypatch.setattr("echoscape.eval.odometry.learned.shipped_weights", lambda: files)
    assert chosen_weights() == Path("coarse")
    assert chosen_weights(0.3456) == Path("fine")
    with pytest.raises(DatasetError, match=r"resolution must be one of 0\.6912, 0\.3456, got 1\.0"):
        chosen_weights(1.0)


def test_weights_that_came_along_are_of_the_resolution_that_they_are_named_for() -> None:
    for pixel_m, path in shipped_weights().items():
        model, record = read_weights(path)
        assert model.settings.image.pixel_m == pixel_m
        assert record["data"]
