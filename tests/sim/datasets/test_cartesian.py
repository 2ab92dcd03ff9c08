"""Images from above: where a cell lands, that values are interpolated, and what is refused."""

import math
from typing import Any

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from numpy.testing import assert_allclose

from echoscape.sim.datasets.cartesian import cartesian_to_polar, nearest_cells, polar_to_cartesian

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
    image = polar_to_cartesian(codes, BIN_M, first_rad=0.0, pixel_m=0.5, size=301)
    down, right = np.indices(image.shape) - 150
    centre = np.array([(down * image).sum(), (right * image).sum()]) / image.sum() * 0.5
    # The middle of a bright arc of 7 rows at (column + 1/2) bin_m lies 0.1 % nearer; a tenth of a pixel more.
    assert_allclose(centre, np.array(expected) * (column + 0.5) * BIN_M, atol=0.12)


def test_range_is_interpolated_linearly_between_bin_centres() -> None:
    codes = np.tile((np.arange(BINS) + 0.5) * BIN_M, (AZIMUTHS, 1))  # each cell holds its own range
    image = polar_to_cartesian(codes, BIN_M, first_rad=0.0, pixel_m=0.3, size=401)
    offset = (np.arange(401) - 200) * 0.3
    distance = np.hypot(*np.meshgrid(offset, offset))
    inside = (distance > BIN_M / 2) & (distance < (BINS - 0.5) * BIN_M)
    assert_allclose(image[inside], distance[inside], rtol=1e-5)


def test_azimuth_is_interpolated_across_the_first_azimuth() -> None:
    codes = np.zeros((4, BINS))
    codes[3], codes[0] = 10, 20  # left 10, ahead 20: half way between them 15
    image = polar_to_cartesian(codes, BIN_M, first_rad=0.0, pixel_m=1.0, size=101)
    assert image[50 - 20, 50 - 20] == pytest.approx(15, abs=1e-4)


def test_beyond_the_last_bin_the_image_is_zero() -> None:
    image = polar_to_cartesian(np.ones((AZIMUTHS, BINS)), BIN_M, first_rad=0.0, pixel_m=1.0, size=401)
    assert image[0, 0] == 0
    assert image[200, 200 + 99] == 1
    assert image[200, 200 + 101] == 0


def test_labels_are_taken_from_the_nearest_cell() -> None:
    labels = np.arange(AZIMUTHS * BINS, dtype=np.uint32).reshape(AZIMUTHS, BINS)
    image = nearest_cells(labels, BIN_M, first_rad=0.0, pixel_m=0.5, size=101)
    assert image.dtype == np.uint32
    # 10 pixels right of the middle: 5 m at 90 degrees, the border between bins 9 and 10.
    assert image[50, 60] in (labels[100, 9], labels[100, 10])
    assert set(np.unique(image)) <= set(labels.ravel())


@pytest.mark.parametrize("first_deg", [0.84, 0.45, -12.0])
def test_content_lies_where_the_first_azimuth_looks(first_deg: float) -> None:
    # A blot about row 30, which looks along the first azimuth's direction and 27 deg more.
    rows, columns = np.indices((AZIMUTHS, 60))
    codes = 100 * np.exp(-(((rows - 30) / 4) ** 2) - ((columns - 40) / 4) ** 2)
    grid = {"first_rad": math.radians(first_deg), "pixel_m": 0.25}
    image = polar_to_cartesian(codes, 0.5, size=241, **grid).astype(float)
    ahead, right = (
        (image * each).sum() / image.sum() for each in (120 - np.indices(image.shape)) * [[[1]], [[-1]]]
    )
    assert math.degrees(math.atan2(right, ahead)) == pytest.approx(27.0 + first_deg, abs=0.02)
    back = cartesian_to_polar(image, azimuths=AZIMUTHS, bins=60, bin_m=0.5, **grid)
    assert np.average(np.arange(AZIMUTHS), weights=back.sum(axis=1)) == pytest.approx(30.0, abs=0.02)
    labels = nearest_cells((codes > 30).astype(np.uint8), 0.5, size=241, **grid)
    assert_allclose(labels, image > 30, atol=1, rtol=0)
    assert np.mean(labels != (image > 30)) < 0.005


def test_all_of_an_even_scan_stays_even() -> None:
    image = polar_to_cartesian(np.full((AZIMUTHS, BINS), 7), BIN_M, first_rad=0.0, pixel_m=0.25, size=256)
    # A few rounding errors of float32.
    assert_allclose(image, np.full((256, 256), 7), rtol=1e-6)


@pytest.mark.parametrize(
    "argument", [{"bin_m": 0.0}, {"pixel_m": math.nan}, {"size": 0}, {"codes": np.zeros(3)}]
)
def test_invalid_arguments_are_refused_by_name(argument: dict[str, Any]) -> None:
    good = {"codes": np.zeros((4, 4)), "bin_m": 1.0, "pixel_m": 1.0, "size": 3} | argument
    with pytest.raises(ValueError, match=next(iter(argument))):
        polar_to_cartesian(
            good["codes"], good["bin_m"], first_rad=0.0, pixel_m=good["pixel_m"], size=good["size"]
        )


@pytest.mark.parametrize("size", [101, 100])
@pytest.mark.parametrize(
    ("row", "ahead", "right"), [(0, 20, 0), (100, 0, 20), (200, -20, 0), (300, 0, -20), (50, 15, 15)]
)
def test_known_pixels_land_in_known_cells(size: int, row: int, ahead: int, right: int) -> None:
    # A blot of 3 x 3 pixels of 0.5 m about a point; row 100 of 400 looks right, bin k is at (k + 1/2) 0.1 m.
    image = np.zeros((size, size))
    middle = (size - 1) / 2
    down, across = round(middle - ahead), round(middle + right)
    image[down - 1 : down + 2, across - 1 : across + 2] = 1
    scan = cartesian_to_polar(image, first_rad=0.0, pixel_m=0.5, azimuths=400, bins=200, bin_m=0.1)
    place = np.array([middle - down, across - middle]) * 0.5
    azimuth, distance = np.indices(scan.shape) * np.array([[[2 * math.pi / 400]], [[0.1]]])
    distance = distance + 0.05
    weight = scan * distance  # a cell's area grows with its distance
    found = [(weight * distance * turn(azimuth)).sum() / weight.sum() for turn in (np.cos, np.sin)]
    assert_allclose(found, place, atol=0.01)
    assert abs((np.average(row_of(scan), weights=scan.sum(axis=1)) - row + 200) % 400 - 200) < 3


def row_of(scan: np.ndarray) -> np.ndarray:
    """Azimuths of a scan, counted on below 0 behind the middle of the first quarter where power is high."""
    rows = np.arange(len(scan))
    return np.where((rows > 300) & (scan[0].sum() > 0), rows - len(scan), rows)


@settings(deadline=None, max_examples=40)
@given(
    st.integers(60, 400),
    st.integers(40, 120),
    st.floats(0.1, 1.5),
    st.floats(0.3, 1.0),
    st.tuples(*[st.floats(-1, 1) for _ in range(3)]),
)
def test_smooth_scans_come_back_from_images(
    azimuths: int, bins: int, bin_m: float, fineness: float, slope: tuple[float, float, float]
) -> None:
    # Linear interpolation keeps a plane in the image exactly; on the way there, a cell's curvature at most.
    reach, (a, b, c) = bins * bin_m, slope
    azimuth = np.arange(azimuths)[:, None] * 2 * math.pi / azimuths
    distance = (np.arange(bins) + 0.5) * bin_m
    plane = c + (a * np.cos(azimuth) + b * np.sin(azimuth)) * distance / reach
    pixel_m = fineness * bin_m
    size = 2 * math.ceil(reach / pixel_m) + 3
    image = polar_to_cartesian(plane, bin_m, first_rad=0.0, pixel_m=pixel_m, size=size)
    back = cartesian_to_polar(
        image, first_rad=0.0, pixel_m=pixel_m, azimuths=azimuths, bins=bins, bin_m=bin_m
    )
    inner = slice(2, bins - 3)  # within a pixel of the scan's last bin the image ends
    curvature = (2 * math.pi / azimuths) ** 2 / 8 * (abs(a) + abs(b))
    assert_allclose(back[:, inner], plane[:, inner], atol=curvature + 1e-5)


@settings(deadline=None, max_examples=40)
@given(st.integers(2, 60), st.integers(2, 60), st.integers(1, 50), st.integers(1, 50), st.floats(0.05, 3))
def test_planes_in_images_are_kept_exactly_and_what_lies_outside_is_zero(
    height: int, width: int, azimuths: int, bins: int, bin_m: float
) -> None:
    down, right = np.indices((height, width))
    image = 100 + ((height - 1) / 2 - down) * 0.7 - (right - (width - 1) / 2) * 0.3
    scan = cartesian_to_polar(image, first_rad=0.0, pixel_m=0.4, azimuths=azimuths, bins=bins, bin_m=bin_m)
    azimuth = np.arange(azimuths)[:, None] * 2 * math.pi / azimuths
    ahead, across = (turn(azimuth) * (np.arange(bins) + 0.5) * bin_m / 0.4 for turn in (np.cos, np.sin))
    inside = (np.abs(ahead) <= (height - 1) / 2 - 1e-6) & (np.abs(across) <= (width - 1) / 2 - 1e-6)
    outside = (np.abs(ahead) > (height - 1) / 2 + 1e-6) | (np.abs(across) > (width - 1) / 2 + 1e-6)
    assert_allclose(scan[inside], (100 + 0.7 * ahead - 0.3 * across)[inside], rtol=1e-5)
    assert (scan[outside] == 0).all()


@pytest.mark.parametrize(
    "argument",
    [{"pixel_m": 0.0}, {"azimuths": 0}, {"bins": -1}, {"bin_m": math.inf}, {"image": np.zeros((0, 3))}],
)
def test_invalid_arguments_of_the_inverse_are_refused_by_name(argument: dict[str, Any]) -> None:
    good = {
        "image": np.zeros((4, 4)),
        "first_rad": 0.0,
        "pixel_m": 1.0,
        "azimuths": 4,
        "bins": 4,
        "bin_m": 1.0,
    } | argument
    with pytest.raises(ValueError, match=next(iter(argument))):
        cartesian_to_polar(good.pop("image"), **good)
