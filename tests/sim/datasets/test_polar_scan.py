"""Scans compare as a whole, truth and beat signal included."""

from dataclasses import replace
from typing import Any

import numpy as np
import pytest

from echoscape.sim.datasets.beat_signal import BeatSignal
from echoscape.sim.datasets.polar_scan import PolarScan, ScanTruth
from tests.sim.scans import drawn_scan


def whole_scan(seed: int = 1) -> PolarScan:
    """A scan in which every field is set."""
    rng = np.random.default_rng(seed)
    beat = BeatSignal(
        samples=rng.integers(-9, 9, (400, 6), np.int16), scale=rng.uniform(1, 2, 400).astype(np.float32)
    )
    return replace(drawn_scan(seed=seed), beat=beat, rising=rng.random(400) < 0.5)


def truth_of(scan: PolarScan) -> ScanTruth:
    assert scan.truth is not None
    return scan.truth


def test_scans_with_equal_arrays_are_equal() -> None:
    first, second = whole_scan(), whole_scan()
    assert first is not second
    assert first.codes is not second.codes
    assert (first == second) is True
    assert (first != second) is False


CHANGES: dict[str, dict[str, Any]] = {
    "codes": {"codes": drawn_scan(seed=2).codes},
    "another shape": {"codes": drawn_scan().codes[:, :-1]},
    "timestamp_us": {"timestamp_us": drawn_scan().timestamp_us + 1},
    "encoder": {"encoder": drawn_scan().encoder + np.uint16(1)},
    "valid": {"valid": ~drawn_scan().valid},
    "bin_m": {"bin_m": 0.0438},
    "no truth": {"truth": None},
    "no rising": {"rising": None},
    "no beat": {"beat": None},
    "encoder_per_turn": {"encoder_per_turn": 5601},
}


@pytest.mark.parametrize("name", CHANGES)
def test_a_change_of_any_field_makes_scans_differ(name: str) -> None:
    changed = replace(whole_scan(), **CHANGES[name])
    assert (changed == whole_scan()) is False
    assert (whole_scan() == changed) is False


@pytest.mark.parametrize(
    "other", [np.zeros(3), np.zeros((400, 3768)), np.float64(1.0), np.array(None), None, "scan"]
)
def test_a_scan_is_unequal_to_whatever_is_no_scan(other: Any) -> None:
    scan = whole_scan()
    assert (scan == other) is False
    assert (other == scan) is False
    assert (scan != other) is True


def test_a_change_within_truth_or_beat_makes_scans_differ() -> None:
    scan = whole_scan()
    truth = truth_of(scan)
    component = truth.cells.component.copy()
    component[3, 4] ^= 1
    cells = replace(truth.cells, component=component)
    boxes = replace(truth.boxes, yaw=truth.boxes.yaw + 1e-9)
    assert scan.beat is not None
    for changed in (
        replace(scan, truth=replace(truth, cells=cells)),
        replace(scan, truth=replace(truth, boxes=boxes)),
        replace(scan, truth=replace(truth, middle_us=truth.middle_us + 1)),
        replace(scan, beat=replace(scan.beat, scale=scan.beat.scale * 2)),
    ):
        assert changed != scan


def test_values_that_are_not_numbers_are_equal_to_themselves() -> None:
    truth = replace(truth_of(whole_scan()), middle_pose=np.array([np.nan, 0.0, 0.0, 1.0]))
    assert truth == replace(truth, middle_pose=truth.middle_pose.copy())
    assert truth != replace(truth, middle_pose=np.array([np.nan, 1.0, 0.0, 1.0]))


def test_other_types_are_not_equal_and_decide_for_themselves() -> None:
    class Anything:
        def __eq__(self, other: object) -> bool:
            return True

        __hash__ = None  # pyright: ignore[reportAssignmentType]

    scan = whole_scan()
    assert (scan == scan.codes.tolist()) is False
    assert scan != None  # noqa: E711
    assert scan.__eq__(3) is NotImplemented
    assert scan == Anything()


def test_scans_have_no_hash() -> None:
    for record in (whole_scan(), truth_of(whole_scan()), truth_of(whole_scan()).cells):
        with pytest.raises(TypeError, match="unhashable"):
            hash(record)
