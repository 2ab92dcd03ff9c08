"""Laws of towns: nothing stands on a lane, every object has an id and a class, a seed gives one town."""

import numpy as np
import pytest
import shapely
from numpy.typing import NDArray
from scipy.spatial import KDTree

from echoscape.scenes.core.scene import CLASSES, Scene
from echoscape.scenes.town.build import build_town
from echoscape.scenes.town.presets import PRESETS

CLEAR_M = 1.2
LOW_M, HIGH_M = 0.2, 2.5


@pytest.fixture(scope="module")
def town() -> Scene:
    return build_town("town", seed=7)


@pytest.fixture(scope="module", params=["motorway", "open", "empty", "yard"])
def country(request: pytest.FixtureRequest) -> Scene:
    return build_town(request.param, seed=7)


def placed_triangles(town: Scene, row: int) -> NDArray[np.float64]:
    """Return (N, F, 3, 3) the triangles of those placements of one prototype that may reach a lane."""
    prototype, placed = town.prototypes[row], town.placements
    lanes = KDTree(np.concatenate([lane.centre[::4] for lane in town.roads.lanes]))
    reach = np.hypot(*prototype.extent_m[:2]) / 2 * placed.scale + CLEAR_M + 4.0
    rows = (placed.prototype == row) & (lanes.query(placed.position[:, :2])[0] < reach)
    corners = np.concatenate([mesh.vertices[mesh.faces] for mesh in prototype.parts.values()]).astype(float)
    cos, sin = (f(placed.yaw[rows])[:, None, None] for f in (np.cos, np.sin))
    scaled = placed.scale[rows][:, None, None, None] * corners
    turned = np.stack(
        [
            cos * scaled[..., 0] - sin * scaled[..., 1],
            sin * scaled[..., 0] + cos * scaled[..., 1],
            scaled[..., 2],
        ],
        axis=-1,
    )
    return turned + placed.position[rows][:, None, None, :]


def on_lanes(town: Scene, triangles: NDArray[np.float64]) -> NDArray[np.intp]:
    """Return the triangles (F, 3, 3) between the two heights that reach over a lane's clear strip."""
    lanes = [
        shapely.LineString(lane.centre[::2]).buffer(CLEAR_M, cap_style="flat") for lane in town.roads.lanes
    ]
    low, high = triangles[..., 2].min(axis=1), triangles[..., 2].max(axis=1)
    rows = np.flatnonzero((high > LOW_M) & (low < HIGH_M))
    loops = np.atleast_1d(np.asarray(shapely.linestrings(triangles[rows][:, [0, 1, 2, 0], :2])))
    return rows[np.unique(shapely.STRtree(loops).query(lanes, predicate="intersects")[1])]


def check_clear_lanes(town: Scene) -> None:
    for material, mesh in town.static.items():
        hit = on_lanes(town, mesh.vertices[mesh.faces].astype(float))
        classes = {CLASSES[town.instance_class[i]] for i in np.unique(mesh.instance[hit])}
        assert not classes, (material, classes)
    for row, prototype in enumerate(town.prototypes):
        boxes = placed_triangles(town, row)
        if len(boxes):
            hit = on_lanes(town, boxes.reshape(-1, 3, 3))
            assert len(hit) == 0, prototype.name


def check_instances(town: Scene) -> None:
    count = len(town.instance_class)
    static = [np.unique(mesh.instance) for mesh in town.static.values()]
    merged = np.unique(np.concatenate(static))
    placed = town.placements.instance
    assert len(np.unique(placed)) == len(placed)
    assert not set(merged.tolist()) & set(placed.tolist())
    assert sorted([*merged.tolist(), *placed.tolist()]) == list(range(1, count))
    assert town.instance_class[0] == 0
    assert np.all(town.instance_class[1:] > 0)
    assert np.all(town.instance_class < len(CLASSES))
    for row, instance in zip(town.placements.prototype, placed, strict=True):
        assert CLASSES[town.instance_class[instance]] == town.prototypes[row].class_name


def check_alike(first: Scene, second: Scene) -> None:
    for material, mesh in first.static.items():
        np.testing.assert_array_equal(mesh.vertices, second.static[material].vertices)
        np.testing.assert_array_equal(mesh.instance, second.static[material].instance)
    np.testing.assert_array_equal(first.placements.position, second.placements.position)
    np.testing.assert_array_equal(first.instance_class, second.instance_class)
    for lane, other in zip(first.roads.lanes, second.roads.lanes, strict=True):
        np.testing.assert_array_equal(lane.centre, other.centre)


def test_nothing_stands_on_a_lane(town: Scene) -> None:
    check_clear_lanes(town)


def test_nothing_stands_on_a_country_lane(country: Scene) -> None:
    check_clear_lanes(country)


def test_every_object_has_one_id_and_a_class(town: Scene) -> None:
    check_instances(town)


def test_every_country_object_has_one_id_and_a_class(country: Scene) -> None:
    check_instances(country)


def test_a_town_has_objects_of_all_its_classes(town: Scene) -> None:
    present = {CLASSES[number] for number in np.unique(town.instance_class)}
    wanted = "ground road pavement kerb building wall fence hedge tree lamp_post sign bollard bin car van"
    assert present >= set(wanted.split())
    x0, y0, x1, y1 = town.bounds_m
    assert (x1 - x0) * (y1 - y0) > 1.0e6


def test_a_town_has_a_sensible_number_of_objects_and_triangles(town: Scene) -> None:
    faces = np.array([sum(len(mesh.faces) for mesh in p.parts.values()) for p in town.prototypes])
    made = sum(len(mesh.faces) for mesh in town.static.values())
    assert 0.8e6 < made + faces.sum() < 2.5e6  # in memory
    assert 3.0e6 < made + faces[town.placements.prototype].sum() < 9.0e6  # in sight


def test_kerbs_have_their_height(town: Scene) -> None:
    paving = town.static["paving"]
    kerb = town.instance_class[paving.instance] == CLASSES.index("kerb")
    heights = paving.vertices[paving.faces[kerb]][..., 2]
    assert heights.max() == pytest.approx(0.12, abs=1e-6)
    assert heights.min() == pytest.approx(0.0, abs=1e-6)


def test_ground_faces_upwards(town: Scene) -> None:
    for material in ("asphalt", "soil"):
        mesh = town.static[material]
        a, b, c = np.moveaxis(mesh.vertices[mesh.faces].astype(float), 1, 0)
        assert np.all(np.cross(b - a, c - a)[:, 2] > 0)


def test_footpaths_keep_off_roads_and_out_of_buildings(town: Scene) -> None:
    assert len(town.roads.footpaths) > 20
    lines = [shapely.LineString(walk) for walk in town.roads.footpaths]
    lanes = [shapely.LineString(lane.centre[::2]).buffer(1.5) for lane in town.roads.lanes]
    assert shapely.STRtree(lanes).query(lines, predicate="intersects").size == 0
    for mesh in town.static.values():
        houses = mesh.faces[town.instance_class[mesh.instance] == CLASSES.index("building")]
        corners = mesh.vertices[houses].astype(float)
        corners = corners[corners[..., 2].min(axis=1) < 2.0]
        loops = np.atleast_1d(np.asarray(shapely.linestrings(corners[:, [0, 1, 2, 0], :2])))
        assert shapely.STRtree(loops).query(lines, predicate="intersects").size == 0


def test_one_seed_gives_one_town_and_another_seed_another(country: Scene) -> None:
    check_alike(country, build_town(country.preset, seed=7))
    if country.preset != "empty":
        other = build_town(country.preset, seed=8)
        assert not np.array_equal(other.roads.lanes[0].centre, country.roads.lanes[0].centre)


@pytest.mark.slow
def test_one_seed_gives_one_town_with_all_objects(town: Scene) -> None:
    check_alike(town, build_town("town", seed=7))


def test_unknown_presets_are_refused_by_name() -> None:
    with pytest.raises(ValueError, match="town, suburb, industrial, motorway, open, empty, yard, got 'moon'"):
        build_town("moon", seed=0)


@pytest.mark.slow
@pytest.mark.parametrize("preset", sorted(PRESETS))
@pytest.mark.parametrize("seed", range(20, 24))
def test_any_seed_builds_a_valid_town(preset: str, seed: int) -> None:
    built = build_town(preset, seed=seed)
    check_instances(built)
    check_clear_lanes(built)
