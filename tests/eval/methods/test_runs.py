"""Runs are those that a walk along each azimuth finds, and so is what holds within them."""

import numpy as np
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra.numpy import array_shapes, arrays

from echoscape.eval.methods.runs import Runs

MASKS = arrays(bool, array_shapes(min_dims=2, max_dims=2, max_side=9))


def walked(mask: np.ndarray) -> list[tuple[int, int, int]]:
    found = []
    for azimuth, row in enumerate(mask.tolist()):
        first = None
        for place, marked in enumerate([*row, False]):
            if marked and first is None:
                first = place
            elif not marked and first is not None:
                found.append((azimuth, first, place))
                first = None
    return found


@given(MASKS)
def test_runs_are_those_of_a_walk(mask: np.ndarray) -> None:
    runs = Runs.of(mask)
    assert list(zip(runs.azimuth, runs.first, runs.end, strict=True)) == walked(mask)
    np.testing.assert_array_equal(runs.mask(), mask)


@given(MASKS, st.integers(0, 2**32 - 1))
def test_maxima_sums_and_peaks_are_those_of_the_slices(mask: np.ndarray, seed: int) -> None:
    values = np.random.default_rng(seed).integers(-3, 4, mask.shape).astype(float)
    runs = Runs.of(mask)
    slices = [values[azimuth, first:end] for azimuth, first, end in walked(mask)]
    assert runs.reduce(np.maximum, values).tolist() == [each.max() for each in slices]
    assert runs.reduce(np.add, values).tolist() == [each.sum() for each in slices]
    peaks = [first + int(np.argmax(each)) for each, (_, first, _) in zip(slices, walked(mask), strict=True)]
    assert runs.peaks(values).tolist() == peaks


def test_the_middle_of_an_even_run_is_the_farther_bin() -> None:
    assert Runs.of(np.array([[0, 1, 1, 1, 0, 1, 1]], bool)).middle.tolist() == [2, 6]


@given(MASKS)
def test_selected_runs_keep_their_cells(mask: np.ndarray) -> None:
    runs = Runs.of(mask)
    odd = runs[np.arange(len(runs)) % 2 == 1]
    even = runs[np.arange(len(runs)) % 2 == 0]
    assert not (odd.mask() & even.mask()).any()
    np.testing.assert_array_equal(odd.mask() | even.mask(), mask)
