"""Local matching: the search around an expected place against the softmax over the samples in reach."""

import math

import pytest
import torch
from numpy.testing import assert_allclose
from torch import Tensor

from echoscape.learn.model.feature_pyramid import FeaturePyramid
from echoscape.learn.model.keypoint_model import unit
from echoscape.learn.model.local_matching import REACH, Near, match_local
from echoscape.learn.model.pixel_coords import pixel_grid
from tests.learn.maps import drawn_points, drawn_search, oblong_maps

SIZE = 48
T = 40.0


def _log_density(near: Near, places: Tensor) -> Tensor:
    """Return (1, N, P): the logarithm of the normal distribution, up to a constant, at places (P, 2)."""
    return -(torch.cdist(near.places_px, places[None]) ** 2) / (2 * near.deviation_px**2)


@pytest.mark.parametrize(("stride", "deviation_px"), [(1, 1.5), (2, 3.0)])
def test_a_search_of_what_is_in_reach_is_the_softmax_over_it(stride: int, deviation_px: float) -> None:
    """At corners too; with similarities that differ little, it is nearly the softmax over the whole image."""
    queries, maps = drawn_search(SIZE)
    expected = drawn_points(9, SIZE, dtype=torch.float64)
    expected[:, 0], expected[:, 1] = 0.0, SIZE - 1.0
    near, pyramid = (
        Near(places_px=expected, deviation_px=deviation_px),
        FeaturePyramid(maps=maps, stride=stride),
    )
    samples = pixel_grid(SIZE // stride, SIZE // stride, like=queries)
    middle = ((expected[0] + 0.5) / stride - 0.5).round().clamp(0, SIZE // stride - 1)
    reach = math.ceil(REACH * deviation_px / stride)
    reached = ((samples - middle[:, None]).abs() <= reach).all(-1)  # (N, P)
    places = (samples + 0.5) * stride - 0.5
    logits = T * (queries @ pyramid.descriptors().flatten(2)) + _log_density(near, places)
    logits = logits[0].detach().masked_fill(~reached, -math.inf)
    chances = logits.softmax(-1)
    away = places - (chances @ places)[:, None]
    found = match_local(queries, pyramid, temperature=T, near=near)
    least = 0.02 * torch.eye(2, dtype=torch.float64)
    assert_allclose(found.found.places_px[0].detach(), chances @ places, atol=1e-9)
    wanted = torch.einsum("np,npi,npj->nij", chances, away, away) + least
    assert_allclose(found.found.spread_px2[0].detach(), wanted, atol=1e-9)
    prior = _log_density(near, places)[0].masked_fill(~reached, -math.inf).softmax(-1)
    away = places - (prior @ places)[:, None]
    assert_allclose(found.expected.places_px[0], prior @ places, atol=1e-9)
    wanted = torch.einsum("np,npi,npj->nij", prior, away, away) + least
    assert_allclose(found.expected.spread_px2[0], wanted, atol=1e-9)
    alike = 2.0 * (queries @ pyramid.descriptors().flatten(2)) + _log_density(near, places)
    found = match_local(queries, pyramid, temperature=2.0, near=near)
    assert_allclose(
        found.found.places_px.detach(), (alike.softmax(-1) @ places).detach(), atol=0.01 * deviation_px
    )


def test_pieces_of_keypoints_and_a_reach_beyond_the_image_change_nothing(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    queries, maps = drawn_search(SIZE)
    near = Near(places_px=drawn_points(9, SIZE, dtype=torch.float64), deviation_px=200.0)
    pyramid = FeaturePyramid(maps=maps)
    whole = match_local(queries, pyramid, temperature=T, near=near)
    monkeypatch.setattr("echoscape.learn.model.local_matching._PIECE", 1)
    pieces = match_local(queries, pyramid, temperature=T, near=near)
    assert_allclose(pieces.found.places_px.detach(), whole.found.places_px.detach(), atol=1e-9)
    assert_allclose(pieces.expected.spread_px2, whole.expected.spread_px2, atol=1e-9)
    logits = T * (queries @ pyramid.descriptors().flatten(2)) + _log_density(
        near, pixel_grid(SIZE, SIZE, like=queries)
    )
    wanted = logits.softmax(-1) @ pixel_grid(SIZE, SIZE, like=queries)
    assert_allclose(whole.found.places_px.detach(), wanted.detach(), atol=1e-9)


@pytest.mark.parametrize("stride", [1, 2])
@pytest.mark.parametrize(("rows", "columns"), [(48, 32), (16, 64)])
def test_images_that_differ_and_are_not_square_are_each_searched(
    stride: int, rows: int, columns: int
) -> None:
    maps = oblong_maps(rows, columns)
    draws = torch.Generator().manual_seed(7)
    queries = unit(torch.rand(2, 9, 248, generator=draws, dtype=torch.float64))
    places = torch.rand(2, 9, 2, generator=draws, dtype=torch.float64) * torch.tensor([rows, columns])
    near, pyramid = Near(places_px=places, deviation_px=500.0), FeaturePyramid(maps=maps, stride=stride)
    grid = (pixel_grid(rows // stride, columns // stride, like=queries) + 0.5) * stride - 0.5
    density = -((places[:, :, None] - grid) ** 2).sum(-1) / (2 * 500.0**2)
    similarity = T * queries @ pyramid.descriptors().flatten(2)
    found = match_local(queries, pyramid, temperature=T, near=near)
    assert_allclose(found.found.places_px, (similarity + density).softmax(-1) @ grid, atol=1e-9)
