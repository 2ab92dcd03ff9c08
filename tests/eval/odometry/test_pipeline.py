"""Odometry without a folder gives the motions that the command gives for a folder."""

import numpy as np
import pytest

from echoscape.eval.odometry.pipeline import Odometry
from echoscape.sim.datasets.polar_scan import PolarScan
from echoscape.sim.generation.config import SimulationConfig
from echoscape.sim.generation.single_scan import build_simulator


@pytest.fixture(scope="module")
def scans() -> list[PolarScan]:
    simulator = build_simulator(SimulationConfig(preset="industrial", seed=7, scans=24))
    return [simulator.scan(index) for index in (20, 21, 22)]


def test_motions_are_near_the_true_ones(scans: list[PolarScan]) -> None:
    motions = list(Odometry().run(scans))
    assert len(motions) == 2
    for before, after, motion in zip(scans, scans[1:], motions, strict=False):
        assert before.truth is not None
        assert after.truth is not None
        moved = np.linalg.norm(after.truth.middle_pose[:2] - before.truth.middle_pose[:2])
        assert np.hypot(motion.x_m, motion.y_m) == pytest.approx(moved, abs=0.3)


def test_run_is_start_and_follow(scans: list[PolarScan]) -> None:
    odometry = Odometry(solver="paper")
    state = odometry.start(scans[0])
    expected = []
    for scan in scans[1:]:
        motion, state = odometry.follow(state, scan)
        expected.append((motion.x_m, motion.y_m, motion.yaw_rad))
    assert [(each.x_m, each.y_m, each.yaw_rad) for each in Odometry(solver="paper").run(scans)] == expected


def test_no_scan_gives_no_motion() -> None:
    assert list(Odometry().run([])) == []
