"""Drift: the published figures of two real trajectories, and what scale, turns and common motion do."""

import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from echoscape.eval.odometry.kitti_drift import (
    LENGTHS_M,
    concatenated,
    kitti_drift,
    mean_drift,
    segment_errors,
)
from echoscape.eval.odometry.trajectory_io import matrices, read_kitti
from echoscape.sim.datasets.se2 import chain, compose
from tests.paths import SHARED

KITTI = SHARED / "kitti"


def straight(metres: int) -> np.ndarray:
    """A drive straight on, a frame a metre: frames at 0, 1, ..., `metres`."""
    return chain(np.tile([1.0, 0.0, 0.0], (metres, 1)))


def winding(frames: int = 700, *, seed: int = 3) -> np.ndarray:
    """A drive of some 2 m a frame that turns now and then."""
    rng = np.random.default_rng(seed)
    yaw = np.deg2rad(3 * np.sin(np.arange(frames) / 20) + rng.normal(0, 0.3, frames))
    return chain(np.stack([rng.uniform(1.5, 2.5, frames), rng.normal(0, 0.02, frames), yaw], axis=1))


@pytest.mark.parametrize("name", ["01", "21"])
def test_published_figures_come_out_to_four_decimals(name: str) -> None:
    folder = KITTI / name
    if not folder.is_dir():
        pytest.skip("needs published trajectories in shared/kitti beside the checkout")
    lines = (folder / "expected.txt").read_text().splitlines()
    percent, degrees_per_100_m = (float(line.split(",")[1]) for line in lines if line.strip())
    found = kitti_drift(read_kitti(folder / "est.txt"), read_kitti(folder / "gt.txt"))
    assert found.translation_percent == pytest.approx(percent, abs=5e-5)
    assert found.rotation_deg_per_m is not None
    assert 100 * found.rotation_deg_per_m == pytest.approx(degrees_per_100_m, abs=5e-5)


def test_perfect_estimate_has_no_drift() -> None:
    found = kitti_drift(winding(), winding())
    assert found.segments > 100
    assert found.translation_percent == pytest.approx(0, abs=1e-9)
    # arccos turns one rounding of the trace, 4e-16, into 3e-8 rad.
    assert found.rotation_deg_per_m == pytest.approx(0, abs=math.degrees(5e-8) / 100)


def test_segment_ends_at_the_first_frame_beyond_its_length() -> None:
    # Frames stand at whole metres: the one at exactly 100 m does not exceed 100 m, the one at 101 m does.
    assert kitti_drift(straight(100), straight(100)).segments == 0
    assert kitti_drift(straight(101), straight(101)).segments == 1
    assert kitti_drift(straight(110), straight(110), step=10).segments == 1
    assert kitti_drift(straight(111), straight(111), step=10).segments == 2
    assert kitti_drift(straight(111), straight(111), step=1).segments == 11


def test_error_is_divided_by_the_nominal_length_and_all_segments_count_alike() -> None:
    # An estimate that stands still is wrong by the whole path: L + 1 metres over L.
    found = kitti_drift(np.zeros((202, 3)), straight(201), step=1000)
    assert [row[0] for row in found.by_length] == [100.0, 200.0]
    assert found.translation_percent == pytest.approx((101 + 201 / 2) / 2)
    # With every frame a start there are 101 segments of 100 m and 1 of 200 m.
    found = kitti_drift(np.zeros((202, 3)), straight(201), step=1)
    assert found.segments == 102
    assert found.translation_percent == pytest.approx((101 * 101 + 201 / 2) / 102)


def test_one_per_cent_of_scale_is_one_per_cent_of_drift() -> None:
    # Steps of 5 cm: a segment is at most 5 cm longer than its nominal 100 m.
    true = straight(2100) * [0.05, 1, 1]
    found = kitti_drift(true * [1.01, 1, 1], true)
    assert found.translation_percent == pytest.approx(1.0, rel=6e-4)
    assert found.rotation_deg_per_m == pytest.approx(0, abs=1e-8)


def test_constant_turning_is_that_much_rotation() -> None:
    per_m = math.radians(0.01)
    turning = chain(np.tile([1.0, 0.0, per_m], (900, 1)))
    found = kitti_drift(turning, straight(900), step=10)
    # A segment of nominally L metres has L + 1 steps.
    counts = [len(range(0, 900 - int(length), 10)) for length in LENGTHS_M]
    steps = [(length + 1) / length for length in LENGTHS_M]
    expected = np.average(steps, weights=counts)
    assert found.rotation_deg_per_m == pytest.approx(0.01 * expected, rel=1e-6)
    # A chord of an arc: the ends are apart by the vector from (101, 0) to the arc's end, for L = 100.
    angle = 101 * per_m
    x = sum(math.cos(i * per_m) for i in range(101))
    y = sum(math.sin(i * per_m) for i in range(101))
    assert angle < 0.1
    assert found.by_length[0][1] == pytest.approx(math.hypot(x - 101, y), rel=1e-6)


@settings(max_examples=25, deadline=None)
@given(
    moved=st.tuples(st.floats(-1e3, 1e3), st.floats(-1e3, 1e3), st.floats(-math.pi, math.pi)),
    seed=st.integers(0, 9),
)
def test_drift_does_not_depend_on_where_the_world_begins(moved: tuple[float, ...], seed: int) -> None:
    true, found = winding(150), winding(150, seed=seed)
    here = kitti_drift(found, true)
    there = kitti_drift(compose(np.array(moved), found), compose(np.array(moved), true))
    assert here.segments == there.segments > 0
    assert here.translation_percent == pytest.approx(there.translation_percent, abs=1e-7)
    assert here.rotation_deg_per_m == pytest.approx(there.rotation_deg_per_m, abs=1e-7)


def test_half_a_turn_of_error_is_half_a_turn() -> None:
    # The trace is -1 here, and rounding takes arccos' argument below -1 in places.
    flipped = straight(101).copy()
    flipped[101, 2] = math.pi
    found = segment_errors(flipped, straight(101))
    assert found.rotation == pytest.approx(math.pi / 100, rel=1e-6)


def test_short_trajectories_have_no_figures() -> None:
    found = kitti_drift(straight(50), straight(50))
    assert (found.translation_percent, found.rotation_deg_per_m, found.segments) == (None, None, 0)
    assert found.as_dict()["translation_percent"] is None
    assert kitti_drift(np.zeros((1, 3)), np.zeros((1, 3))).segments == 0


def test_stretches_count_together() -> None:
    first = segment_errors(np.zeros((202, 3)), straight(201))
    second = segment_errors(straight(150), straight(150))
    both = mean_drift(concatenated([first, second]))
    assert both.segments == len(first.length_m) + len(second.length_m)
    shares = np.append(first.translation, second.translation)
    assert both.translation_percent == pytest.approx(100 * shares.mean())
    assert mean_drift(concatenated([])).segments == 0


@pytest.mark.parametrize(
    ("estimate", "truth", "step", "message"),
    [
        (straight(10), straight(11), 10, "estimate must have as many poses as truth, 12, got 11"),
        (straight(10) * math.nan, straight(10), 10, "estimate must be finite; pose 0"),
        (straight(10), np.add(straight(10), [math.inf, 0, 0]), 10, "truth must be finite"),
        (straight(10), straight(10), 0, "step must be 1 or more, got 0"),
        (straight(10)[:, :2], straight(10), 10, r"estimate must be poses .* got shape \(11, 2\)"),
        (np.zeros((0, 3)), np.zeros((0, 3)), 10, "estimate must be poses"),
        (straight(10), matrices(straight(10))[:, :3], 10, r"truth must be poses .* got shape \(11, 3, 4\)"),
    ],
)
def test_bad_trajectories_are_refused(
    estimate: np.ndarray, truth: np.ndarray, step: int, message: str
) -> None:
    with pytest.raises(ValueError, match=message):
        kitti_drift(estimate, truth, step=step)
