"""Global matching: the fast form against the plain one, values and gradients, and laws of a softmax."""

from typing import Any

import pytest
import torch
from numpy.testing import assert_allclose
from torch import Tensor

from echoscape.learn.model.descriptors import descriptors_at
from echoscape.learn.model.feature_pyramid import FeaturePyramid
from echoscape.learn.model.keypoint_model import (
    Maps,
    dense_descriptors,
    match_weights,
    matched_locations,
    unit,
)
from echoscape.learn.model.pixel_coords import pixel_grid
from echoscape.learn.model.tiled_matching import Search, match_global
from tests.learn.maps import drawn_maps, drawn_search, oblong_maps

SIZE = 48
T = 40.0


def _plain(queries: Tensor, maps: Maps, *, temperature: float) -> Tensor:
    return matched_locations(queries, unit(dense_descriptors(maps), dim=1), temperature=temperature)


def _fast(
    queries: Tensor,
    maps: Maps,
    *,
    temperature: float = T,
    stride: int = 1,
    dtype: torch.dtype | None = None,
) -> Search:
    pyramid = FeaturePyramid(maps=maps, stride=stride, dtype=dtype)
    return match_global(queries, pyramid, temperature=temperature)


def _places(queries: Tensor, maps: Maps, **how: Any) -> Tensor:
    return _fast(queries, maps, **how).places_px


def _slopes(values: Tensor, inputs: list[Tensor]) -> list[Tensor]:
    weights = torch.linspace(-1, 2, values[0].numel()).view(values[0].shape)
    return list(torch.autograd.grad((values * weights).sum(), inputs))


@pytest.mark.parametrize("size", [16, 48, 160])
def test_fast_matching_is_plain_matching_in_float64(size: int) -> None:
    queries, maps = drawn_search(size, batch=2)
    plain, fast = (
        _plain(queries, maps, temperature=T),
        _places(queries, maps, temperature=T, dtype=torch.float64),
    )
    assert_allclose(fast.detach(), plain.detach(), atol=1e-9)
    for mine, theirs in zip(_slopes(fast, [queries, *maps]), _slopes(plain, [queries, *maps]), strict=True):
        assert_allclose(mine, theirs, atol=1e-9 * float(theirs.abs().max()))


# float32 has 24 bits: logits of 40 are right to 1e-5. bfloat16 has 8: products of 248 terms to 1e-3 of their
# length, logits to 0.04, and with them a place spread over some pixels to a tenth.
@pytest.mark.parametrize(
    ("dtype", "places_px", "slope"), [(torch.float32, 2e-3, 2e-3), (torch.bfloat16, 0.15, 0.1)]
)
def test_fast_matching_in_lower_precision_stays_near(
    dtype: torch.dtype, places_px: float, slope: float
) -> None:
    queries, maps = drawn_search(SIZE, dtype=torch.float32)
    exact = [each.detach().double().requires_grad_() for each in (queries, *maps)]
    plain = _plain(exact[0], tuple(exact[1:]), temperature=T)
    fast = _places(queries, maps, temperature=T, dtype=dtype)
    assert fast.dtype == torch.float32
    assert_allclose(fast.detach(), plain.detach(), atol=places_px)
    for mine, theirs in zip(_slopes(fast, [queries, *maps]), _slopes(plain, exact), strict=True):
        assert (mine - theirs).norm() <= slope * theirs.norm()


def test_matching_passes_gradcheck() -> None:
    queries, maps = drawn_search(16)

    def places(queries: Tensor, *maps: Tensor) -> Tensor:
        return _places(queries, maps, temperature=5.0, dtype=torch.float64)

    assert torch.autograd.gradcheck(places, (queries, *maps), fast_mode=True)


def test_a_stride_of_two_is_plain_matching_on_a_grid_of_half_as_many() -> None:
    queries, maps = drawn_search(64)
    halves = (torch.nn.functional.avg_pool2d(maps[0], 2), *maps[1:])
    size = halves[0].shape[-2:]
    resized = [
        torch.nn.functional.interpolate(each, size=size, mode="bilinear", align_corners=False)
        for each in halves[1:]
    ]
    dense = unit(torch.cat([halves[0], *resized], 1), dim=1)
    weights = (T * (queries @ dense.flatten(2))).softmax(-1)
    axis = torch.arange(32, dtype=torch.float64) * 2 + 0.5
    expected = weights @ torch.stack(torch.meshgrid(axis, axis, indexing="ij"), -1).reshape(-1, 2)
    found = _places(queries, maps, temperature=T, stride=2, dtype=torch.float64)
    assert_allclose(found.detach(), expected.detach(), atol=1e-9)


def test_the_log_of_the_softmax_denominator_is_that_of_the_plain_one_with_its_gradients() -> None:
    queries, maps = drawn_search(SIZE)
    dense = unit(dense_descriptors(maps), dim=1)
    plain = (T * (queries @ dense.flatten(2))).logsumexp(-1)
    fast = _fast(queries, maps, dtype=torch.float64).log_sums
    assert_allclose(fast.detach(), plain.detach(), atol=1e-9)
    leaves = [queries, *maps]
    for mine, theirs in zip(_slopes(fast, leaves), _slopes(plain, leaves), strict=True):
        assert_allclose(mine, theirs, atol=1e-9 * float(theirs.abs().max()))


@pytest.mark.parametrize("stride", [1, 2])
@pytest.mark.parametrize(("rows", "columns"), [(48, 32), (16, 64)])
def test_images_that_differ_and_are_not_square_are_each_searched(
    stride: int, rows: int, columns: int
) -> None:
    maps = oblong_maps(rows, columns)
    draws = torch.Generator().manual_seed(7)
    queries = unit(torch.rand(2, 9, 248, generator=draws, dtype=torch.float64))
    pyramid = FeaturePyramid(maps=maps, stride=stride)
    grid = (pixel_grid(rows // stride, columns // stride, like=queries) + 0.5) * stride - 0.5
    wanted = (T * queries @ pyramid.descriptors().flatten(2)).softmax(-1) @ grid
    assert_allclose(match_global(queries, pyramid, temperature=T).places_px, wanted, atol=1e-9)


def test_gradients_by_descriptors_too_short_to_be_made_one_long_are_those_of_the_plain_form() -> None:
    queries, maps = drawn_search(SIZE)
    maps = tuple((3e-8 * each.detach()).requires_grad_() for each in maps)
    assert float(FeaturePyramid(maps=maps).lengths.detach().max()) == 1e-6
    plain, fast = _plain(queries, maps, temperature=T), _places(queries, maps)
    assert_allclose(fast.detach(), plain.detach(), atol=1e-9)
    for mine, theirs in zip(_slopes(fast, list(maps)), _slopes(plain, list(maps)), strict=True):
        assert_allclose(mine, theirs, atol=1e-9 * float(theirs.abs().max()))


def test_a_descriptor_finds_its_own_pixel_when_the_temperature_is_high() -> None:
    maps = drawn_maps(32)
    pixels = torch.tensor([[[4.0, 9.0], [30.0, 1.0], [17.0, 22.0]]])
    found = _places(descriptors_at(maps, pixels), maps, temperature=2000.0)
    assert_allclose(found, pixels, atol=1e-3)


def test_equal_similarities_give_the_middle_of_the_image() -> None:
    maps = tuple(torch.ones_like(each) for each in drawn_maps(32))
    queries = unit(torch.rand(1, 3, 248))
    assert_allclose(_places(queries, maps, temperature=100.0), torch.full((1, 3, 2), 15.5), rtol=1e-4)


@pytest.mark.parametrize("sign", [1, -1])
def test_far_off_similarities_neither_overflow_nor_vanish(sign: int) -> None:
    maps = drawn_maps(32)
    queries = sign * unit(dense_descriptors(maps)[:, :, 3, 3])[:, None]
    places = _places(queries, maps, temperature=3000.0)
    assert bool(places.isfinite().all())
    expected = _plain(queries, maps, temperature=3000.0)
    assert_allclose(places, expected, atol=0.05)


def test_a_single_peak_at_any_sample_is_found() -> None:
    maps = tuple(torch.full_like(each, 0.01) for each in drawn_maps(32))
    maps[0][0, :, :, :] = 0.01
    maps[0][0, 3, 7, 9] = 50.0
    query = torch.zeros(1, 1, 248)
    query[..., 3] = 1
    assert_allclose(_places(query, maps, temperature=400.0), [[[7.0, 9.0]]], atol=1e-3)


def test_weights_are_one_for_certain_equals_and_zero_for_opposites() -> None:
    similarity = torch.tensor([1.0, -1.0, 0.0, 1.0])
    found = match_weights(similarity, torch.tensor([1.0, 1.0, 1.0, 0.5]), torch.tensor([1.0, 1.0, 1.0, 0.5]))
    assert found.tolist() == [1.0, 0.0, 0.5, 0.25]
