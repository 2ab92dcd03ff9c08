"""Parts of slender metal facets: they cover their facet evenly, and stay whatever else is in the scene."""

from dataclasses import replace

import numpy as np
import pytest

from echoscape.scenes.core.scene import Placements, Prototype, Scene
from echoscape.sim.raytracing.surface.slender_facets import SlenderParts, prototype_parts, slender_parts
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
