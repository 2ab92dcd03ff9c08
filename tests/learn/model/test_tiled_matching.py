"""Matching: the fast form against the plain one, values and gradients, and what a softmax must do."""

import math
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
    pixel_grid,
    unit,
)
from echoscape.learn.model.local_matching import REACH, Near, match_local
from echoscape.learn.model.tiled_matching import Search, match_global
from tests.learn.maps import drawn_maps, drawn_points, oblong_maps

SIZE = 48
T = 40.0


def _case(dtype: torch.dtype, size: int = SIZE, batch: int = 1) -> tuple[Tensor, Maps]:
    maps = drawn_maps(size, dtype=dtype, batch=batch)
    points = drawn_points(9, size, dtype=dtype).expand(batch, -1, -1)
    noise = torch.randn((batch, 9, 248), generator=torch.Generator().manual_seed(3), dtype=dtype)
    queries = unit(descriptors_at(maps, points) + 0.03 * noise)
    return queries.requires_grad_(), tuple(each.requires_grad_() for each in maps)


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
    picture = FeaturePyramid(maps=maps, stride=stride, dtype=dtype)
    return match_global(queries, picture, temperature=temperature)


def _places(queries: Tensor, maps: Maps, **how: Any) -> Tensor:
    return _fast(queries, maps, **how).places_px


def _log_density(near: Near, places: Tensor) -> Tensor:
    """Return (1, N, P): the logarithm of the normal distribution, up to a constant, at places (P, 2)."""
    return -(torch.cdist(near.places_px, places[None]) ** 2) / (2 * near.deviation_px**2)


def _slopes(values: Tensor, inputs: list[Tensor]) -> list[Tensor]:
    weights = torch.linspace(-1, 2, values[0].numel()).view(values[0].shape)
    return list(torch.autograd.grad((values * weights).sum(), inputs))


@pytest.mark.parametrize("size", [16, 48, 160])
def test_fast_matching_is_plain_matching_in_float64(size: int) -> None:
    queries, maps = _case(torch.float64, size, batch=2)
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
    queries, maps = _case(torch.float32)
    exact = [each.detach().double().requires_grad_() for each in (queries, *maps)]
    plain = _plain(exact[0], tuple(exact[1:]), temperature=T)
    fast = _places(queries, maps, temperature=T, dtype=dtype)
    assert fast.dtype == torch.float32
    assert_allclose(fast.detach(), plain.detach(), atol=places_px)
    for mine, theirs in zip(_slopes(fast, [queries, *maps]), _slopes(plain, exact), strict=True):
        assert (mine - theirs).norm() <= slope * theirs.norm()


def test_matching_passes_gradcheck() -> None:
    queries, maps = _case(torch.float64, 16)

    def places(queries: Tensor, *maps: Tensor) -> Tensor:
        return _places(queries, maps, temperature=5.0, dtype=torch.float64)

    assert torch.autograd.gradcheck(places, (queries, *maps), fast_mode=True)


def test_a_stride_of_two_is_plain_matching_on_a_grid_of_half_as_many() -> None:
    queries, maps = _case(torch.float64, 64)
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
    queries, maps = _case(torch.float64)
    dense = unit(dense_descriptors(maps), dim=1)
    plain = (T * (queries @ dense.flatten(2))).logsumexp(-1)
    fast = _fast(queries, maps, dtype=torch.float64).log_sums
    assert_allclose(fast.detach(), plain.detach(), atol=1e-9)
    leaves = [queries, *maps]
    for mine, theirs in zip(_slopes(fast, leaves), _slopes(plain, leaves), strict=True):
        assert_allclose(mine, theirs, atol=1e-9 * float(theirs.abs().max()))


@pytest.mark.parametrize(("stride", "deviation_px"), [(1, 1.5), (2, 3.0)])
def test_a_search_of_what_is_in_reach_is_the_softmax_over_it(stride: int, deviation_px: float) -> None:
    """At corners too; and where all looks much alike, that of the whole picture."""
    queries, maps = _case(torch.float64)
    expected = drawn_points(9, SIZE, dtype=torch.float64)
    expected[:, 0], expected[:, 1] = 0.0, SIZE - 1.0
    near, picture = (
        Near(places_px=expected, deviation_px=deviation_px),
        FeaturePyramid(maps=maps, stride=stride),
    )
    samples = pixel_grid(SIZE // stride, SIZE // stride, like=queries)
    middle = ((expected[0] + 0.5) / stride - 0.5).round().clamp(0, SIZE // stride - 1)
    reach = math.ceil(REACH * deviation_px / stride)
    seen = ((samples - middle[:, None]).abs() <= reach).all(-1)  # (N, P)
    places = (samples + 0.5) * stride - 0.5
    logits = T * (queries @ picture.descriptors().flatten(2)) + _log_density(near, places)
    logits = logits[0].detach().masked_fill(~seen, -math.inf)
    chances = logits.softmax(-1)
    away = places - (chances @ places)[:, None]
    found = match_local(queries, picture, temperature=T, near=near)
    least = 0.02 * torch.eye(2, dtype=torch.float64)
    assert_allclose(found.found.places_px[0].detach(), chances @ places, atol=1e-9)
    wanted = torch.einsum("np,npi,npj->nij", chances, away, away) + least
    assert_allclose(found.found.spread_px2[0].detach(), wanted, atol=1e-9)
    prior = _log_density(near, places)[0].masked_fill(~seen, -math.inf).softmax(-1)
    away = places - (prior @ places)[:, None]
    assert_allclose(found.expected.places_px[0], prior @ places, atol=1e-9)
    wanted = torch.einsum("np,npi,npj->nij", prior, away, away) + least
    assert_allclose(found.expected.spread_px2[0], wanted, atol=1e-9)
    alike = 2.0 * (queries @ picture.descriptors().flatten(2)) + _log_density(near, places)
    found = match_local(queries, picture, temperature=2.0, near=near)
    assert_allclose(
        found.found.places_px.detach(), (alike.softmax(-1) @ places).detach(), atol=0.01 * deviation_px
    )


def test_pieces_of_keypoints_and_a_reach_beyond_the_picture_change_nothing(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    queries, maps = _case(torch.float64)
    near = Near(places_px=drawn_points(9, SIZE, dtype=torch.float64), deviation_px=200.0)
    picture = FeaturePyramid(maps=maps)
    whole = match_local(queries, picture, temperature=T, near=near)
    monkeypatch.setattr("echoscape.learn.model.local_matching._PIECE", 1)
    pieces = match_local(queries, picture, temperature=T, near=near)
    assert_allclose(pieces.found.places_px.detach(), whole.found.places_px.detach(), atol=1e-9)
    assert_allclose(pieces.expected.spread_px2, whole.expected.spread_px2, atol=1e-9)
    logits = T * (queries @ picture.descriptors().flatten(2)) + _log_density(
        near, pixel_grid(SIZE, SIZE, like=queries)
    )
    wanted = logits.softmax(-1) @ pixel_grid(SIZE, SIZE, like=queries)
    assert_allclose(whole.found.places_px.detach(), wanted.detach(), atol=1e-9)


@pytest.mark.parametrize("stride", [1, 2])
@pytest.mark.parametrize(("rows", "columns"), [(48, 32), (16, 64)])
def test_pictures_that_differ_and_are_not_square_are_each_searched(
    stride: int, rows: int, columns: int
) -> None:
    maps = oblong_maps(rows, columns)
    draws = torch.Generator().manual_seed(7)
    queries = unit(torch.rand(2, 9, 248, generator=draws, dtype=torch.float64))
    places = torch.rand(2, 9, 2, generator=draws, dtype=torch.float64) * torch.tensor([rows, columns])
    near, picture = Near(places_px=places, deviation_px=500.0), FeaturePyramid(maps=maps, stride=stride)
    grid = (pixel_grid(rows // stride, columns // stride, like=queries) + 0.5) * stride - 0.5
    density = -((places[:, :, None] - grid) ** 2).sum(-1) / (2 * 500.0**2)
    similarity = T * queries @ picture.descriptors().flatten(2)
    found = match_local(queries, picture, temperature=T, near=near)
    assert_allclose(found.found.places_px, (similarity + density).softmax(-1) @ grid, atol=1e-9)
    wide = match_global(queries, picture, temperature=T)
    assert_allclose(wide.places_px, similarity.softmax(-1) @ grid, atol=1e-9)


def test_gradients_by_descriptors_too_short_to_be_made_one_long_are_those_of_the_plain_form() -> None:
    queries, maps = _case(torch.float64)
    maps = tuple((3e-8 * each.detach()).requires_grad_() for each in maps)
    assert float(FeaturePyramid(maps=maps).lengths.detach().max()) == 1e-6
    plain, fast = _plain(queries, maps, temperature=T), _places(queries, maps)
    assert_allclose(fast.detach(), plain.detach(), atol=1e-9)
    for mine, theirs in zip(_slopes(fast, list(maps)), _slopes(plain, list(maps)), strict=True):
        assert_allclose(mine, theirs, atol=1e-9 * float(theirs.abs().max()))


def test_lengths_are_numbers_where_opposites_meet() -> None:
    maps = [torch.zeros_like(each) for each in drawn_maps(32)]
    maps[3][0, :, 1], maps[3][0, :, 2] = 7.0, -9.0
    lengths = FeaturePyramid(maps=tuple(maps)).lengths
    assert float(lengths.min()) == pytest.approx(1e-6, rel=1e-3)


def test_dense_descriptors_have_the_format_of_the_products() -> None:
    maps = drawn_maps(32)
    assert FeaturePyramid(maps=maps).stacked.dtype == torch.float32
    assert FeaturePyramid(maps=maps, dtype=torch.bfloat16).stacked.dtype == torch.bfloat16


@pytest.mark.parametrize("stride", [1, 2])
def test_similarity_goes_on_outside_as_at_the_edge(stride: int) -> None:
    queries, maps = _case(torch.float64, 32)
    picture = FeaturePyramid(maps=maps, stride=stride)
    outside, edge = (
        picture.similarity(queries, torch.tensor(place, dtype=torch.float64).expand(1, 9, 2))
        for place in ([-3.0, 40.0], [(stride - 1) / 2, 31.0 - (stride - 1) / 2])
    )
    assert_allclose(outside.detach(), edge.detach(), atol=1e-12)


@pytest.mark.parametrize("stride", [1, 2])
def test_similarity_at_a_place_is_interpolated_between_the_samples_around(stride: int) -> None:
    queries, maps = _case(torch.float64, 32)
    picture = FeaturePyramid(maps=maps, stride=stride)
    row, column = 5, 8  # of samples; the place is a quarter of the way down and 60 % of the way right
    place = (torch.tensor([row + 0.25, column + 0.6], dtype=torch.float64) + 0.5) * stride - 0.5
    found = picture.similarity(queries, place.expand(1, 9, 2))
    around = queries @ picture.descriptors()[:, :, row : row + 2, column : column + 2].flatten(2)
    shares = torch.tensor([0.75 * 0.4, 0.75 * 0.6, 0.25 * 0.4, 0.25 * 0.6], dtype=torch.float64)
    assert_allclose(found.detach(), (around @ shares).detach(), atol=1e-12)


def test_a_descriptor_finds_its_own_pixel_when_the_temperature_is_high() -> None:
    maps = drawn_maps(32)
    pixels = torch.tensor([[[4.0, 9.0], [30.0, 1.0], [17.0, 22.0]]])
    found = _places(descriptors_at(maps, pixels), maps, temperature=2000.0)
    assert_allclose(found, pixels, atol=1e-3)


def test_no_difference_means_the_middle_of_the_picture() -> None:
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


def test_a_lone_peak_between_the_samples_looked_at_first_is_not_lost() -> None:
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


def test_a_stride_that_does_not_exist_is_refused() -> None:
    with pytest.raises(ValueError, match="stride must be one of"):
        _fast(*_case(torch.float32), stride=3)
