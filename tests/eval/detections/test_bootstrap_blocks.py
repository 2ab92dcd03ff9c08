import numpy as np
from hypothesis import given
from hypothesis import strategies as st

from echoscape.eval.detections.bootstrap import BLOCK_M, block_numbers


@given(steps=st.lists(st.floats(0, 3 * BLOCK_M), max_size=60))
def test_blocks_are_successive_scans_and_none_but_an_only_one_is_short(steps: list[float]) -> None:
    way = np.cumsum([0.0, *steps])
    found = block_numbers(way)
    assert found[0] == 0
    assert set(np.diff(found).tolist()) <= {0, 1}
    starts_m = way[np.flatnonzero(np.diff(found, prepend=-1))]
    ends_m = np.append(starts_m[1:], way[-1])
    assert len(starts_m) == 1 or (ends_m - starts_m >= BLOCK_M).all()


@given(scans=st.integers(1, 300), step_m=st.floats(0.01, 20))
def test_a_steady_drive_has_no_more_blocks_than_its_way_holds_and_few_less(scans: int, step_m: float) -> None:
    way = step_m * np.arange(scans)
    blocks = block_numbers(way)[-1] + 1
    assert blocks <= max(way[-1] / BLOCK_M, 1) + 1e-9
    assert blocks >= way[-1] // (BLOCK_M + step_m)


def test_a_car_that_stands_still_has_one_block() -> None:
    assert block_numbers(np.zeros(500)).tolist() == [0] * 500


def test_scans_made_more_often_make_no_more_blocks() -> None:
    once, often = np.arange(0, 1000.5, 5.0), np.arange(0, 1000.5, 0.5)
    assert block_numbers(often)[-1] == block_numbers(once)[-1]
