"""Pictures from above: where a cell lands, that values are interpolated, and what is refused."""

import math
from typing import Any

import numpy as np
import pytest
from numpy.testing import assert_allclose

from echoscape.sim.cartesian import nearest_cells, polar_to_cartesian

AZIMUTHS, BINS, BIN_M = 400, 200, 0.5


@pytest.mark.parametrize(
    ("azimuth_deg", "expected"),
    [(0, (-1, 0)), (90, (0, 1)), (180, (1, 0)), (270, (0, -1)), (45, (-(0.5**0.5), 0.5**0.5))],
)
def test_forward_is_up_and_right_is_right(azimuth_deg: int, expected: tuple[float, float]) -> None:
    codes = np.zeros((AZIMUTHS, BINS))
    row, column = round(azimuth_deg / 360 * AZIMUTHS), 99
    codes[row - 3 : row + 4, column - 1 : column + 2] = 1
    codes[np.arange(row - 3, row + 4) % AZIMUTHS, column - 1 : column + 2] = 1
    picture = polar_to_cartesian(codes, BIN_M, pixel_m=0.5, size=301)
    down, right = np.indices(picture.shape) - 150
    centre = np.array([(down * picture).sum(), (right * picture).sum()]) / picture.sum() * 0.5
    # The middle of a bright arc of 7 rows at (column + 1/2) bin_m lies 0.1 % nearer; a tenth of a pixel more.
    assert_allclose(centre, np.array(expected) * (column + 0.5) * BIN_M, atol=0.12)


def test_range_is_interpolated_linearly_between_bin_centres() -> None:
    codes = np.tile((np.arange(BINS) + 0.5) * BIN_M, (AZIMUTHS, 1))  # each cell holds its own range
    picture = polar_to_cartesian(codes, BIN_M, pixel_m=0.3, size=401)
    offset = (np.arange(401) - 200) * 0.3
    distance = np.hypot(*np.meshgrid(offset, offset))
    inside = (distance > BIN_M / 2) & (distance < (BINS - 0.5) * BIN_M)
    assert_allclose(picture[inside], distance[inside], rtol=1e-5)


def test_azimuth_is_interpolated_across_the_first_row() -> None:
    codes = np.zeros((4, BINS))
    codes[3], codes[0] = 10, 20  # left 10, ahead 20: half way between them 15
    picture = polar_to_cartesian(codes, BIN_M, pixel_m=1.0, size=101)
    assert picture[50 - 20, 50 - 20] == pytest.approx(15, abs=1e-4)


def test_beyond_the_last_bin_the_picture_is_zero() -> None:
    picture = polar_to_cartesian(np.ones((AZIMUTHS, BINS)), BIN_M, pixel_m=1.0, size=401)
    assert picture[0, 0] == 0
    assert picture[200, 200 + 99] == 1
    assert picture[200, 200 + 101] == 0


def test_labels_are_taken_from_the_nearest_cell() -> None:
    labels = np.arange(AZIMUTHS * BINS, dtype=np.uint32).reshape(AZIMUTHS, BINS)
    picture = nearest_cells(labels, BIN_M, pixel_m=0.5, size=101)
    assert picture.dtype == np.uint32
    # 10 pixels right of the middle: 5 m at 90 degrees, the border between bins 9 and 10.
    assert picture[50, 60] in (labels[100, 9], labels[100, 10])
    assert set(np.unique(picture)) <= set(labels.ravel())


def test_all_of_an_even_scan_stays_even() -> None:
    picture = polar_to_cartesian(np.full((AZIMUTHS, BINS), 7), BIN_M, pixel_m=0.25, size=256)
    # A few rounding errors of float32.
    assert_allclose(picture, np.full((256, 256), 7), rtol=1e-6)


@pytest.mark.parametrize(
    "argument", [{"bin_m": 0.0}, {"pixel_m": math.nan}, {"size": 0}, {"codes": np.zeros(3)}]
)
def test_senseless_arguments_are_refused_by_name(argument: dict[str, Any]) -> None:
    good = {"codes": np.zeros((4, 4)), "bin_m": 1.0, "pixel_m": 1.0, "size": 3} | argument
    with pytest.raises(ValueError, match=next(iter(argument))):
        polar_to_cartesian(good["codes"], good["bin_m"], pixel_m=good["pixel_m"], size=good["size"])
