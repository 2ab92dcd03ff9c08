"""Buildings of which the map says little: styles by kind and size, party walls, odd footprints."""

import numpy as np
import pytest
import shapely
from hypothesis import assume, given, settings
from hypothesis import strategies as st
from numpy.typing import NDArray
from shapely.geometry import Polygon, box
from shapely.geometry.base import BaseGeometry

from echoscape.scenes.core.scene import Mesh
from echoscape.scenes.io.osm.buildings import building_parts
from echoscape.scenes.io.osm.elements.footprints import Shape
from echoscape.scenes.io.osm.mapped_building import MappedBuilding, is_building, mapped_buildings

EVERYWHERE = box(-1e3, -1e3, 1e3, 1e3)
NOWHERE = Polygon()


def shape(polygon: BaseGeometry, number: int = 1, /, **tags: str) -> Shape:
    spelled = {key.replace("__", ":"): value for key, value in {"building": "yes", **tags}.items()}
    whole = shapely.orient_polygons(polygon)
    assert isinstance(whole, Polygon)
    return Shape(kind=1, id=number, part=0, polygon=whole, tags=spelled)


def mapped(*shapes: Shape) -> list[MappedBuilding]:
    return mapped_buildings(list(shapes), rng_of=lambda each: np.random.default_rng(each.id))


def meshes(polygon: BaseGeometry, neighbours: BaseGeometry = NOWHERE, /, **tags: str) -> dict[str, Mesh]:
    (one,) = mapped(shape(polygon, **tags))
    return building_parts(one, neighbours, visible=EVERYWHERE, rng=np.random.default_rng(0))


def corners(parts: dict[str, Mesh]) -> NDArray[np.float64]:
    return np.concatenate([part.vertices[part.faces].reshape(-1, 3) for part in parts.values()]).astype(float)


@pytest.mark.parametrize(
    ("polygon", "tags", "style"),
    [
        (box(0, 0, 10, 9), {}, "house"),
        (box(0, 0, 30, 30), {}, "block"),
        (box(0, 0, 80, 50), {}, "hall"),
        (box(0, 0, 4, 3), {}, "hall"),
        (box(0, 0, 10, 9), {"building": "apartments"}, "block"),
        (box(0, 0, 20, 19), {"building": "apartments", "building__levels": "14"}, "tower"),
        (box(0, 0, 10, 9), {"building": "residential"}, "house"),
        (box(0, 0, 40, 12), {"building": "residential"}, "block"),
    ],
)
def test_styles(polygon: Polygon, tags: dict[str, str], style: str) -> None:
    assert mapped(shape(polygon, **tags))[0].style == style


def test_houses_that_share_a_wall_are_a_terrace() -> None:
    found = mapped(shape(box(0, 0, 8, 9), 1), shape(box(8, 0, 16, 9), 2), shape(box(30, 0, 38, 9), 3))
    assert [each.style for each in found] == ["terrace", "terrace", "house"]


def test_a_building_mapped_twice_stands_once() -> None:
    assert len(mapped(shape(box(0, 0, 20, 20), 1), shape(box(0, 0, 20, 20), 2))) == 1
    assert len(mapped(shape(box(0, 0, 20, 20), 1), shape(box(5, 5, 9, 9), 2))) == 1


@pytest.mark.parametrize(
    "tags",
    [{"building": "no"}, {"building": "roof"}, {"min_height": "4"}, {"building:min_level": "1"},
     {"layer": "-1"}, {"location": "underground"}],
)  # fmt: skip
def test_what_does_not_stand_on_the_ground_is_left_out(tags: dict[str, str]) -> None:
    assert not is_building({"building": "yes", **tags})


def test_party_walls_have_no_windows() -> None:
    alone = meshes(box(0, 0, 9, 9), building="house", building__levels="2")
    beside = meshes(
        box(0, 0, 9, 9),
        shapely.union_all([box(-9, 0, 0, 9), box(9, 0, 18, 9)]),
        building="house",
        building__levels="2",
    )
    panes = [corners({"glass": parts["glass"]}) for parts in (alone, beside)]
    assert panes[0][:, 0].min() < 0.5 < panes[1][:, 0].min()


@given(
    st.lists(st.tuples(st.floats(0.0, 2 * np.pi), st.floats(3.0, 20.0)), min_size=4, max_size=12),
    st.sampled_from(["yes", "house", "apartments", "warehouse"]),
    st.integers(1, 12),
)
@settings(max_examples=60, deadline=None)
def test_any_footprint_is_built_with_finite_walls_on_it(
    spikes: list[tuple[float, float]], kind: str, levels: int
) -> None:
    angle, reach = np.array(sorted(spikes)).T
    star = Polygon(np.stack([reach * np.cos(angle), reach * np.sin(angle)], axis=-1))
    # As `shapes_of` makes footprints.
    whole = shapely.get_parts(shapely.make_valid(star).simplify(0.005))
    parts = [each for each in whole if isinstance(each, Polygon) and each.is_valid]
    polygon = max(parts, key=lambda each: each.area, default=None)
    assume(polygon is not None and polygon.area > 4.0)
    assert polygon is not None
    made = corners(meshes(polygon, building=kind, building__levels=str(levels)))
    assert np.isfinite(made).all()
    # Bays, awnings, canopies and docks stand out by 1.6 m; mitred gutters and parapets of sharp corners more.
    foot = made[made[:, 2] < 0.01][:, :2]
    assert shapely.distance(polygon, shapely.points(foot)).max() < 1.7
    for corner in polygon.exterior.coords:
        assert np.hypot(*(foot - corner).T).min() < 0.02
    assert made[:, 2].max() > min(3.0 * levels, 9.0) * 0.99


def test_a_footprint_with_two_courtyards_is_built_around_both() -> None:
    holes = [box(5, 5, 15, 15), box(25, 5, 35, 15)]
    polygon = box(0, 0, 40, 20).difference(shapely.union_all(holes))
    made = meshes(polygon, building="school", building__levels="3")
    level = []
    for part in made.values():
        faces = part.vertices[part.faces].astype(float)
        flat = faces[(np.ptp(faces[..., 2], axis=1) < 1e-3) & (faces[..., 2].min(axis=1) > 8.5)]
        level += [Polygon(each[:, :2]) for each in flat]
    roof = shapely.union_all(level)
    assert roof.intersection(shapely.union_all(holes)).area < 80.0 * 0.1  # courses stand out by 0.08 m
    assert roof.intersection(polygon).area > 0.93 * polygon.area
