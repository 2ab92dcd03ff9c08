"""Parts of slender metal facets: they cover their facet evenly, and stay whatever else is in the scene."""

import math
from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from numpy.typing import NDArray

from echoscape.scenes.core.scene import Mesh, Placements, Prototype, Scene
from echoscape.sim.raytracing.surface.slender_facets import (
    LEAST_PARTS,
    PART_M,
    SlenderParts,
    facet_widths,
    is_slender,
    prototype_parts,
    slender_parts,
)
from tests.sim.worlds import plate, quad, world

LENGTH_M, WIDTH_M = 2.0, 0.05
BAR = plate([3.0, 40.0, 1.0], [-1, 0], LENGTH_M, WIDTH_M)
OTHER = plate([-7.0, 12.0, 0.5], [0, 1], 1.3, 0.04)


def _prototype() -> Prototype:
    mesh = plate([0.0, 0.0, 1.0], [-1, 0], LENGTH_M, WIDTH_M)
    return Prototype(name="rail", class_name="barrier", parts={"metal": mesh}, extent_m=(0.1, LENGTH_M, 1.1))


def _placed(place: np.ndarray, yaw_rad: np.ndarray) -> Scene:
    """A world of rails at given places (N, 3) and headings (N,)."""
    count = len(place)
    placements = Placements(
        prototype=np.zeros(count, np.uint32),
        instance=np.arange(1, count + 1, dtype=np.uint32),
        position=place,
        yaw=yaw_rad,
        scale=np.linspace(0.8, 1.2, count),
    )
    return replace(world(("soil", "target", OTHER)), prototypes=(_prototype(),), placements=placements)


def _rows(parts: SlenderParts) -> set[tuple[float, ...]]:
    return {tuple(row) for row in np.column_stack([parts.point, parts.normal, parts.area_m2]).tolist()}


def test_mean_over_draws_is_the_integral_over_the_facet() -> None:
    # Each point stands for its area: sums of 1, of the place along the bar and of its square, by calculus.
    sums = []
    for key in range(400):
        parts = slender_parts(world(("metal", "barrier", BAR)), key=key)
        along = parts.point[:, 1] - 40.0
        up = parts.point[:, 2] - 1.0
        assert np.abs(along).max() <= LENGTH_M / 2
        assert np.abs(up).max() <= WIDTH_M / 2 + 1e-6
        moments = (np.ones_like(along), along**2, up**2, along * up)
        sums.append([float((parts.area_m2 * each).sum()) for each in moments])
    area = LENGTH_M * WIDTH_M
    expected = [area, area * LENGTH_M**2 / 12, area * WIDTH_M**2 / 12, 0.0]
    error = np.std(sums, axis=0) / np.sqrt(len(sums))
    assert np.all(np.abs(np.mean(sums, axis=0) - expected) < 4 * error + 1e-6)


@pytest.mark.parametrize("order", [(BAR, OTHER), (OTHER, BAR)])
def test_parts_of_a_facet_do_not_depend_on_other_facets(order: tuple) -> None:
    alone = slender_parts(world(("metal", "barrier", BAR)), key=7)
    both = slender_parts(world(*(("metal", "barrier", mesh) for mesh in order)), key=7)
    assert len(both.width_m) > len(alone.width_m)
    assert _rows(alone) <= _rows(both)


def test_parts_of_a_placed_object_do_not_depend_on_other_placements() -> None:
    rng = np.random.default_rng(3)
    place, yaw_rad = rng.uniform(-80, 80, (9, 3)), rng.uniform(-3, 3, 9)
    whole = _placed(place, yaw_rad)
    few = replace(
        whole,
        placements=Placements(**{name: each[[1, 4, 5]] for name, each in vars(whole.placements).items()}),
    )
    assert _rows(slender_parts(few, key=2)) <= _rows(slender_parts(whole, key=2))


def test_a_placed_facet_is_the_prototypes_turned_and_moved() -> None:
    rail = prototype_parts(_prototype(), key=1)
    turned = slender_parts(_placed(np.array([[10.0, -4.0, 2.0]]), np.array([np.pi / 2])), key=1)
    # Turned by a quarter to the left and 0.8 of the size: its face, which looked along -x, looks along -y.
    np.testing.assert_allclose(rail.normal, np.tile([-1.0, 0, 0], (len(rail.normal), 1)), atol=1e-6)
    np.testing.assert_allclose(turned.normal, np.tile([0, -1.0, 0], (len(turned.normal), 1)), atol=1e-6)
    np.testing.assert_allclose(turned.point[:, 1], -4.0, atol=1e-6)
    np.testing.assert_allclose(np.abs(turned.point[:, 0] - 10).max(), 0.4 * LENGTH_M, atol=0.06)
    np.testing.assert_allclose(turned.width_m, 0.8 * WIDTH_M, rtol=0.01)


def test_keys_give_other_points_and_one_key_the_same() -> None:
    scene = world(("metal", "barrier", BAR))
    first, again, other = (slender_parts(scene, key=key).point for key in (1, 1, 2))
    np.testing.assert_array_equal(first, again)
    assert (np.abs(first - other) > 1e-6).any(axis=1).all()


def test_wide_level_and_other_facets_have_no_parts() -> None:
    for material, mesh in (
        ("metal", plate([3.0, 40.0, 1.0], [-1, 0], 2.0, 1.0)),
        ("soil", BAR),
        ("metal", quad([[0, 9, 1], [2, 9, 1], [2, 9.05, 1], [0, 9.05, 1]])),
    ):
        assert len(slender_parts(world((material, "barrier", mesh)), key=0).width_m) == 0


coordinates = st.tuples(*[st.floats(-1.0, 1.0, width=32)] * 3)


def mesh_of(corners: NDArray) -> Mesh:
    count = len(corners)
    return Mesh(
        vertices=corners.reshape(-1, 3).astype(np.float32),
        faces=np.arange(3 * count, dtype=np.uint32).reshape(-1, 3),
    )


def areas(corners: NDArray) -> NDArray[np.float64]:
    return np.linalg.norm(np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0]), axis=1) / 2


def longest_edges(corners: NDArray) -> NDArray[np.float64]:
    sides = [np.linalg.norm(corners[:, (k + 1) % 3] - corners[:, k], axis=1) for k in range(3)]
    return np.max(sides, axis=0)


@st.composite
def slender_triangle(draw: st.DrawFn) -> NDArray[np.float64]:
    """An upright-ish triangle, 0.1 to 2 m long and 2 mm to 0.25 m wide, of any shape, at any angle."""
    length, width = draw(st.floats(0.1, 2.0)), draw(st.floats(0.002, 0.25))
    width = min(width, 0.8 * length)
    foot = draw(st.floats(0.0, 1.0)) * length
    yaw, roll = draw(st.floats(0.0, 6.28)), draw(st.floats(-1.0, 1.0))
    along = np.array([math.sin(roll) * math.cos(yaw), math.sin(roll) * math.sin(yaw), math.cos(roll)])
    aside = np.array([-math.sin(yaw), math.cos(yaw), 0.0])
    start = np.array(draw(coordinates)) * 5
    corners = np.array([start, start + along * length, start + along * foot + aside * width])
    return np.roll(corners, draw(st.integers(0, 2)), axis=0)[None].astype(np.float32).astype(np.float64)


@given(slender_triangle(), st.integers(0, 1000))
@settings(max_examples=60, deadline=None)
def test_points_lie_in_their_facet_and_areas_add_up(corners: NDArray, seed: int) -> None:
    parts = slender_parts(world(("metal", "fence", mesh_of(corners))), key=seed)
    length = longest_edges(corners)[0]
    count = max(math.ceil(length / PART_M), LEAST_PARTS)
    assert count <= len(parts.area_m2) <= count + 1  # an edge may be longer by rounding
    # Barycentric coordinates of the points, by solving corner sums.
    a, b, c = corners[0]
    shares = np.linalg.lstsq(np.stack([b - a, c - a], axis=1), (parts.point - a).T, rcond=None)[0]
    assert shares.min() > -1e-4
    assert shares.sum(axis=0).max() < 1 + 1e-4
    off = np.abs((parts.point - a) @ (normal := np.cross(b - a, c - a)) / np.linalg.norm(normal))
    assert off.max() < 1e-5
    assert np.abs(parts.normal @ normal / np.linalg.norm(normal)) == pytest.approx(1, abs=1e-4)
    # One point per part: the height of the facet rises once to its width and falls once, so that the sum is
    # off by no more than 2 parts of length x width.
    area = areas(corners)[0]
    assert abs(float(parts.area_m2.sum()) - area) <= 2 / count * (2 * area) + 1e-6
    assert parts.width_m == pytest.approx(facet_widths(corners)[0], rel=1e-3)


@given(st.lists(st.tuples(coordinates, coordinates, coordinates), min_size=1, max_size=8))
@settings(max_examples=60, deadline=None)
def test_width_is_the_least_height_of_a_triangle(triangles: list) -> None:
    corners = np.array(triangles, np.float64)
    doubled = 2 * areas(corners)
    sides = np.array([np.linalg.norm(corners[:, (k + 1) % 3] - corners[:, k], axis=1) for k in range(3)])
    heights = np.min(doubled / np.maximum(sides, 1e-9), axis=0)
    np.testing.assert_allclose(facet_widths(corners), heights, rtol=1e-9, atol=1e-12)


def test_curved_faces_have_no_parts() -> None:
    normals = np.zeros((2, 3, 3), np.float32)
    normals[0] = [-1, 0, 0]
    half = replace(BAR, normals=normals)
    assert is_slender(half, half.vertices[half.faces].astype(np.float64)).tolist() == [False, True]
    assert len(slender_parts(world(("metal", "barrier", half)), key=0).width_m) == math.ceil(
        math.hypot(LENGTH_M, WIDTH_M) / PART_M
    )
    assert not slender_parts(world(), key=0).area_m2.size
