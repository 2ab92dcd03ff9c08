import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from echoscape.eval.detections.precision_recall import LEVELS, levels_of, precision_recall


def counted(level: list[int], kept: list[bool]) -> np.ndarray:
    return np.bincount(np.array(level, int)[np.array(kept, bool)], minlength=LEVELS)


def curve_of(level: list[int], true: list[bool], targets: int):
    hits = counted(level, true)
    return precision_recall(hits, counted(level, [not each for each in true]), hits, targets)


def test_average_precision_of_an_example_by_hand() -> None:
    # By falling score: true, false, true, false; recall 1/2 with precision 1, then 1 with precision 2/3.
    curve = curve_of([90, 80, 70, 60], [True, False, True, False], 2)
    assert curve.average_precision == pytest.approx(0.5 * 1 + 0.5 * 2 / 3)
    assert (curve.precision[0], curve.recall[0]) == (0.5, 1.0)
    assert curve.f1.max() == pytest.approx(2 * (2 / 3) / (1 + 2 / 3))


def test_equal_scores_are_taken_at_once() -> None:
    # One true of two with the same score, whatever their order: precision 1/2 at recall 1.
    for true in ([True, False], [False, True]):
        assert curve_of([5, 5], true, 1).average_precision == pytest.approx(0.5)


def test_targets_that_are_never_found_count() -> None:
    assert curve_of([9, 8], [True, True], 4).average_precision == pytest.approx(0.5)
    assert np.isnan(curve_of([], [], 0).average_precision)


@given(ranks=st.lists(st.integers(0, LEVELS - 1), min_size=1, max_size=60), cut=st.integers(0, LEVELS - 1))
def test_a_perfect_order_has_average_precision_1(ranks: list[int], cut: int) -> None:
    true = [rank >= cut for rank in ranks]
    expected = 1.0 if any(true) else np.nan
    found = curve_of(ranks, true, sum(true)).average_precision
    np.testing.assert_allclose(found, expected)


def test_random_scores_have_the_base_rate_as_average_precision() -> None:
    rng = np.random.default_rng(3)
    level, true = rng.integers(0, LEVELS, 200_000), rng.random(200_000) < 0.16
    found = curve_of(level.tolist(), true.tolist(), int(true.sum())).average_precision
    assert found == pytest.approx(0.16, abs=0.005)


@given(
    data=st.lists(st.tuples(st.integers(0, 9), st.booleans()), min_size=1, max_size=40),
    missed=st.integers(0, 5),
)
def test_average_precision_is_the_sum_over_thresholds(data: list[tuple[int, bool]], missed: int) -> None:
    level, true = [each[0] for each in data], [each[1] for each in data]
    targets = sum(true) + missed
    if not targets:
        return
    area, before = 0.0, 0.0
    for threshold in sorted(set(level), reverse=True):
        kept = [hit for score, hit in data if score >= threshold]
        recall = sum(kept) / targets
        area += (recall - before) * sum(kept) / len(kept)
        before = recall
    assert curve_of(level, true, targets).average_precision == pytest.approx(area)


def test_several_sums_at_once_are_computed_each_by_itself() -> None:
    rng = np.random.default_rng(1)
    true, false, found = rng.integers(0, 9, (3, 4, LEVELS))
    targets = found.sum(axis=1) + 5
    many = precision_recall(true, false, found, targets).average_precision
    each = [
        precision_recall(*part).average_precision for part in zip(true, false, found, targets, strict=True)
    ]
    np.testing.assert_allclose(many, each)


def test_scores_beyond_the_limits_have_the_end_levels() -> None:
    levels = levels_of(np.array([-5.0, 0.0, 0.499, 0.5, 1.0, 7.0]), (0.0, 1.0))
    assert levels.tolist() == [0, 0, LEVELS // 2 - 1, LEVELS // 2, LEVELS - 1, LEVELS - 1]


@given(code=st.integers(0, 255))
def test_every_code_has_a_level_of_its_own(code: int) -> None:
    assert levels_of(np.array(code), (0.0, 256.0)) == code
