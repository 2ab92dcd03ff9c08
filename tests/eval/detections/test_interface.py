import math
from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from numpy.testing import assert_allclose

from echoscape.eval.detections.interface import Detections, cells_of, polar_detections
from tests.eval.detections.made_scans import BIN_M, made_scan


@given(azimuth=st.integers(0, 399), range_m=st.floats(0.5, 150.0), first=st.integers(0, 13))
def test_a_point_comes_back_to_the_azimuth_and_range_that_measured_it(
    azimuth: int, range_m: float, first: int
) -> None:
    scan = made_scan(np.zeros((400, 8)))
    scan = replace(scan, encoder=(scan.encoder + first).astype(np.uint16))
    angle = float(scan.azimuth_rad[azimuth])
    point = np.array([[range_m * math.cos(angle), range_m * math.sin(angle)]])
    found = polar_detections(point, np.array([0.5]), scan)
    assert found.azimuth.tolist() == [azimuth]
    assert_allclose(found.range_m, [range_m])


def test_what_lies_to_the_right_is_a_quarter_turn_on() -> None:
    found = polar_detections(np.array([[0.0, 5.0], [-5.0, 0.0]]), np.ones(2), made_scan(np.zeros((8, 9))))
    assert found.azimuth.tolist() == [2, 4]


def test_cells_are_at_the_centres_of_their_bins() -> None:
    mask = np.zeros((3, 4), bool)
    mask[1, 2] = True
    found = cells_of(mask, np.arange(12).reshape(3, 4), BIN_M)
    assert (found.azimuth.tolist(), found.score.tolist(), len(found)) == ([1], [6.0], 1)
    assert_allclose(found.range_m, [0.25])


def test_refuses_lengths_that_differ_and_numbers_that_are_none() -> None:
    one, two = np.zeros(1), np.zeros(2)
    with pytest.raises(ValueError, match=r"azimuth, range_m and score must be \(N,\)"):
        Detections(azimuth=np.zeros(1, int), range_m=two, score=one)
    with pytest.raises(ValueError, match="range_m and score must be finite"):
        Detections(azimuth=np.zeros(1, int), range_m=one, score=np.array([np.nan]))
