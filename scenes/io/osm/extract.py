"""An OpenStreetMap extract as part of a configuration: its file, hash and origin, checked but not yet built.

The world depends on the content of the file, not on its path.
"""

import hashlib
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray
from shapely.geometry import Polygon

from echoscape.scenes.io.osm.elements.map_data import OsmMap
from echoscape.scenes.io.osm.elements.projection import LocalProjection
from echoscape.scenes.io.osm.elements.reading import read_map
from echoscape.scenes.io.osm.streets.road_types import is_driven
from echoscape.scenes.io.strict_toml import SceneError

LARGEST_M = 5000.0
"""Largest width and height of an extract [m]."""
_DIGITS = 7
_MARGIN_DEG = 0.0004
_FAR_PERCENT = 1.0
_EARTH_M = 6_371_000.0


@dataclass(frozen=True, kw_only=True)
class OsmExtract:
    """An extract of OpenStreetMap.

    Attributes:
        folder: Folder of the file.
        file: Name of the file.
        sha256: Hash of the file when it was described.
        origin_deg: Latitude and longitude of the origin of the world, WGS84 [deg].
    """

    folder: Path
    file: str
    sha256: str
    origin_deg: tuple[float, float]

    @property
    def path(self) -> Path:
        """Path of the file."""
        return self.folder / self.file


def read_osm(path: str | Path) -> OsmExtract:
    """Read an extract of OpenStreetMap and check that it has roads.

    OpenStreetMap's data are under the ODbL: name "OpenStreetMap contributors" where you show what you make of
    them (openstreetmap.org/copyright).

    Args:
        path: OSM XML (.osm) or the JSON of the Overpass API, also gzipped.

    Returns:
        Its description, for `SimulationConfig(scene=...)`, `echoscape.scan` and `build_osm_scene`.

    Raises:
        SceneError: The file cannot be read, is broken or too large, lacks coordinates or has no roads; the
            message names it.
    """
    path = Path(path)
    osm = read_map(path)
    if not any(is_driven(way.tags) for way in osm.ways.values()):
        raise SceneError(f"{path}: must hold roads (ways with highway=residential and the like), got none")
    south, west, north, east = _edges_deg(osm)
    origin = (round((south + north) / 2, _DIGITS), round((west + east) / 2, _DIGITS))
    plane_of(osm, origin)
    return OsmExtract(
        folder=path.parent.absolute(), file=path.name, sha256=file_sha256(path), origin_deg=origin
    )


def read_extract_map(extract: OsmExtract) -> OsmMap:
    """Read the map of an extract.

    Args:
        extract: The extract.

    Returns:
        The map.

    Raises:
        SceneError: The file has changed since it was described, or cannot be read.
    """
    if file_sha256(extract.path) != extract.sha256:
        raise SceneError(f"{extract.path}: changed since its description was read")
    return read_map(extract.path)


def plane_of(osm: OsmMap, origin_deg: tuple[float, float]) -> tuple[dict[int, NDArray[np.float64]], Polygon]:
    """Project a map into the plane.

    Args:
        osm: The map.
        origin_deg: Latitude and longitude of the origin [deg].

    Returns:
        Place of every node (2,) by its id [m], and the area of the map.

    Raises:
        SceneError: The map is wider than `LARGEST_M`.
    """
    projection = LocalProjection(origin_deg=origin_deg)
    nodes = list(osm.nodes.values())
    points = projection.to_plane([each.lat_deg for each in nodes], [each.lon_deg for each in nodes])
    places = {each.id: point for each, point in zip(nodes, points, strict=True)}
    south, west, north, east = _edges_deg(osm)
    corners = projection.to_plane([south, south, north, north], [west, east, east, west])
    area = Polygon(corners)
    width, height = (high - low for low, high in zip(area.bounds[:2], area.bounds[2:], strict=True))
    if max(width, height) > LARGEST_M:
        raise SceneError(
            f"{osm.file}: must be at most {LARGEST_M:.0f} m wide and high, "
            f"got {width:.0f} m x {height:.0f} m; cut a smaller part out of it, as osmium extract --bbox does"
        )
    return places, area


def _edges_deg(osm: OsmMap) -> tuple[float, float, float, float]:
    """Return the south, west, north and east edge of a map [deg].

    Without recorded bounds these are the edges around its nodes. Roads and outlines that were kept whole may
    reach far out of an extract: where that makes it too large, a hundredth of the nodes on each side is cut.
    """
    if osm.bounds_deg is not None:
        return osm.bounds_deg
    places = np.array([(each.lat_deg, each.lon_deg) for each in osm.nodes.values()])
    edges, margin = np.zeros((2, 2)), np.array([[-_MARGIN_DEG], [_MARGIN_DEG]])
    for cut in (0.0, _FAR_PERCENT):
        edges = np.percentile(places, [cut, 100.0 - cut], axis=0) + margin
        size = np.deg2rad(edges[1] - edges[0]) * _EARTH_M
        if max(size[0], size[1] * np.cos(np.deg2rad(edges[0, 0]))) < LARGEST_M:
            break
    (south, west), (north, east) = edges.tolist()
    return south, west, north, east


def file_sha256(path: Path) -> str:
    """Return the hash of a file.

    Args:
        path: The file.

    Returns:
        Its SHA-256 in hexadecimal digits.

    Raises:
        SceneError: It cannot be read.
    """
    try:
        return hashlib.sha256(path.read_bytes()).hexdigest()
    except OSError as error:
        raise SceneError(f"{path}: {error.strerror or error}") from error
