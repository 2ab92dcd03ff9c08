"""The description of an extract: its origin, its edges, and refusals that name the file."""

from pathlib import Path

import pytest

from echoscape.scenes.io.osm.elements.reading import read_map
from echoscape.scenes.io.osm.extract import plane_of, read_osm
from echoscape.scenes.io.scene_file import is_scene_file, read_scene_file
from echoscape.scenes.io.strict_toml import SceneError
from tests.scenes.io.osm.small_town import FILE, HALF_M, ORIGIN_DEG

DEG_M = 111_132.9
"""Length of a degree of latitude at 50 degrees [m] (Torge, Geodesy, 3rd ed. 2001)."""


def road(folder: Path, *lats: float, tag: str = "residential") -> Path:
    """Write a road through places on one meridian."""
    nodes = "".join(f'<node id="{row}" lat="{lat}" lon="4"/>' for row, lat in enumerate(lats))
    refs = "".join(f'<nd ref="{row}"/>' for row in range(len(lats)))
    path = folder / "road.osm"
    path.write_text(f'<osm>{nodes}<way id="1">{refs}<tag k="highway" v="{tag}"/></way></osm>')
    return path


def test_the_origin_is_the_middle_of_the_bounds() -> None:
    extract = read_osm(FILE)
    assert extract.origin_deg == pytest.approx(ORIGIN_DEG, abs=2e-7)
    _, area = plane_of(read_map(FILE), extract.origin_deg)
    assert area.bounds == pytest.approx((-HALF_M[0], -HALF_M[1], *HALF_M), abs=0.02)


def test_without_bounds_the_map_goes_on_beyond_its_nodes(tmp_path: Path) -> None:
    path = road(tmp_path, 50.0, 50.01)
    _, area = plane_of(read_map(path), read_osm(path).origin_deg)
    assert area.bounds[3] - area.bounds[1] == pytest.approx((0.01 + 0.0008) * DEG_M, rel=1e-3)


def test_nodes_far_out_of_an_extract_do_not_make_it_large(tmp_path: Path) -> None:
    lats = [50.0 + 1e-5 * row for row in range(400)]
    path = road(tmp_path, 49.5, *lats, 50.6)
    _, area = plane_of(read_map(path), read_osm(path).origin_deg)
    assert area.bounds[3] - area.bounds[1] < 600.0


def test_a_map_that_is_too_large_is_refused(tmp_path: Path) -> None:
    with pytest.raises(
        SceneError, match=r"road\.osm: must be at most 5000 m wide and high, got .* m x 6\d\d\d m"
    ):
        read_osm(road(tmp_path, *[50.0 + 0.001 * row for row in range(61)]))


@pytest.mark.parametrize("tag", ["footway", "track", "proposed", "cycleway"])
def test_a_map_without_roads_is_refused(tmp_path: Path, tag: str) -> None:
    with pytest.raises(SceneError, match=r"road\.osm: must hold roads \(ways with highway=residential"):
        read_osm(road(tmp_path, 50.0, 50.001, tag=tag))


def test_the_description_depends_on_the_content_alone(tmp_path: Path) -> None:
    (tmp_path / "other.osm").write_bytes(FILE.read_bytes())
    one, other = read_osm(FILE), read_osm(tmp_path / "other.osm")
    assert (one.sha256, one.origin_deg) == (other.sha256, other.origin_deg)


def test_files_are_told_apart_by_their_names() -> None:
    assert all(map(is_scene_file, ("a.toml", "a.osm", "a.osm.gz", "a.OSM", "a.json")))
    assert not any(map(is_scene_file, ("town", "a.png", "osm")))
    assert read_scene_file(FILE) == read_osm(FILE)
