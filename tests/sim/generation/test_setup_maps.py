"""Data sets of maps: direct echoes lie on the map's facades, and the manifest gives the same world again."""

import json
import shutil
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
import shapely
from shapely.geometry import Polygon
from shapely.geometry.base import BaseGeometry

from echoscape.scenes.core.scene import CLASSES
from echoscape.scenes.io.osm.elements.reading import read_map
from echoscape.scenes.io.osm.extract import read_osm
from echoscape.scenes.traffic.plan import TrafficSettings
from echoscape.sim.datasets.files.atomic_write import DatasetError
from echoscape.sim.datasets.files.metadata import manifest_text
from echoscape.sim.datasets.files.truth_npz import read_truth
from echoscape.sim.datasets.scan_folder import open_folder
from echoscape.sim.generation.config import SimulationConfig
from echoscape.sim.generation.config_json import read_config
from echoscape.sim.generation.dataset import write_dataset
from echoscape.sim.generation.manifest import manifest
from echoscape.sim.generation.setup import add_traffic, build_scene
from echoscape.sim.generation.single_scan import scan
from echoscape.sim.sensor.cts350x import CTS350X
from tests.scenes.io.osm.elements.test_projection import east_north
from tests.scenes.io.osm.small_town import FILE

MAP = read_osm(FILE)
FEW = replace(CTS350X, azimuths=100, encoder_per_turn=5600)
CONFIG = SimulationConfig(scene=MAP, seed=2, scans=2, sensor=FEW)


def outlines() -> BaseGeometry:
    """Return the outlines of all buildings of the map, by the geometry of the ellipsoid."""
    osm = read_map(FILE)
    rings = []
    for way in osm.ways.values():
        if "building" in way.tags or not way.tags:  # the ways of the school's multipolygon have no tags
            nodes = [osm.nodes[node] for node in way.nodes]
            points = [east_north(MAP.origin_deg, node.lat_deg, node.lon_deg) for node in nodes]
            rings.append(Polygon(points).exterior)
    return shapely.union_all(rings)


@pytest.fixture(scope="module")
def made(tmp_path_factory: pytest.TempPathFactory) -> Path:
    out = tmp_path_factory.mktemp("map") / "set"
    write_dataset(out, CONFIG)
    return out


def test_direct_echoes_of_buildings_lie_on_the_facades_of_the_map(made: Path) -> None:
    truth = read_truth(sorted((made / "truth").iterdir())[0])
    codes = open_folder(made).read(0).codes
    cells = truth.cells
    bearing_rad = 2 * np.pi * np.arange(FEW.azimuths) / FEW.azimuths
    wanted = (cells.class_id == CLASSES.index("building")) & (cells.bounces == 1)
    row, bin_number = np.nonzero(wanted & (codes > 90))
    range_m = (bin_number + 0.5) * FEW.bin_m
    heading = truth.pose[row, 3] - bearing_rad[row]
    places = truth.pose[row, :2] + range_m[:, None] * np.stack([np.cos(heading), np.sin(heading)], axis=-1)
    inside = (np.abs(places) < 200.0).all(axis=1)
    assert inside.sum() > 100
    off_m = shapely.distance(outlines(), shapely.points(places[inside]))
    # Bays and gutters stand out by up to 1.6 m; the beam is 1.8 deg wide, half of that to each side.
    assert np.mean(off_m < 1.0 + range_m[inside] * np.deg2rad(0.9)) > 0.95


def test_one_scan_of_a_map_is_that_of_its_data_set(made: Path) -> None:
    found = scan(scene=MAP, seed=2, scans=2, sensor=FEW, index=1)
    assert found == replace(open_folder(made).read(1), truth=found.truth)
    with pytest.raises(ValueError, match="preset must not be given beside a map, got 'town'"):
        scan("town", scene=MAP)


def test_the_manifest_tells_origin_and_hash_but_no_place(made: Path) -> None:
    content = json.loads((made / "echoscape.json").read_text())
    recorded = content["config"]["scene"]
    assert recorded == {
        "file": "small_town.osm",
        "sha256": MAP.sha256,
        "origin_deg": [round(value, 7) for value in MAP.origin_deg],
    }
    assert build_scene(CONFIG).scene.origin_deg == MAP.origin_deg


def test_a_data_set_of_a_map_starts_again_from_its_manifest(tmp_path: Path) -> None:
    (tmp_path / "echoscape.json").write_text(manifest_text(manifest(CONFIG)))
    assert read_config(tmp_path, scene=MAP) == CONFIG
    with pytest.raises(DatasetError, match=r"small_town\.osm is recorded without its folder; give it by"):
        read_config(tmp_path)
    shutil.copy(FILE, tmp_path)
    found = read_config(tmp_path)
    assert replace(found, preset="", scene=MAP) == CONFIG
    assert manifest(found) == manifest(CONFIG)
    (tmp_path / FILE.name).write_text("<osm/>")
    with pytest.raises(DatasetError, match=r"small_town\.osm is not the map of the data set"):
        read_config(tmp_path)


def test_drive_and_traffic_can_be_set_on_a_map() -> None:
    quiet = replace(CONFIG, preset="", traffic=TrafficSettings(vehicles_per_km2=0.0, pedestrians_per_km2=0.0))
    assert quiet.preset == "custom"
    assert not add_traffic(build_scene(quiet), quiet).movers
    assert add_traffic(build_scene(CONFIG), CONFIG).movers
