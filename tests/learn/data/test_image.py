"""Images for the model: positions of objects, sums that averaging keeps, rotation about the radar."""

import math

import numpy as np
import pytest
import torch
from hypothesis import given, settings
from hypothesis import strategies as st
from numpy.testing import assert_allclose

from echoscape.learn.data.image import CODE_OF_ONE, Projector, image_of_codes, range_cells
from echoscape.learn.data.image_settings import ImageSettings
from echoscape.learn.model.pixel_coords import metres_of_pixels, pixels_of_metres
from echoscape.sim.datasets.cartesian import polar_to_cartesian

IMAGE = ImageSettings(pixel_m=1.0, size=64, near_m=2.0)


def _spot(azimuth_deg: float, range_m: float, *, bin_m: float = 0.05) -> np.ndarray:
    codes = np.zeros((400, 800), np.uint8)
    row, column = azimuth_deg / 0.9, range_m / bin_m
    rows, columns = np.arange(400)[:, None], np.arange(800)[None, :] + 0.5
    away = (rows - row + 200) % 400 - 200
    blob = 120 * np.exp(-((away / 8) ** 2) - ((columns - column) * bin_m / 1.5) ** 2)
    codes[:] = np.rint(blob)
    return codes


def _centre(image: torch.Tensor, settings: ImageSettings) -> np.ndarray:
    weight = image[0].double()
    rows, columns = torch.meshgrid(*[torch.arange(settings.size, dtype=torch.float64)] * 2, indexing="ij")
    place = torch.stack([(weight * rows).sum(), (weight * columns).sum()]) / weight.sum()
    return metres_of_pixels(place, size=settings.size, pixel_m=settings.pixel_m).numpy()


@pytest.mark.parametrize("azimuth_deg", [0.0, 90.0, 180.0, 270.0, 33.3])
def test_an_object_appears_where_docs_conventions_put_it(azimuth_deg: float) -> None:
    image = image_of_codes(_spot(azimuth_deg, 20.0), 0.05, IMAGE, first_rad=0.0)
    angle = math.radians(azimuth_deg)
    # The middle of a blob 14 degrees wide lies 1 % nearer than its middle row, 0.2 m.
    assert_allclose(_centre(image, IMAGE), [20 * math.cos(angle), 20 * math.sin(angle)], atol=0.25)


@given(turn=st.floats(-7, 7), azimuth_deg=st.floats(0, 360))
@settings(max_examples=20, deadline=None)
def test_rotation_turns_the_content_clockwise(turn: float, azimuth_deg: float) -> None:
    cells = range_cells(_spot(azimuth_deg, 20.0), 0.05, IMAGE)
    projector = Projector(IMAGE, 400)
    x, y = _centre(projector.image(cells, first_rad=0.0), IMAGE)
    expected = [math.cos(turn) * x - math.sin(turn) * y, math.sin(turn) * x + math.cos(turn) * y]
    assert_allclose(_centre(projector.image(cells, first_rad=0.0, turn_rad=turn), IMAGE), expected, atol=0.03)


def test_the_first_azimuth_may_look_aside() -> None:
    projector, cells = Projector(IMAGE, 400), range_cells(_spot(33.3, 20.0), 0.05, IMAGE)
    moved = projector.image(cells, first_rad=0.3, turn_rad=0.4, shift_m=(3.0, -1.0))
    assert_allclose(
        moved, projector.image(cells, first_rad=0.0, turn_rad=0.7, shift_m=(3.0, -1.0)), atol=1e-5
    )


def test_a_quarter_turn_moves_pixels_and_changes_none() -> None:
    cells = np.random.default_rng(1).integers(0, 130, (400, IMAGE.cells), np.uint8)
    projector = Projector(IMAGE, 400)
    expected = torch.rot90(projector.image(cells, first_rad=0.0)[0], -1)
    assert_allclose(projector.image(cells, first_rad=0.0, turn_rad=math.pi / 2)[0], expected, atol=2e-4)


@pytest.mark.parametrize("bin_m", [0.0432, 0.0596, 0.5, 0.7])
def test_averaging_over_range_keeps_the_sum_over_the_range(bin_m: float) -> None:
    image = ImageSettings(pixel_m=0.6912, size=64, near_m=0.0)
    reach = image.cells * image.cell_m
    codes = np.random.default_rng(2).integers(0, 255, (50, int(reach / bin_m) - 1), np.uint8)
    found = range_cells(codes, bin_m, image).sum(1, dtype=float) * image.cell_m
    # A cell is rounded by at most half a code.
    assert_allclose(found, codes.sum(1) * bin_m, atol=0.5 * reach)
    assert_allclose(found.mean(), codes.sum(1).mean() * bin_m, rtol=0.003)


def test_range_offset_moves_cells_outwards() -> None:
    codes = np.zeros((4, 800), np.uint8)
    codes[:, 300:310] = 100  # 15.0 to 15.5 m
    near = range_cells(codes, 0.05, IMAGE)
    far = range_cells(codes, 0.05, IMAGE, range_offset_m=3.0)
    assert near[0].argmax() == 30
    assert far[0].argmax() == 36


def test_nearer_than_near_m_and_beyond_the_last_bin_is_nothing() -> None:
    image = image_of_codes(np.full((400, 500), 100, np.uint8), 0.05, IMAGE, first_rad=0.0)[0] * CODE_OF_ONE
    offset = np.arange(64) - 31.5
    distance = np.hypot(offset[:, None], offset)
    assert (image.numpy()[distance < 1.7] == 0).all()
    assert (image.numpy()[distance > 25.3] == 0).all()
    assert_allclose(image.numpy()[(distance > 2.3) & (distance < 24.7)], 100, rtol=1e-5)


def test_pixels_and_metres_are_inverses_and_forward_is_up() -> None:
    points = torch.rand(50, 2, dtype=torch.float64) * 100
    there = metres_of_pixels(points, size=320, pixel_m=0.3456)
    assert_allclose(pixels_of_metres(there, size=320, pixel_m=0.3456), points, atol=1e-9)
    assert metres_of_pixels(torch.tensor([0.0, 319.0]), size=320, pixel_m=2.0).tolist() == [319.0, 319.0]


@pytest.mark.parametrize(
    ("wrong", "name"),
    [
        ({"size": 101}, "size"),
        ({"size": 0}, "size"),
        ({"pixel_m": 0.0}, "pixel_m"),
        ({"near_m": -1.0}, "near_m"),
    ],
)
def test_image_settings_out_of_their_range_are_refused(wrong: dict, name: str) -> None:
    with pytest.raises(ValueError, match=f"{name} must"):
        ImageSettings(**wrong)


def test_bad_scans_are_refused() -> None:
    with pytest.raises(ValueError, match="codes must be"):
        range_cells(np.zeros((4, 5)), 0.1, IMAGE)  # type: ignore[arg-type]
    with pytest.raises(ValueError, match="bin_m must be"):
        range_cells(np.zeros((4, 5), np.uint8), 0.0, IMAGE)
    with pytest.raises(ValueError, match="cells must have"):
        Projector(IMAGE, 400).image(np.zeros((399, IMAGE.cells), np.uint8), first_rad=0.0)


def test_a_shift_moves_the_content_by_whole_pixels() -> None:
    cells = np.random.default_rng(1).integers(0, 99, (400, IMAGE.cells)).astype(np.uint8)
    projector = Projector(IMAGE, 400)
    plain = projector.image(cells, first_rad=0.0, turn_rad=0.3)[0]
    shifted = projector.image(
        cells, first_rad=0.0, turn_rad=0.3, shift_m=(3 * IMAGE.pixel_m, -5 * IMAGE.pixel_m)
    )[0]
    assert_allclose(shifted[:-3, :-5], plain[3:, 5:], atol=1e-4)  # three up, five to the left


def test_images_for_the_network_are_those_of_the_numpy_function() -> None:
    cells = np.random.default_rng(2).integers(0, 130, (400, IMAGE.cells), np.uint8)
    expected = polar_to_cartesian(cells, IMAGE.cell_m, first_rad=0.0, pixel_m=IMAGE.pixel_m, size=IMAGE.size)
    found = Projector(IMAGE, 400).image(cells, first_rad=0.0)[0] * CODE_OF_ONE
    # Azimuths in single precision are off by up to 1e-5 of the 0.9 deg between two of them.
    assert_allclose(found, expected, atol=0.01)
