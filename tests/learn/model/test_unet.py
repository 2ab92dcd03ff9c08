"""U-Net, keypoints and descriptors: shapes that the paper states, and places to a fraction of a pixel."""

from functools import partial
from typing import Any

import pytest
import torch
from numpy.testing import assert_allclose
from torch import Tensor
from torch.nn.functional import interpolate, max_pool2d

from echoscape.learn.model.blurred_pooling import blurred_max_pool
from echoscape.learn.model.descriptors import descriptors_at
from echoscape.learn.model.keypoint_model import (
    CHANNELS,
    dense_descriptors,
    keypoint_locations,
    unit,
)
from echoscape.learn.model.model_settings import Pooling
from echoscape.learn.model.ops.inference import blurred_maxima, upsampled_above
from echoscape.learn.model.pixel_coords import cell_centres, sampled
from echoscape.learn.model.unet import FastDecoder, FastEncoder
from tests.learn.maps import drawn_maps, drawn_points, oblong_maps


def test_encoder_halves_and_doubles_as_the_paper_says() -> None:
    maps = FastEncoder()(torch.rand(2, 1, 64, 64))
    expected = [(2, count, 64 >> level, 64 >> level) for level, count in enumerate((8, 16, 32, 64, 128))]
    assert [tuple(each.shape) for each in maps] == expected
    assert sum(CHANNELS) == 248


def test_decoder_ends_in_a_pointwise_convolution_without_activation() -> None:
    decoder = FastDecoder().eval()
    assert decoder.head.kernel_size == (1, 1)
    found = decoder(tuple(each - 0.5 for each in drawn_maps(32)))
    assert found.shape == (1, 1, 32, 32)
    with torch.no_grad():
        decoder.head.weight.neg_()
        decoder.head.bias.neg_()  # type: ignore[union-attr]
    assert_allclose(
        decoder(tuple(each - 0.5 for each in drawn_maps(32))).detach(), -found.detach(), atol=1e-6
    )


def test_descriptors_are_those_of_the_dense_map_and_of_unit_length() -> None:
    maps, points = drawn_maps(48, dtype=torch.float64), drawn_points(60, 48, dtype=torch.float64)
    found = descriptors_at(maps, points)
    assert_allclose(found, unit(sampled(dense_descriptors(maps), points)), atol=1e-12)
    assert_allclose(found.norm(dim=-1), 1, atol=1e-12)


def test_descriptors_of_images_that_differ_and_are_not_square_are_their_own() -> None:
    maps = oblong_maps(32, 48)
    points = torch.rand(2, 40, 2, generator=torch.Generator().manual_seed(8), dtype=torch.float64)
    points = points * torch.tensor([40.0, 56.0]) - 4  # some outside
    plain = unit(sampled(dense_descriptors(maps), points))
    assert_allclose(descriptors_at(maps, points), plain, atol=1e-12)


def test_dense_descriptors_hold_each_map_resized_by_areas() -> None:
    maps = drawn_maps(32)
    dense = dense_descriptors(maps)
    assert_allclose(dense[:, :8], maps[0])
    # Flat maps stay flat: each channel is where its map stands in the order, finest first.
    flat = tuple(torch.ones_like(each) * (level + 1) for level, each in enumerate(maps))
    assert dense_descriptors(flat)[0, [0, 8, 24, 56, 120], 5, 9].tolist() == [1, 2, 3, 4, 5]


def test_sampling_a_ramp_gives_the_place() -> None:
    rows, columns = torch.meshgrid(torch.arange(20.0), torch.arange(20.0), indexing="ij")
    points = drawn_points(40, 20)
    assert_allclose(sampled(torch.stack([rows, columns])[None], points), points, atol=1e-5)


def test_flat_logits_put_keypoints_in_the_middle_of_cells() -> None:
    found = keypoint_locations(torch.zeros(1, 1, 40, 40), 20)
    assert_allclose(found[0], cell_centres(40, 20, like=found))
    assert found[0, 0].tolist() == [0.5, 0.5]
    assert found[0, 21].tolist() == [2.5, 2.5]


@pytest.mark.parametrize("place", [(3.0, 14.0), (7.25, 11.5)])
def test_a_peak_is_found_to_a_fraction_of_a_pixel(place: tuple[float, float]) -> None:
    logits = torch.full((40, 40), -60.0)
    row, column = int(place[0]), int(place[1])
    down, right = place[0] - row, place[1] - column
    for r, wr in ((row, 1 - down), (row + 1, down)):
        for c, wc in ((column, 1 - right), (column + 1, right)):
            logits[r, c] = torch.tensor(wr * wc + 1e-12).log()
    found = keypoint_locations(logits[None, None], 2)
    assert_allclose(found[0, 0], place, atol=1e-3)


def test_cells_that_do_not_fit_are_refused() -> None:
    with pytest.raises(ValueError, match="multiple of 20"):
        keypoint_locations(torch.zeros(1, 1, 50, 50), 20)


def test_resizing_goes_by_areas_everywhere() -> None:
    coarse = torch.arange(4.0)[None, None, None].expand(1, 1, 4, 4)
    places = (torch.arange(8.0) + 0.5) / 2 - 0.5
    expected: Tensor = places.clamp(0, 3)
    assert_allclose(
        interpolate(coarse, scale_factor=2, mode="bilinear", align_corners=False)[0, 0, 3], expected
    )


@pytest.mark.parametrize("shape", [(2, 3, 8, 12), (1, 1, 2, 2), (1, 8, 16, 2)])
def test_blurred_maxima_are_the_same_where_no_gradient_is_asked_for(shape: tuple[int, ...]) -> None:
    values = torch.randn(shape, generator=torch.Generator().manual_seed(5), dtype=torch.float64)
    assert_allclose(blurred_maxima(values), blurred_max_pool(values), atol=1e-12)


@pytest.mark.parametrize("pooling", ["max", "blurred"])
def test_a_network_says_the_same_with_and_without_gradients(pooling: Pooling) -> None:
    torch.manual_seed(1)
    encoder, decoder = FastEncoder(pooling).eval(), FastDecoder().eval()
    images = torch.rand(2, 1, 32, 48)
    asked = decoder(encoder(images))
    with torch.inference_mode():
        found = decoder(encoder(images))
    assert asked.requires_grad
    assert_allclose(found, asked.detach(), atol=1e-6)


@pytest.mark.parametrize("shape", [(2, 3, 4, 6), (1, 1, 1, 1), (1, 5, 1, 3)])
def test_upsampling_beside_finer_maps_is_that_of_interpolation(shape: tuple[int, ...]) -> None:
    draws = torch.Generator().manual_seed(6)
    coarse = torch.randn(shape, generator=draws, dtype=torch.float64)
    fine = torch.randn((shape[0], 2, 2 * shape[2], 2 * shape[3]), generator=draws, dtype=torch.float64)
    plain = torch.cat([interpolate(coarse, scale_factor=2, mode="bilinear", align_corners=False), fine], 1)
    assert_allclose(upsampled_above(coarse, fine), plain, atol=1e-12)


def test_blurred_maxima_of_a_ramp_are_its_maxima_where_pools_are() -> None:
    """A ramp's maximum of 2 x 2 is half a step above the middle; a low pass leaves ramps as they are."""
    ramp = torch.arange(32.0).expand(1, 1, 16, 32)
    inner = blurred_max_pool(ramp)[0, 0, 4, 1:-1]
    assert_allclose(inner, torch.arange(1, 15) * 2 + 1.0)


@pytest.mark.parametrize("pooling", [partial(max_pool2d, kernel_size=2), blurred_max_pool])
def test_what_moves_by_a_pixel_moves_in_maps_where_pools_are_low_passed(pooling: Any) -> None:
    """A smooth bump's centre of gravity after two halvings follows it; plain maxima lag behind by more."""
    places = torch.arange(64.0)

    def centre(at: float) -> float:
        bump = torch.exp(-0.5 * ((places - at) / 1.0) ** 2)
        line = pooling(pooling((bump[:, None] * bump)[None, None]))[0, 0].sum(0)
        return float((line * (torch.arange(16) * 4 + 1.5)).sum() / line.sum())

    lag = max(abs(centre(30 + shift / 4) - centre(30) - shift / 4) for shift in range(17))
    assert (lag < 0.08) == (pooling is blurred_max_pool)
