from itertools import product

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from numpy.testing import assert_array_equal
from numpy.typing import NDArray

from echoscape.eval.detections.targets import (
    LABELS,
    OUTSIDE,
    TARGET,
    JudgeSettings,
    ScanTargets,
)
from echoscape.sim.datasets.polar_scan import Component
from echoscape.sim.sensor.cts350x import CTS350X
from tests.eval.detections.made_scans import at, made_scan, made_truth, within

AZIMUTHS, BINS = 24, 60
EVERYWHERE = JudgeSettings(near_m=0.0, min_snr_db=-40.0, tolerance_m=0.3)


def targets_of(
    component: NDArray, codes: NDArray | None = None, judge: JudgeSettings = EVERYWHERE, **cells: NDArray
) -> ScanTargets:
    codes = np.full(component.shape, 40) if codes is None else codes
    return ScanTargets(made_scan(codes), made_truth(component, **cells), CTS350X, judge)


def one_target(azimuth: int = 10, bins: int = 30) -> NDArray:
    component = np.zeros((AZIMUTHS, BINS), int)
    component[azimuth, bins] = Component.DIRECT
    return component


def sparse(seed: int) -> NDArray:
    """Components of a scan with a few direct cells and ghosts."""
    rng = np.random.default_rng(seed)
    share = np.repeat(rng.random((AZIMUTHS, BINS // 3)), 3, axis=1)  # runs of three cells or more
    component = np.where(
        share < 0.01, Component.DIRECT, np.where(share < 0.03, Component.GHOST, Component.NOISE)
    )
    component[3, 30:33] = Component.DIRECT
    return component


@given(seed=st.integers(0, 2**32 - 1), tolerance=st.sampled_from([0.0, 0.1, 0.35, 0.8]))
@settings(max_examples=25, deadline=None)
def test_true_detections_and_found_echoes_are_those_of_the_definition(seed: int, tolerance: float) -> None:
    rng, component = np.random.default_rng(seed), sparse(seed)
    instance = (component == Component.DIRECT) * rng.integers(1, 3, component.shape)
    judge = JudgeSettings(near_m=0.0, min_snr_db=-40.0, tolerance_m=tolerance)
    targets = targets_of(component, judge=judge, instance=instance.astype(np.uint32))
    places = rng.integers(0, AZIMUTHS, 12), rng.integers(0, BINS, 12)
    level = rng.integers(0, 256, 12)
    found = at(*places, level)
    cells = list(zip(*np.nonzero(component == Component.DIRECT), strict=True))

    def match(cell: tuple, place: tuple) -> bool:
        return within(cell, place, azimuths=AZIMUTHS, tolerance_m=tolerance)

    spots = list(zip(*places, strict=True))
    true = [any(match(cell, place) for cell in cells) for place in spots]
    assert_array_equal(targets.label(found) == TARGET, true)
    best = []
    for first, last in zip(targets.echoes.first, targets.echoes.last, strict=True):
        run = [divmod(int(flat), BINS) for flat in range(first, last + 1)]
        hits = [score for place, score in zip(spots, level, strict=True) if any(match(c, place) for c in run)]
        best.append(max(hits, default=-1))
    assert_array_equal(targets.best_levels(found, level), best)


@given(seed=st.integers(0, 2**32 - 1))
@settings(max_examples=25, deadline=None)
def test_a_false_detection_has_the_label_of_the_strongest_cell_within_the_tolerance(seed: int) -> None:
    rng = np.random.default_rng(seed)
    component = rng.choice([Component.LEAKAGE, Component.SIDELOBE, Component.SPOKE], (AZIMUTHS, BINS))
    component[sparse(seed) == Component.DIRECT] = Component.DIRECT
    codes = rng.permutation(AZIMUTHS * BINS).reshape(AZIMUTHS, BINS) % 251  # hardly any two alike
    targets = targets_of(component, codes)
    azimuth, bins = int(rng.integers(AZIMUTHS)), int(rng.integers(BINS) // rng.integers(1, 9))  # more near by
    label = int(targets.label(at([azimuth], [bins], [1.0]))[0])
    near = [
        cell
        for cell in product(range(AZIMUTHS), range(BINS))
        if within(cell, (azimuth, bins), azimuths=AZIMUTHS, tolerance_m=0.3)
    ]
    if any(component[cell] == Component.DIRECT for cell in near):
        assert label == TARGET
    else:
        highest = max(codes[cell] for cell in near)
        assert label in {component[cell] for cell in near if codes[cell] == highest}


@given(seed=st.integers(0, 2**32 - 1))
@settings(max_examples=20, deadline=None)
def test_the_target_cells_themselves_are_all_true_and_find_every_echo(seed: int) -> None:
    targets = targets_of(sparse(seed))
    azimuth, bins = np.nonzero(sparse(seed) == Component.DIRECT)
    found = at(azimuth, bins, np.ones(len(bins)))
    assert (targets.label(found) == TARGET).all()
    assert (targets.best_levels(found, np.full(len(bins), 7)) == 7).all()
    assert len(targets.echoes) > 0


@pytest.mark.parametrize(("azimuths", "bins"), [(0, 4), (0, -4), (2, 0), (-2, 0)])
def test_shifted_by_more_than_the_tolerance_nothing_is_found(azimuths: int, bins: int) -> None:
    # 0.3 m are three bins; at 3 m an azimuth of 24 is 0.8 m wide, so that one azimuth is allowed.
    targets = targets_of(one_target())
    found = at([10 + azimuths], [30 + bins], [1.0])
    assert targets.label(found).tolist() == [Component.NOISE]
    assert targets.best_levels(found, np.array([9])).tolist() == [-1]
    nearer = at([10 + azimuths - np.sign(azimuths)], [30 + bins - np.sign(bins)], [1.0])
    assert targets.label(nearer).tolist() == [TARGET]
    assert targets.best_levels(nearer, np.array([9])).tolist() == [9]


def test_near_the_radar_more_azimuths_are_within_the_tolerance() -> None:
    # At 0.25 m an azimuth of 24 is 0.065 m wide: 0.3 m are 4 of them.
    targets = targets_of(one_target(10, 2))
    assert targets.label(at([14, 6, 15, 5], [2] * 4, [1.0] * 4)).tolist() == [TARGET, TARGET, 0, 0]


def test_the_last_azimuth_is_beside_the_first() -> None:
    targets = targets_of(one_target(0, 30))
    assert targets.label(at([AZIMUTHS - 1], [30], [1.0])).tolist() == [TARGET]


def test_movers_are_targets_only_where_asked_for() -> None:
    component = one_target()
    moving = component > 0
    found = at([10], [30], [1.0])
    assert LABELS[targets_of(component, moving=moving).label(found)[0]] == "mover"
    assert len(targets_of(component, moving=moving).echoes) == 0
    judge = JudgeSettings(targets="direct", near_m=0.0, min_snr_db=-40.0)
    targets = targets_of(component, judge=judge, moving=moving)
    assert targets.label(found).tolist() == [TARGET]
    assert len(targets.echoes) == 1


def test_ghosts_in_place_have_a_label_of_their_own() -> None:
    component = np.full((AZIMUTHS, BINS), int(Component.GHOST))
    displaced = np.arange(AZIMUTHS)[:, None] < np.full((1, BINS), 12)
    labels = targets_of(component, displaced=displaced).label(at([5, 17], [40, 40], [1.0, 1.0]))
    assert [LABELS[label] for label in labels] == ["ghost", "multipath in place"]


def test_what_lies_outside_the_judged_ranges_counts_as_nothing() -> None:
    component = np.full((AZIMUTHS, BINS), int(Component.DIRECT))
    judge = JudgeSettings(near_m=2.0, far_m=4.0, min_snr_db=-40.0, tolerance_m=0.3)
    targets = targets_of(component, judge=judge)
    found = at([0] * 4, [19, 20, 39, 40], [1.0] * 4)
    assert targets.label(found).tolist() == [OUTSIDE, TARGET, TARGET, OUTSIDE]
    assert_array_equal(targets.echoes.first % BINS, np.full(AZIMUTHS, 20))
    assert_array_equal(targets.echoes.last % BINS, np.full(AZIMUTHS, 39))
    outside = at([0], [19], [1.0])
    assert (targets.best_levels(outside, np.array([5])) == -1).all()


def test_an_echo_is_a_run_of_one_object_and_counts_from_a_level_on() -> None:
    component, codes = np.zeros((AZIMUTHS, BINS), int), np.zeros((AZIMUTHS, BINS), int)
    instance = np.zeros((AZIMUTHS, BINS), np.uint32)
    component[3, 30:40] = Component.DIRECT
    instance[3, 30:34], instance[3, 34:40] = 1, 2
    component[5, 50], instance[5, 50] = Component.DIRECT, 3
    codes[3, 32], codes[3, 38], codes[5, 50] = 80, 60, 30
    # The sensor's noise has a mean of 1.57, 3.4 dB less near by: within 1.5 dB of 0 dB.
    for least_db, kept in ((10.0, [32, 38, 50]), (20.0, [32, 38]), (35.0, [32]), (45.0, [])):
        judge = JudgeSettings(near_m=0.0, min_snr_db=least_db)
        echoes = targets_of(component, codes, judge, instance=instance).echoes
        assert echoes.peak.tolist() == kept
        assert echoes.instance.tolist() == [1, 2, 3][: len(kept)]
        assert (echoes.last - echoes.first + 1).tolist() == [4, 6, 1][: len(kept)]


def test_the_level_of_an_echo_is_that_above_the_noise_at_its_range() -> None:
    # Noise of the CTS350-X: 1.57, and at 3.05 m the receiver's gain is 3.38 dB less than 1 (from -3 dB at
    # 0 m to -3.5 dB at 4 m). A code of 40 is 20 dB.
    level_db = 20 - (10 * np.log10(1.57) - 3.38)
    for least_db, kept in ((level_db - 0.1, 1), (level_db + 0.1, 0)):
        judge = JudgeSettings(near_m=0.0, min_snr_db=least_db)
        assert len(targets_of(one_target(), judge=judge).echoes) == kept


def test_a_run_ends_at_the_end_of_its_azimuth() -> None:
    component = np.zeros((AZIMUTHS, BINS), int)
    component[3, BINS - 2 :], component[4, :2] = Component.DIRECT, Component.DIRECT
    echoes = targets_of(component).echoes
    assert_array_equal(echoes.first, [4 * BINS - 2, 4 * BINS])
    assert_array_equal(echoes.last, [4 * BINS - 1, 4 * BINS + 1])


@pytest.mark.parametrize(
    ("given", "message"),
    [
        ({"targets": "moving"}, "targets must be static or direct, got 'moving'"),
        ({"tolerance_m": -0.1}, "tolerance_m must be finite and 0 or more, got -0.1"),
        ({"near_m": np.nan}, "near_m must be finite and 0 or more, got nan"),
        ({"min_snr_db": np.inf}, "min_snr_db must be finite, got inf"),
        ({"far_m": 2.0}, r"far_m must be finite and above near_m \(3\), got 2.0"),
    ],
)
def test_refuses_settings_that_judge_nothing(given: dict, message: str) -> None:
    with pytest.raises(ValueError, match=message):
        JudgeSettings(**given)


def test_refuses_ranges_beyond_the_scan_and_azimuths_that_do_not_exist() -> None:
    with pytest.raises(ValueError, match=r"near_m must be below the last bin, 6 m, got 50"):
        targets_of(one_target(), judge=JudgeSettings(near_m=50.0))
    with pytest.raises(ValueError, match=r"azimuths of detections must be between 0 and 23"):
        targets_of(one_target()).label(at([24], [30], [1.0]))
    with pytest.raises(ValueError, match="truth has the shape"):
        ScanTargets(made_scan(np.zeros((4, 9))), made_truth(one_target()), CTS350X, EVERYWHERE)
