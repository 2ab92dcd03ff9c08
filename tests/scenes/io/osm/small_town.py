"""Makes examples/small_town.osm, a town that does not exist: python -m tests.scenes.io.osm.small_town.

It lies in the North Sea, is drawn here, in metres, and holds nothing of OpenStreetMap's data, so that it is
under the project's own licence. It has every kind of element that the reader knows.
"""

from xml.sax.saxutils import quoteattr

import numpy as np

from echoscape.scenes.io.osm.elements.projection import LocalProjection
from tests.paths import ROOT

FILE = ROOT / "examples" / "small_town.osm"
ORIGIN_DEG = (54.5, 3.5)
HALF_M = (290.0, 230.0)

Point = tuple[float, float]
Tags = dict[str, str]


class Drawing:
    """Elements drawn so far; places that are equal are one node."""

    def __init__(self) -> None:
        self.nodes: dict[Point, int] = {}
        self.node_tags: dict[int, Tags] = {}
        self.ways: list[tuple[int, list[int], Tags]] = []
        self.relations: list[tuple[int, list[tuple[str, int, str]], Tags]] = []
        self._projection = LocalProjection(origin_deg=ORIGIN_DEG)

    def node(self, place: Point, tags: Tags | None = None) -> int:
        """Return the id of the node at a place [m]."""
        key = (round(place[0], 2), round(place[1], 2))
        number = self.nodes.setdefault(key, 1001 + len(self.nodes))
        self.node_tags.setdefault(number, {}).update(tags or {})
        return number

    def way(self, places: list[Point], **tags: str) -> int:
        """Add a line and return its id."""
        number = 501 + len(self.ways)
        spelled = {key.replace("__", ":"): value for key, value in tags.items()}
        self.ways.append((number, [self.node(place) for place in places], spelled))
        return number

    def ring(self, places: list[Point], **tags: str) -> int:
        """Add a closed line and return its id."""
        return self.way([*places, places[0]], **tags)

    def house(
        self, middle: Point, length_m: float, width_m: float, turn_deg: float = 0.0, **tags: str
    ) -> int:
        """Add a rectangular building."""
        cos, sin = np.cos(np.deg2rad(turn_deg)), np.sin(np.deg2rad(turn_deg))
        half = [(x * length_m / 2, y * width_m / 2) for x, y in ((-1, -1), (1, -1), (1, 1), (-1, 1))]
        corners = [(middle[0] + cos * x - sin * y, middle[1] + sin * x + cos * y) for x, y in half]
        return self.ring(corners, **{"building": "yes", **tags})

    def xml(self) -> str:
        """Return the file."""
        west, south, east, north = (-HALF_M[0], -HALF_M[1], *HALF_M)
        edges = self._projection.to_wgs84([[west, 0], [east, 0], [0, south], [0, north]])
        lines = [
            '<?xml version="1.0" encoding="UTF-8"?>',
            "<!-- A town that does not exist, drawn for echoscape. It holds no data of OpenStreetMap. -->",
            '<osm version="0.6" generator="echoscape tests/scenes/io/osm/small_town.py">',
            f' <bounds minlat="{edges[2, 0]:.7f}" minlon="{edges[0, 1]:.7f}" '
            f'maxlat="{edges[3, 0]:.7f}" maxlon="{edges[1, 1]:.7f}"/>',
        ]
        for place, number in self.nodes.items():
            lat, lon = (f"{value:.7f}" for value in self._projection.to_wgs84(place))
            lines += _element("node", f'id="{number}" lat="{lat}" lon="{lon}"', [], self.node_tags[number])
        for number, nodes, tags in self.ways:
            lines += _element("way", f'id="{number}"', [f'<nd ref="{node}"/>' for node in nodes], tags)
        for number, members, tags in self.relations:
            inner = [f'<member type="{kind}" ref="{ref}" role="{role}"/>' for kind, ref, role in members]
            lines += _element("relation", f'id="{number}"', inner, tags)
        return "\n".join([*lines, "</osm>", ""])


def _element(name: str, attributes: str, inner: list[str], tags: Tags) -> list[str]:
    inner = inner + [f"<tag k={quoteattr(key)} v={quoteattr(value)}/>" for key, value in tags.items()]
    if not inner:
        return [f" <{name} {attributes}/>"]
    return [f" <{name} {attributes}>", *(f"  {each}" for each in inner), f" </{name}>"]


def small_town() -> str:
    """Return the file as text."""
    draw = Drawing()
    _roads(draw)
    _houses(draw)
    _large_buildings(draw)
    _land(draw)
    _barriers(draw)
    _objects(draw)
    return draw.xml()


def _circle(middle: Point, radius_m: float, count: int, first: float = 0.0) -> list[Point]:
    angle = first + 2 * np.pi * np.arange(count) / count
    return [
        (float(middle[0] + radius_m * np.cos(each)), float(middle[1] + radius_m * np.sin(each)))
        for each in angle
    ]


def _roads(draw: Drawing) -> None:
    ring = _circle((150.0, 0.0), 15.0, 12)
    draw.ring(ring, highway="secondary", junction="roundabout", lanes="1")
    main = [(-330, -18), (-230, -12), (-150, 0), (-60, 4), (0, 0), (60, -4), ring[6]]
    draw.way(main, highway="secondary", name="Main Street", sidewalk="both", lanes="2", maxspeed="30 mph")
    draw.way([ring[0], (220, 6), (330, 22)], highway="secondary", name="East Road", sidewalk="both")
    draw.way([ring[3], (152, 70), (165, 130), (160, 260)], highway="tertiary", name="North Way", width="7.5")
    draw.way([ring[9], (150, -70), (140, -150), (142, -260)], highway="tertiary", name="Mill Road")
    draw.way([(0, 0), (4, 60), (0, 120), (-6, 180), (-4, 260)], highway="tertiary", name="High Street")
    draw.way([(0, 0), (-4, -60), (0, -130)], highway="residential", name="Station Road")
    draw.way([(0, -130), (60, -138), (140, -150)], highway="residential", name="Quarry Street")
    draw.way(
        [(-150, 0), (-150, -70), (-146, -128), (-80, -134), (0, -130)], highway="residential", name="The Loop"
    )
    draw.way([(0, 120), (60, 126), (165, 130)], highway="residential", name="Church Lane", oneway="yes")
    draw.way(
        [(-150, 0), (-152, 60), (-150, 120), (-70, 122), (0, 120)],
        highway="residential",
        parking__both="lane",
    )
    draw.way([(-146, -128), (-146, -190), (-200, -194)], highway="residential", name="Orchard Close")
    draw.way([(60, -4), (62, -40), (62, -62)], highway="service", service="driveway")
    draw.way([(-230, -12), (-236, -80), (-260, -160)], highway="track")
    draw.way([(-70, 122), (-74, 160), (-120, 200)], highway="footway")


def _houses(draw: Drawing) -> None:
    # Terraces whose houses share their walls, north of Main Street and along High Street.
    for first in (-128.0, -74.0):
        for number in range(5):
            x = first + 9.0 * number
            corners = [(x, 14.0), (x + 9.0, 14.0), (x + 9.0, 24.0), (x, 24.0)]
            draw.ring(corners, building="terrace", building__levels="2", roof__shape="gabled")
    for number in range(6):
        y = 14.0 + 8.5 * number
        corners = [(14.0, y), (24.0, y), (24.0, y + 8.5), (14.0, y + 8.5)]
        draw.ring(corners, building="terrace", building__levels="3")
    for number, y in enumerate((-24.0, -48.0, -72.0, -96.0)):
        draw.house((-165.0, y), 10.0, 8.0, 90.0, building="house", building__levels="2", roof__shape="hipped")
        draw.house((-133.0, y - 4.0), 9.5, 8.5, 92.0, building="house", height=f"{7.5 + 0.5 * number:g}")
        draw.house((-127.0, y - 14.0), 5.0, 3.0, 0.0, building="garage")
    for x in (-120.0, -96.0, -72.0, -48.0, -26.0):
        draw.house(
            (x, -150.0), 11.0, 8.0, -3.0, building="detached", building__levels="1.5", roof__height="3"
        )
        draw.house((x, -115.0), 10.0, 8.0, -2.0)
    for x in (24.0, 48.0, 72.0, 100.0):
        draw.house((x, -156.0), 12.0, 9.0, -7.0, building="semidetached_house", building__levels="2")
    for y in (22.0, 46.0, 72.0, 98.0):
        draw.house((-168.0, y), 9.0, 9.0, 0.0, building="house")
    shape = [(-132.0, 38.0), (-118.0, 38.0), (-118.0, 46.0), (-124.0, 46.0), (-124.0, 54.0), (-132.0, 54.0)]
    draw.ring(shape, building="house", building__levels="2")
    draw.house((-176.0, -176.0), 11.0, 9.0, 4.0, building="bungalow", building__levels="1")
    draw.house((-190.0, -212.0), 11.0, 9.0, 0.0, building="house")


def _large_buildings(draw: Drawing) -> None:
    draw.house(
        (-50.0, -24.0), 52.0, 13.0, -1.0, building="apartments", building__levels="5", roof__shape="flat"
    )
    draw.house((104.0, 28.0), 34.0, 16.0, 2.0, building="office", height="14")
    draw.house((40.0, 150.0), 20.0, 20.0, 3.0, building="apartments", building__levels="12")
    draw.house((206.0, -110.0), 60.0, 32.0, 3.0, building="warehouse", height="9")
    draw.house((204.0, -62.0), 44.0, 24.0, -2.0, building="industrial")
    draw.house((100.0, -64.0), 44.0, 26.0, 1.0, building="supermarket", height="6.5")
    outer = draw.ring([(-112.0, 66.0), (-52.0, 66.0), (-52.0, 106.0), (-112.0, 106.0)])
    inner = draw.ring([(-98.0, 78.0), (-68.0, 78.0), (-68.0, 94.0), (-98.0, 94.0)])
    tags = {"type": "multipolygon", "building": "school", "building:levels": "3"}
    draw.relations.append((901, [("way", outer, "outer"), ("way", inner, "inner")], tags))
    church = [(60, 98), (82, 98), (82, 92), (90, 92), (90, 98), (98, 98), (98, 110), (60, 110)]
    draw.ring([(float(x), float(y)) for x, y in church], building="church", height="13")


def _land(draw: Drawing) -> None:
    draw.ring([(178.0, 40.0), (262.0, 48.0), (258.0, 120.0), (180.0, 116.0)], leisure="park")
    draw.ring(_circle((222.0, 82.0), 19.0, 14), natural="water")
    draw.ring(
        [(-280.0, 40.0), (-196.0, 36.0), (-190.0, 128.0), (-230.0, 190.0), (-280.0, 190.0)], natural="wood"
    )
    draw.ring([(-280.0, -190.0), (-212.0, -186.0), (-206.0, -140.0), (-280.0, -120.0)], landuse="orchard")
    draw.ring([(-280.0, -100.0), (-190.0, -100.0), (-190.0, -34.0), (-280.0, -40.0)], landuse="meadow")
    draw.ring([(66.0, -44.0), (128.0, -43.0), (128.0, -22.0), (66.0, -22.0)], amenity="parking")
    draw.ring([(172.0, -150.0), (246.0, -146.0), (246.0, -40.0), (172.0, -40.0)], landuse="industrial")
    draw.ring([(30.0, 178.0), (120.0, 182.0), (120.0, 222.0), (30.0, 220.0)], natural="scrub")
    draw.way([(290.0, -190.0), (220.0, -176.0), (160.0, -190.0)], waterway="stream", width="3")


def _barriers(draw: Drawing) -> None:
    draw.way([(-190.0, -32.0), (-188.0, -98.0), (-206.0, -138.0)], barrier="hedge")
    draw.way(
        [(176.0, 36.0), (264.0, 44.0), (262.0, 124.0), (176.0, 120.0), (176.0, 36.0)],
        barrier="fence",
        fence_type="railing",
    )
    draw.way(
        [(170.0, -36.0), (250.0, -36.0), (250.0, -152.0), (170.0, -154.0)],
        barrier="fence",
        fence_type="chain_link",
    )
    draw.way([(52.0, 90.0), (52.0, 116.0), (104.0, 117.0)], barrier="wall", height="1.8")
    draw.way([(170.0, 14.0), (214.0, 17.0)], barrier="guard_rail")
    draw.way([(-180.0, 12.0), (-180.0, 112.0)], barrier="hedge", height="1.6")
    draw.way([(-30.0, 108.0), (-32.0, 138.0)], barrier="wall", note="a road runs through it")
    draw.way([(-260.0, -4.0), (-200.0, 2.0)], natural="tree_row")


def _objects(draw: Drawing) -> None:
    for place in ((-46.0, 40.0), (-40.0, 52.0), (-34.0, 38.0), (36.0, 100.0), (45.0, 106.0)):
        draw.node(place, {"natural": "tree"})
    draw.node((190.0, 60.0), {"natural": "tree", "leaf_type": "needleleaved"})
    for place in ((200.0, 66.0), (206.0, 60.0)):
        draw.node(place, {"amenity": "bench"})
    draw.node((2.0, 30.0), {"natural": "tree", "note": "in the middle of High Street"})
    draw.node((80.0, -33.0), {"highway": "street_lamp"})
    draw.node((58.0, 112.0), {"barrier": "bollard"})


if __name__ == "__main__":
    FILE.write_text(small_town())
