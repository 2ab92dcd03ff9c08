"""A corner reflector appears at the range and bearing that are stated, and the car before it is at rest."""

import math
from typing import Any

import numpy as np
import pytest

from echoscape.testing import TargetScan, make_target


def _peak(target: TargetScan) -> tuple[int, int]:
    row, column = np.unravel_index(int(target.scan.codes.argmax()), target.scan.codes.shape)
    return int(row), int(column)


def test_the_strongest_cell_of_the_default_target_is_at_its_range_and_bearing(
    radar_target: TargetScan,
) -> None:
    row, column = _peak(radar_target)
    assert (column + 0.5) * radar_target.scan.bin_m == pytest.approx(radar_target.range_m, abs=1e-9)
    assert radar_target.scan.azimuth_rad[row] == pytest.approx(radar_target.bearing_rad, abs=1e-9)
    assert (row, column) == (radar_target.azimuth, radar_target.bin)


@pytest.mark.parametrize(
    ("range_m", "bearing_rad"), [(10.0, 0.0), (23.4, -0.7), (50.0, 3.1), (41.0, 1.9), (65.0, 5.5)]
)
def test_the_peak_is_within_a_bin_of_the_range_and_half_a_step_of_the_bearing(
    range_m: float, bearing_rad: float
) -> None:
    target = make_target(range_m, bearing_rad)
    row, column = _peak(target)
    assert abs((column + 0.5) * target.scan.bin_m - range_m) <= 1.5 * target.scan.bin_m
    off_rad = (target.scan.azimuth_rad[row] - bearing_rad + math.pi) % (2 * math.pi) - math.pi
    assert abs(off_rad) <= 1.01 * math.pi / 100
    assert abs(target.bin - column) <= 2
    assert target.azimuth == row


def test_the_car_is_at_rest_before_the_target(radar_target: TargetScan) -> None:
    assert radar_target.scan.truth is not None
    assert np.ptp(radar_target.scan.truth.pose, axis=0).max() == 0
    assert not radar_target.scan.truth.cells.moving.any()


@pytest.mark.parametrize("range_m", [-1.0, 4.9, 88.5, math.nan, math.inf])
def test_a_target_out_of_range_is_refused(range_m: float) -> None:
    with pytest.raises(ValueError, match=r"range_m must be between 5 and 88\.4736, got"):
        make_target(range_m)


def test_numbers_of_numpy_name_the_same_target() -> None:
    place: tuple[Any, ...] = (np.float32(10), np.int64(0))
    found = make_target(*place, seed=np.int64(7), artefacts={"ghosts": np.float32(0.5)})
    assert found == make_target(10, 0, seed=7, artefacts={"ghosts": 0.5})


@pytest.mark.parametrize("value", ["20", True, [20.0], 20j])
@pytest.mark.parametrize("name", ["range_m", "bearing_rad"])
def test_a_place_that_is_no_number_is_refused_by_name(name: str, value: Any) -> None:
    with pytest.raises(ValueError, match=f"^{name} must be a number, got "):
        make_target(**{name: value})


@pytest.mark.parametrize("bearing_rad", [math.nan, math.inf])
def test_a_target_in_no_direction_is_refused(bearing_rad: float) -> None:
    with pytest.raises(ValueError, match="bearing_rad must be finite, got"):
        make_target(20.0, bearing_rad)
