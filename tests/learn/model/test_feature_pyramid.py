"""The feature pyramid: lengths, number formats, and similarities between samples."""

import pytest
import torch
from numpy.testing import assert_allclose

from echoscape.learn.model.feature_pyramid import FeaturePyramid
from tests.learn.maps import drawn_maps, drawn_search


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
    queries, maps = drawn_search(32)
    pyramid = FeaturePyramid(maps=maps, stride=stride)
    outside, edge = (
        pyramid.similarity(queries, torch.tensor(place, dtype=torch.float64).expand(1, 9, 2))
        for place in ([-3.0, 40.0], [(stride - 1) / 2, 31.0 - (stride - 1) / 2])
    )
    assert_allclose(outside.detach(), edge.detach(), atol=1e-12)


@pytest.mark.parametrize("stride", [1, 2])
def test_similarity_at_a_place_is_interpolated_between_the_samples_around(stride: int) -> None:
    queries, maps = drawn_search(32)
    pyramid = FeaturePyramid(maps=maps, stride=stride)
    row, column = 5, 8  # of samples; the place is a quarter of the way down and 60 % of the way right
    place = (torch.tensor([row + 0.25, column + 0.6], dtype=torch.float64) + 0.5) * stride - 0.5
    found = pyramid.similarity(queries, place.expand(1, 9, 2))
    around = queries @ pyramid.descriptors()[:, :, row : row + 2, column : column + 2].flatten(2)
    shares = torch.tensor([0.75 * 0.4, 0.75 * 0.6, 0.25 * 0.4, 0.25 * 0.6], dtype=torch.float64)
    assert_allclose(found.detach(), (around @ shares).detach(), atol=1e-12)


def test_a_stride_other_than_1_or_2_is_refused() -> None:
    with pytest.raises(ValueError, match="stride must be one of"):
        FeaturePyramid(maps=drawn_maps(32), stride=3)
