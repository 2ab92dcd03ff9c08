"""The weights in the package: their record, and the motions found with them."""

import math
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from echoscape.eval.odometry.learned import learned_odometry
from echoscape.eval.odometry.metrics import pair_errors
from echoscape.eval.odometry.run import run_odometry
from echoscape.learn.model.weights import load_weights, shipped_weights
from echoscape.sim.datasets.polar_scan import PolarScan
from echoscape.sim.datasets.scan_folder import open_folder
from tests.eval.drives import landmarks, scan_of
from tests.paths import SHARED

REAL_PAIR = SHARED / "real" / "oxford-pair"
SHIPPED = list(shipped_weights().items())


def test_both_resolutions_of_the_paper_came_along() -> None:
    assert list(shipped_weights()) == [0.6912, 0.3456]


@pytest.mark.parametrize(("pixel_m", "path"), SHIPPED)
def test_weights_are_small_and_tell_how_they_were_made(pixel_m: float, path: Path) -> None:
    model, record = load_weights(path)
    assert model.settings.image.pixel_m == pixel_m
    assert path.stat().st_size < 4_000_000
    seen = set()
    while record is not None:
        assert {"seed", "step", "learning_rate", "likelihood_weight", "validation_loss_m"} <= record.keys()
        seen |= set(record["data"])
        record = record["start"]
    assert len(seen) >= 24
    assert all(name.startswith("train_") for name in seen)


@pytest.mark.skipif(not REAL_PAIR.is_dir(), reason="no ../shared/real/oxford-pair beside the checkout")
@pytest.mark.parametrize("pixel_m", [0.6912, 0.3456])
def test_a_real_pair_is_found_within_15_cm_and_a_third_of_a_degree(pixel_m: float) -> None:
    folder = open_folder(REAL_PAIR)
    weights = shipped_weights()[pixel_m]
    beta_s = -float(folder.sensor.doppler_shift_s.mean())
    odometry = learned_odometry(weights, range_offset_m=folder.range_offset_m, doppler_beta_s=beta_s)
    found = run_odometry(folder, odometry)
    (off_m, off_rad), *_ = pair_errors(found)
    assert off_m <= 0.15
    assert math.degrees(off_rad) <= 0.3


@pytest.mark.parametrize(("pixel_m", "path"), SHIPPED)
def test_a_scan_turned_by_whole_rows_is_found_at_its_heading(pixel_m: float, path: Path) -> None:
    scan = _scan()
    matcher = learned_odometry(path).matcher
    source = matcher.features(replace(scan, codes=np.roll(scan.codes, 7, axis=0)))
    found = matcher.estimate(source, matcher.features(scan)).motion
    # What was ahead is 7 azimuths to the right: the car has turned left by as much.
    assert found.yaw_rad == pytest.approx(-7 * 2 * math.pi / len(scan.codes), abs=math.radians(0.3))
    assert math.hypot(found.x_m, found.y_m) < 0.1


def _scan() -> PolarScan:
    """Return a scan of a drawn yard: bright spots of a beam's width over a noisy floor."""
    scan = scan_of(landmarks(count=150), (0.0, 0.0, 0.0))
    floor = np.random.default_rng(1).normal(11, 4, scan.codes.shape).clip(0, 40).astype(np.uint8)
    return replace(scan, codes=np.maximum(scan.codes, floor))
