import numpy as np
import pytest

from echoscape.eval.detections.interface import Detections
from echoscape.eval.detections.merit import best_threshold, mean_scores
from echoscape.eval.detections.precision_recall import LEVELS
from echoscape.eval.detections.run import JudgedMethod
from echoscape.eval.detections.tally import Tally, tally_scan
from echoscape.eval.detections.targets import LABELS, OUTSIDE, TARGET, JudgeSettings, ScanTargets
from echoscape.sim.datasets.polar_scan import Component
from echoscape.sim.sensor.cts350x import CTS350X
from tests.eval.detections.made_scans import at, made_scan, made_truth, scored

SHAPE = (60, 500)
SIZE = {"bands": 6, "classes": 9}
LIMITS = (-10.0, 30.0)
LEVEL = (LIMITS[1] - LIMITS[0]) / LEVELS


def targets() -> ScanTargets:
    share = np.random.default_rng(2).random(SHAPE)
    component = np.where(share < 0.02, int(Component.DIRECT), int(Component.NOISE))
    judge = JudgeSettings(near_m=0.0, min_snr_db=-40.0, tolerance_m=0.1)
    return ScanTargets(made_scan(np.full(SHAPE, 40)), made_truth(component), CTS350X, judge)


def drawn(truth: ScanTargets) -> Detections:
    """Detections all over the scan, of higher scores at targets."""
    rng = np.random.default_rng(5)
    azimuth, bins = rng.integers(0, SHAPE[0], 9000), rng.integers(0, SHAPE[1], 9000)
    return at(azimuth, bins, rng.uniform(0, 12, 9000) + 9 * truth.near_target[azimuth, bins])


def judged(truth: ScanTargets, found: Detections) -> JudgedMethod:
    blocks = Tally.empty(1, **SIZE)
    blocks.add(0, tally_scan(truth, scored(found), LIMITS, **SIZE))
    return JudgedMethod(
        name="made",
        score_name="none",
        score_limits=LIMITS,
        record={},
        blocks=blocks,
        shown=found,
        shown_labels=np.zeros(len(found), np.uint8),
    )


def test_mean_scores_are_those_of_the_detections() -> None:
    truth = targets()
    found = drawn(truth)
    labels = truth.label(found)
    assert (labels != OUTSIDE).all()
    means = mean_scores(judged(truth, found))
    for name in ("direct", "noise"):
        # Scores are uniform within a level of 0.16: those of hundreds of detections differ by 0.002 at most.
        assert means[name] == pytest.approx(found.score[labels == LABELS.index(name)].mean(), abs=LEVEL / 10)
    assert means["ghost"] is None


def test_the_best_threshold_gives_its_precision_and_recall_and_no_other_gives_more() -> None:
    truth = targets()
    found = drawn(truth)
    best = best_threshold(judged(truth, found))
    assert best["threshold"] is not None
    assert 9 - LEVEL < best["threshold"] < 12 + LEVEL

    def at_least(threshold: float) -> tuple[float, float, float]:
        kept = found.score >= threshold
        part = Detections(azimuth=found.azimuth[kept], range_m=found.range_m[kept], score=found.score[kept])
        precision = float((truth.label(part) == TARGET).mean())
        hit = truth.best_levels(part, np.zeros(len(part), np.int64)) >= 0
        recall = float(hit.mean())
        return precision, recall, 2 * precision * recall / (precision + recall)

    assert (best["precision"], best["recall"], best["f1"]) == pytest.approx(at_least(best["threshold"]))
    others = [at_least(LIMITS[0] + level * LEVEL)[2] for level in range(64, 192)]
    assert best["f1"] == pytest.approx(max(others))


def test_where_nothing_is_found_no_threshold_is_best() -> None:
    assert set(best_threshold(judged(targets(), at([], [], []))).values()) == {None}
