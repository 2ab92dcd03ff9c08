"""Laws of worlds from maps: what the map shows stands where it shows it; roads are clear and connected."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
import shapely
from numpy.typing import NDArray
from shapely.geometry import LineString, Point, Polygon

from echoscape.scenes.core.scene import CLASSES, Scene
from echoscape.scenes.driving.clearance import first_collision
from echoscape.scenes.driving.ego_drive import EgoDrive, plan_ego_drive
from echoscape.scenes.driving.route import LaneNetwork
from echoscape.scenes.io.osm.build import build_osm_scene
from echoscape.scenes.io.osm.elements.map_data import OsmMap, Way
from echoscape.scenes.io.osm.elements.reading import read_map
from echoscape.scenes.io.osm.extract import read_osm
from echoscape.scenes.io.strict_toml import SceneError
from echoscape.scenes.traffic.plan import plan_traffic
from tests.scenes.io.osm.elements.test_projection import east_north
from tests.scenes.io.osm.small_town import FILE, small_town
from tests.scenes.obstacles import Obstacles

SEED = 5
BUILDING = CLASSES.index("building")
CENTIMETRES_M = 0.03


@pytest.fixture(scope="module")
def town() -> Scene:
    return build_osm_scene(read_osm(FILE), seed=SEED)


@pytest.fixture(scope="module")
def osm() -> OsmMap:
    return read_map(FILE)


@pytest.fixture(scope="module")
def drive(town: Scene) -> EgoDrive:
    return plan_ego_drive(town, seed=SEED, duration_s=120.0)


def line_of(way: Way, osm: OsmMap, town: Scene) -> LineString:
    """Return the line of a way by the geometry of the ellipsoid, apart from the projection under test."""
    assert town.origin_deg is not None
    nodes = [osm.nodes[node] for node in way.nodes]
    return LineString([east_north(town.origin_deg, node.lat_deg, node.lon_deg) for node in nodes])


def ring_of(way: Way, osm: OsmMap, town: Scene) -> Polygon:
    """Return the polygon of a way."""
    return Polygon(line_of(way, osm, town))


def faces_of(town: Scene, class_name: str) -> NDArray[np.float64]:
    """Return the corners (N, 3) of the static faces of a class."""
    wanted = CLASSES.index(class_name)
    parts = [
        mesh.vertices[mesh.faces[town.instance_class[mesh.instance] == wanted]].reshape(-1, 3)
        for mesh in town.static.values()
    ]
    return np.concatenate(parts).astype(float)


def walls_of(town: Scene) -> dict[int, NDArray[np.float64]]:
    """Return the corners (N, 3) of all static faces of each building, by instance."""
    found: dict[int, list[NDArray[np.float64]]] = {}
    for mesh in town.static.values():
        for instance in np.unique(mesh.instance[town.instance_class[mesh.instance] == BUILDING]).tolist():
            faces = mesh.faces[mesh.instance == instance]
            found.setdefault(instance, []).append(mesh.vertices[faces].reshape(-1, 3).astype(float))
    return {instance: np.concatenate(parts) for instance, parts in found.items()}


@pytest.fixture(scope="module")
def by_way(town: Scene, osm: OsmMap) -> dict[int, tuple[Polygon, NDArray[np.float64]]]:
    """Return the footprint on the map and the corners of the faces of each building, by way."""
    walls = walls_of(town)
    middles = {instance: Point(corners[:, :2].mean(axis=0)) for instance, corners in walls.items()}
    found = {}
    for way in osm.ways.values():
        if "building" in way.tags:
            ring = ring_of(way, osm, town)
            inside = [each for each, middle in middles.items() if ring.buffer(0.5).contains(middle)]
            assert len(inside) == 1, way.id
            found[way.id] = ring, walls[inside[0]]
    return found


def test_every_building_has_the_footprint_of_the_map(
    by_way: dict[int, tuple[Polygon, NDArray[np.float64]]],
) -> None:
    assert len(by_way) > 40
    for ring, corners in by_way.values():
        # The foot of the walls; doors, sills, ribs and bays stand out by less than a metre.
        foot = corners[corners[:, 2] < 0.01][:, :2]
        for corner in ring.exterior.coords:
            assert np.hypot(*(foot - corner).T).min() < CENTIMETRES_M
        hull = shapely.MultiPoint(foot).convex_hull
        assert ring.buffer(1.7).contains(hull if ring.convex_hull.equals(ring) else Point(foot.mean(axis=0)))


def test_walls_lie_on_the_edges_of_the_map(
    town: Scene, osm: OsmMap, by_way: dict[int, tuple[Polygon, NDArray[np.float64]]]
) -> None:
    for way, (ring, corners) in by_way.items():
        at_foot = corners[corners[:, 2] < 0.01][:, :2]
        on_edge = shapely.distance(ring.exterior, shapely.points(at_foot)) < CENTIMETRES_M
        assert on_edge.any(), way
        edges = zip(ring.exterior.coords[:-1], ring.exterior.coords[1:], strict=True)
        for edge in (LineString(pair) for pair in edges):
            along = [edge.project(Point(place), normalized=True) for place in at_foot[on_edge]
                     if edge.distance(Point(place)) < CENTIMETRES_M]  # fmt: skip
            assert min(along) < 0.01
            assert max(along) > 0.99


def test_the_courtyard_of_a_multipolygon_is_open(town: Scene, osm: OsmMap) -> None:
    (relation,) = osm.relations.values()
    outer, inner = (ring_of(osm.ways[ref], osm, town) for _, ref, _ in relation.members)
    block = outer.difference(inner)
    roofs = []
    for mesh in town.static.values():
        corners = mesh.vertices[mesh.faces[town.instance_class[mesh.instance] == BUILDING]].astype(float)
        level = (np.ptp(corners[..., 2], axis=1) < 1e-3) & (corners[..., 2].min(axis=1) > 8.0)
        roofs += [Polygon(each) for each in corners[level][..., :2]]
    covered = shapely.union_all([each for each in roofs if each.intersects(outer)]).buffer(0.01)
    assert covered.intersection(inner.buffer(-0.5)).area == pytest.approx(0.0, abs=1.0)
    assert covered.intersection(block).area > 0.9 * block.area


def heights_of(tags: dict[str, str], by_way: dict, osm: OsmMap) -> list[float]:
    return [
        float(by_way[way.id][1][:, 2].max())
        for way in osm.ways.values()
        if "building" in way.tags and tags.items() <= way.tags.items()
    ]


def test_heights_follow_the_map(osm: OsmMap, by_way: dict[int, tuple[Polygon, NDArray[np.float64]]]) -> None:
    # Flat roofs: levels of 3 m and a parapet of up to a metre; plant on the roof is up to 2.6 m high.
    (apartments,) = heights_of({"building": "apartments", "building:levels": "5"}, by_way, osm)
    (tower,) = heights_of({"building": "apartments", "building:levels": "12"}, by_way, osm)
    assert 15.0 < apartments < 15.0 + 2.7
    assert 36.0 < tower < 36.0 + 2.7
    # A pitched roof ends at the height of the map, its tiles 0.12 m higher; chimneys stand 1.3 m above it.
    (hall,) = heights_of({"building": "warehouse", "height": "9"}, by_way, osm)
    assert hall == pytest.approx(9.0, abs=0.15)
    houses = heights_of({"building": "house", "height": "8"}, by_way, osm)
    assert all(7.95 < house < 8.0 + 1.45 for house in houses)
    # 1.5 levels of 3 m and a roof of 3 m.
    cottages = heights_of({"building": "detached"}, by_way, osm)
    assert len(cottages) == 5
    assert all(7.45 < cottage < 7.5 + 1.45 for cottage in cottages)


def test_heights_that_the_map_does_not_say_are_drawn_for_each_building(
    osm: OsmMap, by_way: dict[int, tuple[Polygon, NDArray[np.float64]]]
) -> None:
    silent = [
        float(by_way[way.id][1][:, 2].max())
        for way in osm.ways.values()
        if way.tags == {"building": "yes"} or way.tags == {"building": "house"}
    ]
    assert len(silent) > 8
    assert len(set(silent)) == len(silent)


def test_no_wall_stands_on_a_lane(town: Scene) -> None:
    lanes = [LineString(lane.centre[::2]).buffer(lane.width_m / 2) for lane in town.roads.lanes]
    road = shapely.union_all(lanes)
    shapely.prepare(road)
    low = ("building", "wall", "fence", "hedge")
    for mesh in town.static.values():
        wanted = np.isin(town.instance_class[mesh.instance], [CLASSES.index(name) for name in low])
        corners = mesh.vertices[mesh.faces[wanted]].astype(float)
        corners = corners[corners[..., 2].min(axis=1) < 2.5]
        assert not shapely.intersects_xy(road, *corners.reshape(-1, 3)[:, :2].T).any()


def test_nothing_placed_stands_on_a_lane(town: Scene) -> None:
    # What arms and crowns reach over is 2.5 m high; a van that passes is 2.1 m wide.
    parts = []
    for lane in town.roads.lanes:
        centre = lane.centre[::8]
        heading = np.arctan2(*np.gradient(centre, axis=0).T[::-1])
        parts.append(np.stack([*centre.T, np.zeros(len(centre)), heading], axis=-1))
    pose = np.concatenate(parts)
    touched = Obstacles(town, near=pose[:, :2]).touched(pose, (1.0, 2.1, 2.4))
    assert not touched.any(), CLASSES[town.instance_class[touched.max()]]


def test_every_lane_can_be_reached_from_every_other(town: Scene) -> None:
    assert LaneNetwork(town.roads).connected.all()
    assert [lane.id for lane in town.roads.lanes] == list(range(len(town.roads.lanes)))


def test_lanes_follow_the_roads_of_the_map(town: Scene, osm: OsmMap) -> None:
    # Gaussian smoothing with 4 m shortens a right angle by 0.56 x 4 m; a lane lies 1.5 m beside the middle,
    # and roundabouts and turnarounds leave the line.
    lines = []
    for way in osm.ways.values():
        if way.tags.get("highway") in ("secondary", "tertiary", "residential"):
            lines.append(line_of(way, osm, town))
    mapped = shapely.union_all(lines)
    for lane in town.roads.lanes:
        if lane.kind == "street":
            assert max(mapped.distance(Point(place)) for place in lane.centre[::10]) < 1.8 + 2.3
    driven = shapely.union_all([LineString(lane.centre) for lane in town.roads.lanes])
    for name in ("Main Street", "The Loop", "Church Lane", "Orchard Close"):
        (way,) = [way for way in osm.ways.values() if way.tags.get("name") == name]
        middle = line_of(way, osm, town).interpolate(0.5, normalized=True)
        assert driven.distance(middle) < 4.0, name


def test_one_way_streets_are_driven_one_way(town: Scene) -> None:
    # Church Lane leads from (0, 120) to (165, 130).
    along = [
        lane.centre[-1] - lane.centre[0]
        for lane in town.roads.lanes
        if lane.kind == "street" and LineString(lane.centre).distance(Point(90.0, 127.0)) < 4.0
    ]
    assert len(along) == 1
    assert along[0][0] > 50.0


def test_the_drive_keeps_to_its_lane_and_hits_nothing(town: Scene, drive: EgoDrive) -> None:
    assert first_collision(town, drive.trajectory, until_s=120.0, height_m=2.0) is None
    poses = drive.pose(np.linspace(0.0, 120.0, 600))
    lanes = shapely.union_all([LineString(town.roads.lanes[each].centre) for each in drive.route.lanes])
    assert shapely.distance(lanes, shapely.points(poses[:, :2])).max() < 0.9
    assert not Obstacles(town, near=poses[:, :2]).touched(poses, (4.8, 2.0, 1.8)).any()


def test_traffic_and_people_move_clear_of_what_stands(town: Scene, drive: EgoDrive) -> None:
    movers = plan_traffic(town, drive, seed=SEED)
    kinds = {mover.prototype.class_name for mover in movers}
    assert {"car", "pedestrian"} <= kinds
    times = np.linspace(0.0, 30.0, 31)
    moving = [(mover, mover.track.pose(times)) for mover in movers]
    moving = [(mover, pose) for mover, pose in moving if np.ptp(pose[:, :2], axis=0).max() > 1.0]
    obstacles = Obstacles(town, near=np.concatenate([pose[:, :2] for _, pose in moving]))
    for mover, pose in moving:
        touched = obstacles.touched(pose, mover.prototype.extent_m, shrink_m=0.05)
        assert not touched.any(), (mover.prototype.name, CLASSES[town.instance_class[touched.max()]])


def test_woods_water_and_barriers_are_where_the_map_has_them(town: Scene, osm: OsmMap) -> None:
    trees = np.flatnonzero(town.instance_class[town.placements.instance] == CLASSES.index("tree"))
    places = town.placements.position[trees, :2]
    for way in osm.ways.values():
        if way.tags.get("natural") == "wood":
            wood = ring_of(way, osm, town)
            assert shapely.contains_xy(wood, places).sum() > 0.5 * wood.area / 5.5**2
        if way.tags.get("natural") == "water":
            pond = ring_of(way, osm, town)
            assert not shapely.contains_xy(pond, places).any()
            water = town.static["water"]
            faces = shapely.polygons(water.vertices[water.faces][..., :2].astype(float))
            wet = shapely.intersection(pond, faces)
            assert shapely.area(wet).sum() == pytest.approx(pond.area, rel=1e-3)
    assert town.origin_deg is not None
    for node in osm.nodes.values():
        if node.tags.get("natural") == "tree":
            place = east_north(town.origin_deg, node.lat_deg, node.lon_deg)
            stands = "note" not in node.tags  # of the one that the map has on a road
            assert (np.hypot(*(places - place).T).min() < CENTIMETRES_M) == stands
    for way in osm.ways.values():
        if way.tags.get("barrier") in ("hedge", "wall", "fence") and "note" not in way.tags:
            line = line_of(way, osm, town)
            class_name = way.tags["barrier"]
            corners = faces_of(town, class_name)
            # Hedges bulge by 0.45 m, pillars of walls by 0.2 m; roads and buildings may interrupt a barrier.
            near = shapely.dwithin(line, shapely.points(corners[:, :2]), 0.6)
            along = shapely.line_locate_point(line, shapely.points(corners[near][:, :2]), normalized=True)
            assert len(np.unique((10 * along).astype(int))) >= 9, way.id
            if "height" in way.tags:
                assert corners[near][:, 2].max() == pytest.approx(float(way.tags["height"]) + 0.12, abs=0.1)


def test_all_around_something_stands_within_sight(town: Scene, drive: EgoDrive) -> None:
    upright = ~np.isin(town.instance_class[town.placements.instance], [0])
    places = town.placements.position[upright, :2]
    for pose in drive.pose(np.linspace(0.0, 120.0, 9)):
        away = places - pose[:2]
        reach = np.hypot(*away.T)
        sector = np.floor(np.arctan2(away[:, 1], away[:, 0]) / np.deg2rad(30.0)).astype(int)
        assert len(np.unique(sector[(reach > 100.0) & (reach < 300.0)])) == 12


def same(one: Scene, other: Scene) -> bool:
    arrays = [
        (getattr(a, name), getattr(b, name))
        for material in one.static
        for a, b in ((one.static[material], other.static[material]),)
        for name in ("vertices", "faces", "instance")
    ]
    arrays += [
        (getattr(one.placements, name), getattr(other.placements, name)) for name in vars(one.placements)
    ]
    arrays += [(a.centre, b.centre) for a, b in zip(one.roads.lanes, other.roads.lanes, strict=True)]
    arrays += [(a, b) for a, b in zip(one.roads.footpaths, other.roads.footpaths, strict=True)]
    return set(one.static) == set(other.static) and all(np.array_equal(a, b) for a, b in arrays)


def shuffled(text: str) -> str:
    """Return OSM XML with its elements in another order."""
    head, *rest = text.split("\n <")
    bounds, elements = rest[0], rest[1:]
    elements[-1] = elements[-1].replace("</osm>", "").rstrip()
    joined: list[str] = []
    for each in elements:  # closing tags belong to the element before
        if each.startswith("/"):
            joined[-1] += "\n <" + each.rstrip()
        else:
            joined.append(each.rstrip())
    order = np.random.default_rng(3).permutation(len(joined))
    return "\n <".join([head, bounds.rstrip(), *(joined[row] for row in order)]) + "\n</osm>\n"


def test_a_seed_gives_the_same_world_whatever_the_order_of_the_file(town: Scene, tmp_path: Path) -> None:
    mixed = shuffled(FILE.read_text())
    (tmp_path / "mixed.osm").write_text(mixed)
    assert mixed.find('<way id="501"') != FILE.read_text().find('<way id="501"')
    assert same(build_osm_scene(read_osm(tmp_path / "mixed.osm"), seed=SEED), town)


def test_another_seed_gives_another_world(town: Scene) -> None:
    other = build_osm_scene(read_osm(FILE), seed=SEED + 1)
    assert len(other.placements.yaw) != len(town.placements.yaw)


def test_one_more_building_changes_no_other(town: Scene, tmp_path: Path) -> None:
    """What is drawn for an element depends on its id alone."""
    text = FILE.read_text()
    far = '<node id="90001" lat="54.4986" lon="3.4962"/><node id="90002" lat="54.4986" lon="3.4963"/>'
    far += '<node id="90003" lat="54.4987" lon="3.4963"/>'
    refs = "".join(f'<nd ref="{node}"/>' for node in (90001, 90002, 90003, 90001))
    way = f'<way id="90001">{refs}<tag k="building" v="shed"/></way></osm>'
    (tmp_path / "more.osm").write_text(text.replace("</osm>", far + way))
    more = build_osm_scene(read_osm(tmp_path / "more.osm"), seed=SEED)
    before, after = walls_of(town), walls_of(more)
    kept = {corners.tobytes() for corners in after.values()}
    assert sum(corners.tobytes() in kept for corners in before.values()) == len(before)
    assert len(after) == len(before) + 1


def test_the_example_is_what_its_script_draws() -> None:
    assert FILE.read_text() == small_town()


def test_a_map_without_a_road_to_turn_on_is_refused(tmp_path: Path) -> None:
    path = tmp_path / "stub.osm"
    nodes = '<node id="1" lat="50" lon="4"/><node id="2" lat="50.0001" lon="4"/>'
    way = '<way id="1"><nd ref="1"/><nd ref="2"/><tag k="highway" v="residential"/></way>'
    path.write_text(f"<osm>{nodes}{way}</osm>")
    with pytest.raises(SceneError, match=r"stub\.osm: must hold a road with space to turn round"):
        build_osm_scene(read_osm(path), seed=0)


def test_a_changed_file_is_refused(tmp_path: Path) -> None:
    path = tmp_path / "town.osm"
    path.write_text(FILE.read_text())
    extract = read_osm(path)
    path.write_text(FILE.read_text().replace("Main Street", "High Road"))
    with pytest.raises(SceneError, match=r"town\.osm: changed since"):
        build_osm_scene(extract, seed=0)
    with pytest.raises(SceneError, match="changed since"):
        build_osm_scene(replace(read_osm(path), sha256="0"), seed=0)
