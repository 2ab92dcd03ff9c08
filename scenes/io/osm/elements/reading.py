"""Reads extracts of OpenStreetMap: OSM XML, also gzipped, and the JSON of the Overpass API.

XML is parsed as a stream by expat; document types and entities are refused, so that a file can neither name
other files nor unfold without limit (Python's documentation, "XML vulnerabilities").
"""

import gzip
import json
import math
import zlib
from collections.abc import Iterator
from contextlib import nullcontext
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any
from xml.parsers import expat

from echoscape.scenes.io.osm.elements.map_data import Node, OsmMap, Relation, Tags, Way
from echoscape.scenes.io.strict_toml import SceneError

MOST_BYTES = 64 * 2**20
"""Largest size of an extract, unpacked [bytes]."""
SUFFIXES = (".osm", ".osm.gz", ".xml", ".xml.gz", ".json", ".json.gz")
_CHUNK = 2**18
_EXPORT = (
    "export it with all nodes of its ways, as (._;>;); in Overpass or --strategy complete_ways of osmium"
)


def is_osm_file(path: str | Path) -> bool:
    """Check by its name whether a file is an extract of OpenStreetMap.

    Args:
        path: The file.

    Returns:
        Whether its name ends as that of an extract.
    """
    return str(path).lower().endswith(SUFFIXES)


def read_map(path: Path) -> OsmMap:
    """Read an extract.

    Args:
        path: An .osm or .xml file, or the JSON of the Overpass API; also gzipped.

    Returns:
        The map.

    Raises:
        SceneError: The file cannot be read, is too large, broken or of another kind, holds an element twice,
            or lacks coordinates; the message names file and element.
    """
    if not is_osm_file(path):
        hint = "; convert it with osmium cat -o map.osm" if path.suffix == ".pbf" else ""
        raise SceneError(f"{path}: must end with one of {', '.join(SUFFIXES)}{hint}")
    found = _Elements(str(path))
    try:
        if path.name.lower().removesuffix(".gz").endswith(".json"):
            _read_json(path, found)
        else:
            _read_xml(path, found)
    except expat.ExpatError as error:
        raise SceneError(f"{path}: broken XML ({error})") from error
    except (EOFError, gzip.BadGzipFile, zlib.error) as error:
        raise SceneError(f"{path}: broken gzip ({error})") from error
    except OSError as error:
        raise SceneError(f"{path}: {error.strerror or error}") from error
    return found.map()


@dataclass
class _Elements:
    """The elements found so far, those deleted in an editor left out."""

    file: str
    nodes: dict[int, Node] = field(default_factory=dict)
    ways: dict[int, Way] = field(default_factory=dict)
    relations: dict[int, Relation] = field(default_factory=dict)
    bounds: list[tuple[float, float, float, float]] = field(default_factory=list)

    def error(self, message: str) -> SceneError:
        """Return an error that names the file."""
        return SceneError(f"{self.file}: {message}")

    def number(self, text: Any, what: str, most: float) -> float:
        """Return a coordinate, which must lie between -`most` and `most` [deg]."""
        try:
            value = float(text)
        except (TypeError, ValueError):
            value = math.nan
        if not abs(value) <= most:
            given = "it has none" if text is None else f"got {text!r}"
            raise self.error(f"{what} must be between -{most:g} and {most:g} deg, {given}")
        return value

    def id_of(self, text: Any, what: str) -> int:
        """Return an id."""
        try:
            return int(text)
        except (TypeError, ValueError):
            raise self.error(f"{what} must be a whole number, got {text!r}") from None

    def add_node(self, attributes: dict[str, Any], tags: Tags) -> None:
        """Add a node with coordinates `lat` and `lon`."""
        number = self.id_of(attributes.get("id"), "id of a node")
        lat = self.number(attributes.get("lat"), f"lat of node {number}", 90.0)
        lon = self.number(attributes.get("lon"), f"lon of node {number}", 180.0)
        self._add("node", self.nodes, Node(id=number, lat_deg=lat, lon_deg=lon, tags=tags))

    def add_way(self, attributes: dict[str, Any], nodes: list[Any], tags: Tags) -> None:
        """Add a way."""
        number = self.id_of(attributes.get("id"), "id of a way")
        ids = tuple(self.id_of(each, f"a node of way {number}") for each in nodes)
        self._add("way", self.ways, Way(id=number, nodes=ids, tags=tags))

    def add_relation(
        self, attributes: dict[str, Any], members: list[tuple[Any, Any, Any]], tags: Tags
    ) -> None:
        """Add a relation."""
        number = self.id_of(attributes.get("id"), "id of a relation")
        known = tuple(
            (str(kind), self.id_of(ref, f"a member of relation {number}"), str(role or ""))
            for kind, ref, role in members
        )
        self._add("relation", self.relations, Relation(id=number, members=known, tags=tags))

    def add_bounds(self, attributes: dict[str, Any]) -> None:
        """Add the edges of a download."""
        south, north = (
            self.number(attributes.get(key), f"{key} of bounds", 90.0) for key in ("minlat", "maxlat")
        )
        west, east = (
            self.number(attributes.get(key), f"{key} of bounds", 180.0) for key in ("minlon", "maxlon")
        )
        self.bounds.append((south, west, north, east))

    def _add(self, what: str, known: dict[int, Any], element: Any) -> None:
        """Add an element; Overpass may list the same one several times."""
        if known.setdefault(element.id, element) != element:
            raise self.error(f"{what} {element.id} occurs twice with different content")

    def map(self) -> OsmMap:
        """Return the map with its elements in order."""
        for way in self.ways.values():
            missing = next((each for each in way.nodes if each not in self.nodes), None)
            if missing is not None:
                raise self.error(f"way {way.id} has no coordinates at node {missing}; {_EXPORT}")
        if not self.nodes:
            raise self.error("must hold nodes with coordinates, got none")
        return OsmMap(
            file=self.file,
            nodes=dict(sorted(self.nodes.items())),
            ways=dict(sorted(self.ways.items())),
            relations=dict(sorted(self.relations.items())),
            bounds_deg=self._bounds(),
        )

    def _bounds(self) -> tuple[float, float, float, float] | None:
        """Return the edges of all downloads together, None where none is recorded."""
        if not self.bounds:
            return None
        south, west, north, east = zip(*self.bounds, strict=True)
        return min(south), min(west), max(north), max(east)


def _chunks(path: Path) -> Iterator[bytes]:
    """Yield the unpacked content of a file, up to the largest size allowed."""
    size = 0
    is_packed = path.suffix.lower() == ".gz"
    with path.open("rb") as raw, gzip.GzipFile(fileobj=raw) if is_packed else nullcontext(raw) as file:
        while chunk := file.read(_CHUNK):
            size += len(chunk)
            if size > MOST_BYTES:
                raise SceneError(
                    f"{path}: must be at most {MOST_BYTES // 2**20} MiB unpacked; cut out a smaller part"
                )
            yield chunk


def _read_xml(path: Path, found: _Elements) -> None:
    parser = expat.ParserCreate()
    handler = _XmlHandler(found)
    parser.StartElementHandler = handler.start
    parser.EndElementHandler = handler.end
    parser.StartDoctypeDeclHandler = handler.refuse_doctype
    parser.EntityDeclHandler = handler.refuse_doctype
    for chunk in _chunks(path):
        parser.Parse(chunk, False)
    parser.Parse(b"", True)


class _XmlHandler:
    """Collects elements of OSM XML (wiki.openstreetmap.org/wiki/OSM_XML)."""

    def __init__(self, found: _Elements) -> None:
        self._found = found
        self._depth = 0
        self._element: dict[str, str] = {}
        self._tags: Tags = {}
        self._nodes: list[str | None] = []
        self._members: list[tuple[str | None, str | None, str | None]] = []

    def start(self, name: str, attributes: dict[str, str]) -> None:
        """Begin an element."""
        self._depth += 1
        if self._depth == 1 and name != "osm":
            raise self._found.error(f"must be OSM XML, whose first element is osm, got {name}")
        if name in ("node", "way", "relation") and self._depth == 2:
            self._element, self._tags, self._nodes, self._members = attributes, {}, [], []
        elif name == "tag" and self._depth == 3:
            self._tags[attributes.get("k", "")] = attributes.get("v", "")
        elif name == "nd":
            self._nodes.append(attributes.get("ref"))
        elif name == "member":
            self._members.append((attributes.get("type"), attributes.get("ref"), attributes.get("role")))
        elif name == "bounds":
            self._found.add_bounds(attributes)

    def end(self, name: str) -> None:
        """End an element."""
        self._depth -= 1
        if self._depth != 1 or self._element.get("action") == "delete":
            return
        if self._element.get("visible") == "false":
            return
        if name == "node":
            self._found.add_node(self._element, self._tags)
        elif name == "way":
            self._found.add_way(self._element, self._nodes, self._tags)
        elif name == "relation":
            self._found.add_relation(self._element, self._members, self._tags)

    def refuse_doctype(self, *_: Any) -> None:
        """Refuse a document type or an entity."""
        raise self._found.error("must have no document type and no entities")


def _read_json(path: Path, found: _Elements) -> None:
    """Read what Overpass answers to [out:json] (wiki.openstreetmap.org/wiki/Overpass_API)."""
    try:
        content = json.loads(b"".join(_chunks(path)))
    except (ValueError, RecursionError) as error:
        raise SceneError(f"{path}: broken JSON ({error})") from error
    elements = content.get("elements") if isinstance(content, dict) else None
    if not isinstance(elements, list) or not all(isinstance(each, dict) for each in elements):
        raise SceneError(f"{path}: must be the JSON of Overpass, a table with a list of elements")
    for each in elements:
        _add_json(each, found)


def _add_json(element: dict[str, Any], found: _Elements) -> None:
    """Add an element of Overpass; with "out geom" ways bring the coordinates of their nodes."""
    given = element.get("tags") or {}
    if not isinstance(given, dict):
        raise found.error(f"tags of {element.get('type')} {element.get('id')} must be a table")
    tags = {str(key): str(value) for key, value in given.items()}
    if element.get("type") == "node":
        found.add_node(element, tags)
    elif element.get("type") == "way":
        nodes = element.get("nodes") or []
        for node, place in zip(nodes, element.get("geometry") or [], strict=False):
            if node not in found.nodes and isinstance(place, dict):
                found.add_node({"id": node, **place}, {})
        found.add_way(element, nodes, tags)
    elif element.get("type") == "relation":
        members = [
            (each.get("type"), each.get("ref"), each.get("role"))
            for each in element.get("members") or []
            if isinstance(each, dict)
        ]
        found.add_relation(element, members, tags)
