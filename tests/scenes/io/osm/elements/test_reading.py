"""Files that are read, in three formats with the same content, and files that are refused in one line."""

import gzip
import json
from pathlib import Path
from typing import Any

import pytest

from echoscape.scenes.io.osm.elements import reading
from echoscape.scenes.io.osm.elements.map_data import OsmMap
from echoscape.scenes.io.osm.elements.reading import read_map
from echoscape.scenes.io.strict_toml import SceneError

XML = """<?xml version="1.0"?>
<osm version="0.6">
 <node id="2" lat="50.001" lon="4.0"/>
 <node id="-1" lat="50.0" lon="4.0"><tag k="natural" v="tree"/></node>
 <way id="7"><nd ref="-1"/><nd ref="2"/><tag k="highway" v="residential"/><tag k="name" v="A &amp; B"/></way>
 <relation id="9"><member type="way" ref="7" role="outer"/><member type="node" ref="5" role=""/></relation>
</osm>
"""
ELEMENTS: list[dict[str, Any]] = [
    {"type": "relation", "id": 9, "members": [
        {"type": "way", "ref": 7, "role": "outer"}, {"type": "node", "ref": 5, "role": ""}]},
    {"type": "way", "id": 7, "nodes": [-1, 2], "tags": {"highway": "residential", "name": "A & B"}},
    {"type": "node", "id": -1, "lat": 50.0, "lon": 4.0, "tags": {"natural": "tree"}},
    {"type": "node", "id": 2, "lat": 50.001, "lon": 4.0},
]  # fmt: skip


def read(folder: Path, text: str | bytes, name: str = "map.osm") -> OsmMap:
    path = folder / name
    path.write_bytes(text.encode() if isinstance(text, str) else text)
    return read_map(path)


def content(osm: OsmMap) -> tuple[Any, ...]:
    return list(osm.nodes.values()), list(osm.ways.values()), list(osm.relations.values()), osm.bounds_deg


def test_all_formats_have_the_same_content(tmp_path: Path) -> None:
    wanted = content(read(tmp_path, XML))
    found_json = json.dumps({"elements": ELEMENTS})
    assert content(read(tmp_path, gzip.compress(XML.encode()), "map.osm.gz")) == wanted
    assert content(read(tmp_path, found_json, "map.json")) == wanted
    assert content(read(tmp_path, gzip.compress(found_json.encode()), "map.json.gz")) == wanted
    assert [node.id for node in wanted[0]] == [-1, 2]
    assert wanted[1][0].nodes == (-1, 2)
    assert wanted[1][0].tags["name"] == "A & B"
    assert wanted[2][0].members == (("way", 7, "outer"), ("node", 5, ""))


def test_ways_with_their_geometry_need_no_nodes(tmp_path: Path) -> None:
    way = {**ELEMENTS[1], "geometry": [{"lat": 50.0, "lon": 4.0}, {"lat": 50.001, "lon": 4.0}]}
    osm = read(tmp_path, json.dumps({"elements": [way]}), "map.json")
    assert osm.nodes[2].lat_deg == 50.001


def test_bounds_of_several_downloads_are_joined(tmp_path: Path) -> None:
    bounds = "".join(
        f'<bounds minlat="{south}" minlon="{west}" maxlat="{south + 1}" maxlon="{west + 2}"/>'
        for south, west in ((49.5, 3.0), (50.0, 2.5))
    )
    osm = read(tmp_path, XML.replace('<osm version="0.6">', f'<osm version="0.6">{bounds}'))
    assert osm.bounds_deg == (49.5, 2.5, 51.0, 5.0)


def test_what_an_editor_has_deleted_is_left_out(tmp_path: Path) -> None:
    extra = '<node id="3" action="delete" lat="1" lon="1"/><node id="4" visible="false"/></osm>'
    assert content(read(tmp_path, XML.replace("</osm>", extra))) == content(read(tmp_path, XML))


NODE = '<node id="3" lat="50" lon="4"/>'


@pytest.mark.parametrize(
    ("text", "says"),
    [
        (XML[:-9], "broken XML"),
        ("", "broken XML"),
        ("<gpx></gpx>", "must be OSM XML, whose first element is osm, got gpx"),
        ("<osm></osm>", "must hold nodes with coordinates"),
        (XML.replace('lat="50.001"', ""), "lat of node 2 must be between -90 and 90 deg, it has none"),
        (XML.replace('lon="4.0"', 'lon="east"'), "must be between -180 and 180 deg, got 'east'"),
        (XML.replace('lat="50.001"', 'lat="91"'), "got '91'"),
        (XML.replace('lat="50.001"', 'lat="nan"'), "got 'nan'"),
        (XML.replace('<nd ref="2"/>', '<nd ref="3"/>'), "way 7 has no coordinates at node 3"),
        (XML.replace('id="7"', 'id="x"'), "id of a way must be a whole number, got 'x'"),
        (XML.replace("</osm>", '<node id="2" lat="51" lon="4"/></osm>'), "node 2 occurs twice"),
        (XML.replace("<osm", "<!DOCTYPE osm>\n<osm"), "must have no document type and no entities"),
        (
            XML.replace("<osm", '<!DOCTYPE osm [<!ENTITY a SYSTEM "file:///etc/passwd">]>\n<osm'),
            "must have no document type and no entities",
        ),
    ],
)
def test_broken_xml_is_refused_by_name(tmp_path: Path, text: str, says: str) -> None:
    with pytest.raises(SceneError, match=r"map\.osm: ") as error:
        read(tmp_path, text)
    assert says in str(error.value)
    assert "\n" not in str(error.value)


@pytest.mark.parametrize(
    ("text", "says"),
    [
        ("{", "broken JSON"),
        ("[" * 100_000, "broken JSON"),
        ("[]", "must be the JSON of Overpass"),
        ('{"elements": [1]}', "must be the JSON of Overpass"),
        ('{"elements": [{"type": "node", "id": 1}]}', "lat of node 1"),
        ('{"elements": [{"type": "node", "id": 1, "lat": 1, "lon": 1, "tags": [2]}]}', "tags of node 1"),
    ],
)
def test_broken_json_is_refused_by_name(tmp_path: Path, text: str, says: str) -> None:
    with pytest.raises(SceneError, match=says):
        read(tmp_path, text, "map.json")


def test_other_files_are_refused(tmp_path: Path) -> None:
    with pytest.raises(SceneError, match=r"map\.pbf: must end with one of \.osm.*osmium cat"):
        read(tmp_path, b"x", "map.pbf")
    with pytest.raises(SceneError, match="broken gzip"):
        read(tmp_path, XML, "map.osm.gz")
    with pytest.raises(SceneError, match="broken gzip"):
        read(tmp_path, gzip.compress(XML.encode())[:-20], "cut.osm.gz")
    with pytest.raises(SceneError, match="No such file"):
        read_map(tmp_path / "absent.osm")
    (tmp_path / "folder.osm").mkdir()
    with pytest.raises(SceneError, match="Is a directory"):
        read_map(tmp_path / "folder.osm")


def test_a_file_that_unfolds_beyond_the_limit_is_refused(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(reading, "MOST_BYTES", 2**20)
    large = XML.replace("</osm>", " " * 2**20 + "</osm>").encode()
    with pytest.raises(SceneError, match="must be at most 1 MiB unpacked"):
        read(tmp_path, gzip.compress(large), "map.osm.gz")
