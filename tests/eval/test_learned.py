"""The learned odometry as an estimator: which scan is the source, whose points are whose, what fails."""

from pathlib import Path
from typing import Any, cast

import numpy as np
import pytest

from echoscape.eval.estimator import PairFailed
from echoscape.eval.learned import LearnedOdometry, learned_odometry
from echoscape.learn.augment import PlaneMotion
from echoscape.learn.inference import Estimator, PairEstimate
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

    def estimate(self, source: float, destination: float) -> PairEstimate:
        # By docs/conventions.md the source is the later scan: driving on from 10 to 12 is +2.
        return PairEstimate(
            motion=PlaneMotion(x_m=source - destination, y_m=0.5, yaw_rad=0.1),
            source_m=np.full((3, 2), source, np.float32),
            destination_m=np.full((3, 2), destination, np.float32),
            weights=np.ones(3, np.float32),
            certain=self.certain,
        )


def odometry(**words: bool) -> Any:
    return LearnedOdometry(cast(Estimator, Recorded(**words)), range_offset_m=-0.3)


def test_later_scan_is_the_source() -> None:
    found = odometry().motion(10.0, 12.0)
    assert (found.x_m, found.y_m, found.yaw_rad) == (2.0, 0.5, 0.1)
    assert (found.matches.later_m == 12).all()
    assert (found.matches.earlier_m == 10).all()


def test_uncertain_rotation_is_a_failure() -> None:
    with pytest.raises(PairFailed, match="the matches leave the rotation open"):
        odometry(certain=False).motion(10.0, 12.0)


def test_scan_goes_in_with_its_bins_and_offset() -> None:
    scan = scan_of(landmarks(count=5), (0.0, 0.0, 0.0))
    assert odometry().features(scan) == (float(scan.codes.max()), scan.bin_m, -0.3)


def test_what_is_no_weights_is_told(tmp_path: Path) -> None:
    (tmp_path / "w.safetensors").write_bytes(b"nothing")
    with pytest.raises(DatasetError, match=r"w\.safetensors"):
        learned_odometry(tmp_path / "w.safetensors")
