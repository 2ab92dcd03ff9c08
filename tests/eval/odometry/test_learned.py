"""The learned odometry as an estimator: which scan is the source, whose points are whose, what fails."""

from pathlib import Path
from typing import cast, get_args

import numpy as np
import pytest
import torch
from numpy.testing import assert_allclose

from echoscape.eval.odometry.interface import PairFailed
from echoscape.eval.odometry.learned import LearnedOdometry, Solver, learned_odometry
from echoscape.learn.model.device import Device
from echoscape.learn.model.weights import chosen_weights, load_weights
from echoscape.learn.odometry.keyframe_odometry import ROBUST_PAIRS, KeyframeOdometry, OdometryConfig
from echoscape.learn.odometry.pair_estimate import PairEstimate
from echoscape.learn.odometry.paper_odometry import PaperOdometry
from echoscape.learn.odometry.scan_matcher import ScanMatcher
from echoscape.sim.datasets.files.atomic_write import DatasetError
from echoscape.sim.datasets.polar_scan import PolarScan
from echoscape.sim.datasets.se2 import SE2
from tests.eval.drives import landmarks, scan_of


def _time_s(scan: PolarScan) -> float:
    return float(scan.timestamp_us[0]) / 1e6


class Recorded:
    """An odometry whose state is the scan itself, and whose points give the times of both scans."""

    config = OdometryConfig()
    compensates = True

    def __init__(self, *, certain: bool = True) -> None:
        self.certain = certain

    def start(self, scan: PolarScan) -> PolarScan:
        return scan

    def follow(self, state: PolarScan, scan: PolarScan) -> tuple[PairEstimate, PolarScan]:
        found = PairEstimate(
            motion=SE2(x_m=2.0, y_m=0.5, yaw_rad=0.1),
            source_m=np.full((3, 2), _time_s(scan), np.float32),
            destination_m=np.full((3, 2), _time_s(state), np.float32),
            weights=np.ones(3, np.float32),
            certain=self.certain,
            agreement=3.0,
        )
        return found, scan


def odometry(**words: bool) -> LearnedOdometry:
    return LearnedOdometry(cast(KeyframeOdometry, Recorded(**words)))


SOLVERS: tuple[Solver, ...] = get_args(Solver)
START = scan_of(landmarks(count=5), (0.0, 0.0, 0.0))
LATER = scan_of(landmarks(count=5), (0.0, 0.0, 0.0), number=1)


def test_points_are_those_of_their_scans() -> None:
    state = odometry().start(START)
    found, _ = odometry().follow(state, LATER)
    assert (found.x_m, found.y_m, found.yaw_rad) == (2.0, 0.5, 0.1)
    assert found.matches is not None
    assert_allclose(found.matches.later_m, _time_s(LATER), rtol=1e-6)
    assert_allclose(found.matches.earlier_m, _time_s(START), rtol=1e-6)


def test_uncertain_rotation_is_a_failure() -> None:
    open_one = odometry(certain=False)
    with pytest.raises(PairFailed, match="the matches do not determine the rotation"):
        open_one.follow(open_one.start(START), LATER)


def test_the_range_offset_moves_the_image() -> None:
    """A range that is 10 pixels too short is undone by the offset, for every solver."""
    path = chosen_weights()
    pixel_m = load_weights(path)[0].settings.image.pixel_m
    for solver in SOLVERS:
        plain = learned_odometry(path, solver=solver).start(START)
        moved = learned_odometry(path, solver=solver, range_offset_m=10 * pixel_m).start(START)
        images = [
            each if isinstance(each, torch.Tensor) else torch.from_numpy(each.keyframe.features.cells)
            for each in (plain, moved)
        ]
        assert not torch.equal(*images)


def test_the_name_gives_the_solver() -> None:
    matcher = cast(ScanMatcher, None)
    names = [
        LearnedOdometry(KeyframeOdometry(matcher, config, doppler_beta_s=beta_s)).name
        for config, beta_s in ((None, 0.05), (ROBUST_PAIRS, 0.05), (None, None))
    ]
    assert names == ["learned", "learned, robust", "learned, not compensated"]
    assert learned_odometry(chosen_weights(), solver="paper", doppler_beta_s=0.05).name == "learned, paper"


def test_solvers_are_built_as_asked() -> None:
    built = {solver: learned_odometry(chosen_weights(), solver=solver).odometry for solver in SOLVERS}
    assert isinstance(built["paper"], PaperOdometry)
    assert isinstance(built["robust"], KeyframeOdometry)
    assert built["robust"].config == ROBUST_PAIRS
    assert isinstance(built["keyframe"], KeyframeOdometry)
    assert built["keyframe"].config == OdometryConfig()
    with pytest.raises(ValueError, match="solver must be robust or keyframe"):
        _ = learned_odometry(chosen_weights(), solver="paper").matcher


@pytest.mark.parametrize("device", ["cpu", pytest.param("cuda", marks=pytest.mark.gpu)])
@pytest.mark.parametrize("solver", SOLVERS)
def test_a_drive_is_followed_on_any_device(solver: Solver, device: Device) -> None:
    """Landmarks seen from 1.5 m farther on: every solver finds the motion within a fifth of a pixel."""
    if device == "cuda" and not torch.cuda.is_available():
        pytest.skip("needs a CUDA device")
    odometry = learned_odometry(chosen_weights(), solver=solver, device=device)
    scans = [scan_of(landmarks(count=150), (1.5 * number, 0.0, 0.0), number=number) for number in range(3)]
    state = odometry.start(scans[0])
    for scan in scans[1:]:
        motion, state = odometry.follow(state, scan)
        assert motion.x_m == pytest.approx(1.5, abs=0.2 * 0.6912)
        assert motion.y_m == pytest.approx(0.0, abs=0.2 * 0.6912)


def test_an_absent_device_is_refused() -> None:
    if torch.cuda.is_available():
        pytest.skip("needs a machine without a GPU")
    with pytest.raises(ValueError, match="got 'cuda'"):
        learned_odometry(chosen_weights(), device="cuda")


def test_what_is_no_weights_is_told(tmp_path: Path) -> None:
    (tmp_path / "w.safetensors").write_bytes(b"nothing")
    with pytest.raises(DatasetError, match=r"w\.safetensors"):
        learned_odometry(tmp_path / "w.safetensors")
