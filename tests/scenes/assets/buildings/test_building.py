import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from echoscape.scenes.assets.buildings.building import STYLES, Style, building
from echoscape.scenes.assets.buildings.facade import grid, panes, pierced_wall, ribs
from echoscape.scenes.assets.buildings.roof import offset_outline, signed_area
from echoscape.scenes.core.materials import MATERIALS
from echoscape.scenes.core.scene import Mesh
from echoscape.scenes.geometry.meshes import areas

RECTANGLE = np.array([[0.0, 0.0], [18.0, 0.0], [18.0, 11.0], [0.0, 11.0]])
L_SHAPE = np.array([[0, 0], [14, 0], [14, 7], [7, 7], [7, 13], [0, 13.0]])
OVERHANG_M = 1.6
"""Largest distance that any part, eaves and balconies included, reaches beyond the footprint [m]."""
HEIGHT_M: dict[Style, float] = {"terrace": 6.0, "house": 5.6, "block": 15.0, "hall": 8.0, "tower": 40.0}


def normals(quads: np.ndarray) -> np.ndarray:
    normal = np.cross(quads[:, 1] - quads[:, 0], quads[:, 2] - quads[:, 0])
    return normal / np.linalg.norm(normal, axis=1, keepdims=True)


def distance_outside_m(points: np.ndarray, outline: np.ndarray) -> np.ndarray:
    """Distance (V,) of `points` (V, 2) from the polygon `outline` (N, 2), 0 inside (crossing rule)."""
    start, step = outline, np.roll(outline, -1, axis=0) - outline
    away = points[:, None] - start  # (V, N, 2)
    share = np.clip((away * step).sum(axis=2) / (step**2).sum(axis=1), 0.0, 1.0)
    distance = np.linalg.norm(away - share[..., None] * step, axis=2).min(axis=1)
    y = points[:, 1:]
    spans = (start[:, 1] > y) != (start[:, 1] + step[:, 1] > y)
    with np.errstate(divide="ignore", invalid="ignore", over="ignore"):
        crossing = start[:, 0] + step[:, 0] * (y - start[:, 1]) / step[:, 1]
    inside = (spans & (points[:, :1] < crossing)).sum(axis=1) % 2 == 1
    return np.where(inside, 0.0, distance)


def top_limit_m(footprint: np.ndarray, height_m: float) -> float:
    """Height above which no part of a building reaches [m]: roofs and what stands on them."""
    return height_m + max(4.0, 0.6 * float(np.ptp(footprint, axis=0).max())) + 1.5


def check(parts: dict[str, Mesh], footprint: np.ndarray, height_m: float) -> None:
    assert set(parts) <= set(MATERIALS)
    for part in parts.values():
        assert np.isfinite(part.vertices).all()
        assert areas(part.vertices, part.faces).min() > 0
        used = part.vertices[np.unique(part.faces)].astype(np.float64)
        assert used[:, 2].min() >= -1e-4
        assert used[:, 2].max() <= top_limit_m(footprint, height_m)
        assert distance_outside_m(used[:, :2], footprint).max() <= OVERHANG_M + 1e-3


@pytest.mark.parametrize("style", STYLES)
@pytest.mark.parametrize("outline", [RECTANGLE, L_SHAPE], ids=["rectangle", "l_shape"])
@pytest.mark.parametrize("seed", [0, 1, 2])
def test_buildings_stay_within_their_overhang_and_height_limit(
    style: Style, outline: np.ndarray, seed: int
) -> None:
    parts = building(outline, height_m=HEIGHT_M[style], style=style, rng=np.random.default_rng(seed))
    check(parts, outline, HEIGHT_M[style])
    assert sum(len(part.faces) for part in parts.values()) < 5000


@given(
    corner=st.lists(st.floats(-1.2, 1.2), min_size=8, max_size=8),
    size=st.tuples(st.floats(5, 40), st.floats(6, 25)),
    turn=st.floats(0, 6.28),
    style=st.sampled_from(STYLES),
    facades=st.lists(st.booleans(), min_size=4, max_size=4),
    seed=st.integers(0, 1000),
)
@settings(max_examples=100, deadline=None)
def test_any_convex_quadrilateral_makes_a_valid_building(
    corner: list[float], size: tuple[float, float], turn: float, style: Style, facades: list[bool], seed: int
) -> None:
    outline = np.array([[0, 0], [1, 0], [1, 1], [0, 1]]) * size + np.reshape(corner, (4, 2))
    outline = outline @ np.array([[np.cos(turn), np.sin(turn)], [-np.sin(turn), np.cos(turn)]])
    rng = np.random.default_rng(seed)
    parts = building(outline, height_m=HEIGHT_M[style], style=style, rng=rng, facades=facades)
    check(parts, outline, HEIGHT_M[style])


@pytest.mark.parametrize("style", STYLES)
def test_a_building_is_a_pure_function_of_its_generator(style: Style) -> None:
    one, same, other = (
        building(RECTANGLE, height_m=12.0, style=style, rng=np.random.default_rng(seed)) for seed in (5, 5, 6)
    )
    assert all(np.array_equal(one[name].vertices, same[name].vertices) for name in one)
    assert any(
        name not in other or not np.array_equal(one[name].vertices, other[name].vertices) for name in one
    )


@pytest.mark.parametrize("style", ["terrace", "block"])
def test_windows_are_recessed_behind_the_wall_and_party_walls_are_plain(style: Style) -> None:
    open_edges = [True, False, True, False]
    for seed in range(5):
        parts = building(
            RECTANGLE, height_m=12.0, style=style, rng=np.random.default_rng(seed), facades=open_edges
        )
        glass = parts["glass"].vertices
        upper = glass[glass[:, 2] > 4.2]
        depth = np.minimum(upper[:, 1], 11.0 - upper[:, 1])
        assert depth.min() >= 0.1 - 1e-5
        assert depth.max() <= 0.25 + 1e-5
        assert upper[:, 0].min() > 0.1
        assert upper[:, 0].max() < 17.9


def test_wall_area_is_the_wall_less_its_openings() -> None:
    openings = grid(low=[1.0, 4.0], high=[2.5, 5.5], left=[1.0, 4.0], right=[2.0, 5.5], depth_m=0.2)
    made = pierced_wall(8.0, 7.0, [openings])
    facing = normals(made)[:, 2] > 0.99
    sides = np.linalg.norm(np.cross(made[:, 1] - made[:, 0], made[:, 3] - made[:, 0]), axis=1)
    np.testing.assert_allclose(sides[facing].sum(), 8 * 7 - 2 * (1.5 * 1.0 + 1.5 * 1.5))
    np.testing.assert_allclose(sides[~facing].sum(), 0.2 * 2 * (2 * (1.5 + 1.0) + 2 * (1.5 + 1.5)))
    np.testing.assert_allclose(panes(openings)[..., 2], -0.2)


def test_reveals_face_their_opening() -> None:
    openings = grid(low=[1.0], high=[2.5], left=[1.0], right=[2.0], depth_m=0.2)
    made = pierced_wall(4.0, 4.0, [openings])
    normal = normals(made)
    reveal = normal[:, 2] < 0.5
    towards = np.array([1.5, 1.75, 0.0]) - made[reveal].mean(axis=1)
    assert reveal.sum() == 4
    assert np.all((normal[reveal] * towards).sum(axis=1) > 0)


def test_ribs_close_the_wall_and_stand_out_by_their_depth() -> None:
    made = ribs(0.0, 9.0, 0.0, 5.0, pitch_m=0.9, depth_m=0.06)
    assert np.isclose(made[..., 2].max(), 0.06)
    assert np.all(normals(made)[:, 2] > 0)
    np.testing.assert_allclose((made[:, 1, 0] - made[:, 0, 0]).sum(), 9.0)


def test_offset_outline_moves_every_edge_by_its_distance() -> None:
    assert signed_area(offset_outline(RECTANGLE, 1.0)) == pytest.approx(20 * 13)
    assert signed_area(offset_outline(RECTANGLE, np.array([1.0, 0.0, 0.0, 0.0]))) == pytest.approx(18 * 12)


def first_hits(parts: dict[str, Mesh], origin: np.ndarray, direction: np.ndarray) -> np.ndarray:
    """Cosine of each ray (R, 3) and the normal of what it meets first, NaN if nothing."""
    corners = np.concatenate([part.vertices[part.faces] for part in parts.values()]).astype(np.float64)
    u, v = corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0]
    normal = np.cross(u, v)
    cosine = np.full(len(origin), np.nan)
    for ray, (start, along) in enumerate(zip(origin, direction, strict=True)):
        det = -(normal @ along)
        det = np.where(np.abs(det) < 1e-12, np.nan, det)
        away = start - corners[:, 0]
        q = np.cross(away, along)
        a, b = (v * q).sum(axis=1) / det, -(u * q).sum(axis=1) / det
        distance = (normal * away).sum(axis=1) / det
        hit = np.flatnonzero((a >= 0) & (b >= 0) & (a + b <= 1) & (distance > 0))
        if len(hit):
            face = hit[np.argmin(distance[hit])]
            cosine[ray] = normal[face] @ along / np.linalg.norm(normal[face])
    return cosine


@pytest.mark.parametrize("style", STYLES)
def test_a_radar_in_the_street_sees_the_outer_side_of_every_face(style: Style) -> None:
    rng = np.random.default_rng(11)
    middle = RECTANGLE.mean(axis=0)
    for seed in range(3):
        parts = building(RECTANGLE, height_m=HEIGHT_M[style], style=style, rng=np.random.default_rng(seed))
        turn = rng.uniform(0, 2 * np.pi, 150)
        origin = np.c_[
            middle + 30 * np.stack([np.cos(turn), np.sin(turn)], axis=1), rng.uniform(0.3, 4.0, 150)
        ]
        target = np.c_[
            rng.uniform((0, 0), (18, 11), (150, 2)), rng.uniform(0.05, 0.98 * HEIGHT_M[style], 150)
        ]
        cosine = first_hits(parts, origin, target - origin)
        assert not np.isnan(cosine).any()  # no hole that leads through the house
        assert (cosine < 0).all()


@pytest.mark.parametrize(
    ("change", "match"),
    [
        ({"footprint": RECTANGLE[::-1]}, "counter-clockwise"),
        ({"style": "castle"}, "style"),
        ({"height_m": 1.0}, "height_m"),
        ({"facades": [True]}, "facades"),
    ],
)
def test_bad_arguments_are_named(change: dict, match: str) -> None:
    good = {"footprint": RECTANGLE, "style": "house", "height_m": 6.0, "rng": np.random.default_rng(0)}
    arguments = good | change
    with pytest.raises(ValueError, match=match):
        building(arguments.pop("footprint"), **arguments)
