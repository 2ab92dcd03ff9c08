"""The content of an OpenStreetMap extract: nodes, ways and relations with their tags, in order of their ids.

The data model is that of OpenStreetMap (wiki.openstreetmap.org/wiki/Elements).
"""

from dataclasses import dataclass

Tags = dict[str, str]


@dataclass(frozen=True, kw_only=True)
class Node:
    """A place.

    Attributes:
        id: Its id, negative where it was drawn and not yet uploaded.
        lat_deg: Latitude north, WGS84 [deg].
        lon_deg: Longitude east, WGS84 [deg].
        tags: Its tags.
    """

    id: int
    lat_deg: float
    lon_deg: float
    tags: Tags


@dataclass(frozen=True, kw_only=True)
class Way:
    """A line, or where its ends are one node, a ring.

    Attributes:
        id: Its id.
        nodes: Ids of its nodes in order.
        tags: Its tags.
    """

    id: int
    nodes: tuple[int, ...]
    tags: Tags

    @property
    def is_ring(self) -> bool:
        """Whether the way ends where it starts."""
        return len(self.nodes) > 3 and self.nodes[0] == self.nodes[-1]


@dataclass(frozen=True, kw_only=True)
class Relation:
    """A group of elements.

    Attributes:
        id: Its id.
        members: Kind ("node", "way" or "relation"), id and role of each member.
        tags: Its tags.
    """

    id: int
    members: tuple[tuple[str, int, str], ...]
    tags: Tags


@dataclass(frozen=True, kw_only=True)
class OsmMap:
    """An extract.

    Attributes:
        file: Its path, for messages.
        nodes: Nodes by id, in ascending order of ids.
        ways: Ways by id, in ascending order of ids; every node of a way is in `nodes`.
        relations: Relations by id, in ascending order of ids; members may be missing.
        bounds_deg: South, west, north and east edge of the extract, None where the file has none [deg].
    """

    file: str
    nodes: dict[int, Node]
    ways: dict[int, Way]
    relations: dict[int, Relation]
    bounds_deg: tuple[float, float, float, float] | None
