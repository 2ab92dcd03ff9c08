import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from numpy.testing import assert_allclose, assert_array_equal

from echoscape.eval.detections.interface import Detections
from echoscape.eval.detections.precision_recall import LEVELS
from echoscape.eval.detections.tally import Tally, tally_scan
from echoscape.eval.detections.targets import LABELS, JudgeSettings, ScanTargets
from echoscape.sim.datasets.polar_scan import Component
from echoscape.sim.sensor.cts350x import CTS350X
from tests.eval.detections.made_scans import at, made_scan, made_truth, scored

SHAPE = (24, 300)
JUDGE = JudgeSettings(near_m=0.0, min_snr_db=-40.0, tolerance_m=0.3)
SIZE = {"bands": 3, "classes": 9}


def targets_of(seed: int) -> ScanTargets:
    rng = np.random.default_rng(seed)
    component = np.where(rng.random(SHAPE) < 0.01, int(Component.DIRECT), int(Component.NOISE))
    direct = component == Component.DIRECT
    truth = made_truth(
        component,
        instance=(direct * rng.integers(1, 6, SHAPE)).astype(np.uint32),
        class_id=(direct * 6).astype(np.uint8),
    )
    return ScanTargets(made_scan(np.full(SHAPE, 40)), truth, CTS350X, JUDGE)


def drawn(seed: int, count: int = 200) -> Detections:
    rng = np.random.default_rng(seed)
    return at(rng.integers(0, SHAPE[0], count), rng.integers(0, SHAPE[1], count), rng.random(count))


def one(seed: int) -> Tally:
    return tally_scan(targets_of(seed), scored(drawn(seed)), (0.0, 1.0), **SIZE)


@given(seed=st.integers(0, 2**32 - 1))
@settings(max_examples=15, deadline=None)
def test_the_target_cells_themselves_have_average_precision_1_and_no_false_alarm(seed: int) -> None:
    targets = targets_of(seed)
    azimuth, bins = np.nonzero(targets.labels == Component.DIRECT)
    perfect = at(azimuth, bins, np.random.default_rng(seed).random(len(bins)))
    found = tally_scan(targets, scored(perfect), (0.0, 1.0), **SIZE)
    assert found.curve.average_precision == pytest.approx(1.0)
    assert found.false.sum() == 0
    assert found.true.sum() == len(bins)
    assert_array_equal(found.found_by, found.echoes_by)
    assert_array_equal(found.objects_found_by, found.objects_by)
    assert found.objects_by[6] == 5


def test_a_detector_that_finds_nothing_has_recall_0() -> None:
    found = tally_scan(targets_of(1), scored(at([], [], [])), (0.0, 1.0), **SIZE)
    assert found.curve.average_precision == 0
    assert found.curve.recall.max() == 0
    assert found.echoes > 0
    assert np.isnan(found.curve.precision).all()


def test_random_scores_of_all_cells_have_the_base_rate_as_average_precision() -> None:
    targets = targets_of(4)
    azimuth, bins = np.divmod(np.arange(SHAPE[0] * SHAPE[1]), SHAPE[1])
    cells = at(azimuth, bins, np.random.default_rng(2).random(len(bins)))
    found = tally_scan(targets, scored(cells), (0.0, 1.0), **SIZE)
    assert found.base_rate == pytest.approx(targets.near_target.mean())
    assert found.map_curve.average_precision == pytest.approx(found.base_rate, abs=0.03)
    assert found.ranking.average_precision == pytest.approx(found.base_rate, abs=0.03)


def test_every_judged_detection_has_one_label_and_one_level() -> None:
    found = one(3)
    assert found.labels.shape == (len(LABELS), LEVELS)
    assert found.labels.sum() == len(drawn(3)) == found.map_all.sum()
    assert_array_equal(found.true + found.false, found.labels.sum(axis=0))
    assert found.found.sum() == found.found_by.sum() <= found.echoes_by.sum() == found.echoes


def test_echoes_are_counted_in_the_band_of_their_strongest_cell() -> None:
    component, codes = np.zeros(SHAPE, int), np.zeros(SHAPE, int)
    component[2, 95:110], codes[2, 103] = Component.DIRECT, 50
    targets = ScanTargets(made_scan(codes), made_truth(component), CTS350X, JUDGE)
    found = tally_scan(targets, scored(at([2], [95], [0.5])), (0.0, 1.0), **SIZE)
    assert found.echoes_by[:, 6].tolist() == [0, 1, 0]  # at 10.35 m
    assert found.found_by[:, 6].tolist() == [0, 1, 0]


def test_blocks_hold_the_sums_of_their_scans() -> None:
    blocks, scans = Tally.empty(2, **SIZE), [one(seed) for seed in range(4)]
    for place, scan in enumerate(scans):
        blocks.add(place * 2 // 4, scan)
    assert blocks.scans.tolist() == [2, 2]
    assert_array_equal(blocks.labels[0], scans[0].labels + scans[1].labels)
    assert_array_equal(blocks.total.found, sum(scan.found for scan in scans))
    twice = blocks.weighted(np.array([[2, 0], [1, 1]]))
    assert_allclose(twice.echoes, [2 * (scans[0].echoes + scans[1].echoes), blocks.total.echoes])
    assert_allclose(twice.curve.average_precision[1], blocks.total.curve.average_precision)
