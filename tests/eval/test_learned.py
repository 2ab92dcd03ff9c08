"""The learned odometry as an estimator: which scan is the source, whose points are whose, what fails."""

from pathlib import Path
from typing import Any, cast

import numpy as np
import pytest

from echoscape.eval.estimator import PairFailed
from echoscape.eval.learned import (
    LearnedOdometry,
    TimedFeatures,
    chosen_weights,
    learned_odometry,
    shipped_weights,
)
from echoscape.learn.augment import PlaneMotion
from echoscape.learn.inference import Estimator, PairEstimate, ScanFeatures
from echoscape.learn.rolling import Rolling
from echoscape.learn.weights import read_weights
from echoscape.sim.whole_files import DatasetError
from tests.eval.drives import landmarks, scan_of


class Recorded:
    """An estimator whose features are what it was given, and whose motion tells which one was the source."""

    def __init__(self, *, certain: bool = True) -> None:
        self.certain = certain

    def features(
        self, codes: np.ndarray, bin_m: float, *, range_offset_m: float
    ) -> tuple[float, float, float]:
        return float(codes.max()), bin_m, range_offset_m

    def estimate(self, source: float, destination: float, rolling: Rolling | None) -> PairEstimate:
        self.rolling = rolling
        # By docs/conventions.md the source is the later scan: driving on from 10 to 12 is +2.
        return PairEstimate(
            motion=PlaneMotion(x_m=source - destination, y_m=0.5, yaw_rad=0.1),
            source_m=np.full((3, 2), source, np.float32),
            destination_m=np.full((3, 2), destination, np.float32),
            weights=np.ones(3, np.float32),
            certain=self.certain,
            agreement=3.0,
        )


def odometry(**words: bool) -> Any:
    return LearnedOdometry(cast(Estimator, Recorded(**words)), range_offset_m=-0.3)


def timed(value: float) -> TimedFeatures:
    """Features that are a number; its seventh is the time, a turn takes 0.2 s."""
    return TimedFeatures(features=cast(ScanFeatures, value), middle_s=value / 7, turn_s=0.2)


def test_later_scan_is_the_source() -> None:
    found = odometry().motion(timed(10.0), timed(12.0))
    assert (found.x_m, found.y_m, found.yaw_rad) == (2.0, 0.5, 0.1)
    assert (found.matches.later_m == 12).all()
    assert (found.matches.earlier_m == 10).all()


def test_uncertain_rotation_is_a_failure() -> None:
    with pytest.raises(PairFailed, match="the matches leave the rotation open"):
        odometry(certain=False).motion(timed(10.0), timed(12.0))


def test_scan_goes_in_with_its_bins_and_offset() -> None:
    scan = scan_of(landmarks(count=5), (0.0, 0.0, 0.0))
    found = odometry().features(scan)
    assert found.features == (float(scan.codes.max()), scan.bin_m, -0.3)
    times_s = scan.timestamp_us / 1e6
    assert found.middle_s == pytest.approx((times_s[0] + times_s[-1]) / 2, abs=1e-5)
    assert found.turn_s == pytest.approx(np.diff(times_s).mean() * len(times_s), abs=1e-5)


def test_compensation_knows_turn_gap_and_doppler() -> None:
    recorded = Recorded()
    LearnedOdometry(cast(Estimator, recorded), doppler_beta_s=0.05).motion(timed(7.0), timed(14.0))
    assert recorded.rolling == Rolling(turn_s=0.2, doppler_beta_s=0.05, gap_s=1.0)
    LearnedOdometry(cast(Estimator, recorded)).motion(timed(7.0), timed(14.0))
    assert recorded.rolling is None


def test_scans_of_one_time_cannot_be_compensated() -> None:
    found = LearnedOdometry(cast(Estimator, Recorded()), doppler_beta_s=0.05)
    with pytest.raises(PairFailed, match="gap_s must be finite and not 0"):
        found.motion(timed(7.0), timed(7.0))


def test_what_is_no_weights_is_told(tmp_path: Path) -> None:
    (tmp_path / "w.safetensors").write_bytes(b"nothing")
    with pytest.raises(DatasetError, match=r"w\.safetensors"):
        learned_odometry(tmp_path / "w.safetensors")


def test_weights_are_chosen_by_resolution_the_coarsest_by_default(monkeypatch: pytest.MonkeyPatch) -> None:
    files = {0.6912: Path("coarse"), 0.3456: Path("fine")}
    monkeypatch.setattr("echoscape.eval.learned.shipped_weights", lambda: files)
    assert chosen_weights() == Path("coarse")
    assert chosen_weights(0.3456) == Path("fine")
    with pytest.raises(DatasetError, match=r"resolution must be one of 0\.6912, 0\.3456, got 1\.0"):
        chosen_weights(1.0)


def test_weights_that_came_along_are_of_the_resolution_that_they_are_named_for() -> None:
    for pixel_m, path in shipped_weights().items():
        model, record = read_weights(path)
        assert model.settings.image.pixel_m == pixel_m
        assert record["data"]
