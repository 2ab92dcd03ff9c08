"""Cross-sections of roads by their class, from the tags highway, lanes, width, oneway, sidewalk and maxspeed.

Defaults are those that the project's towns have, by class (wiki.openstreetmap.org/wiki/Key:highway). Where
the map does not say, kerbside parking is drawn. Narrow roads with two-way traffic keep two narrow lanes.
"""

from dataclasses import replace

import numpy as np

from echoscape.scenes.io.osm.elements.map_data import Tags, Way
from echoscape.scenes.io.osm.elements.tag_values import count, length_m, speed_mps
from echoscape.scenes.roads.street_network import StreetType

LANE_RANGE_M = (2.5, 4.0)
"""Narrowest and widest lane [m]: a van of 2 m needs the first."""
_PARKING_M = 2.5
_PARKING_CHANCE = 0.5
_SPEED_RANGE_MPS = (5.0, 36.0)


def _type(name: str, lanes: int, lane_m: float, pavement_m: float, speed_mps: float) -> StreetType:
    return StreetType(
        name=name,
        lanes=lanes,
        lane_width_m=lane_m,
        parking_m=0.0,
        pavement_m=pavement_m,
        speed_limit_mps=speed_mps,
    )


DRIVEN: dict[str, StreetType] = {
    each.name: each
    for each in (
        _type("motorway", 2, 3.65, 0.0, 31.0),
        _type("motorway_link", 1, 3.65, 0.0, 18.0),
        _type("trunk", 1, 3.65, 2.0, 22.0),
        _type("trunk_link", 1, 3.65, 0.0, 16.0),
        _type("primary", 1, 3.5, 2.6, 13.4),
        _type("primary_link", 1, 3.5, 2.0, 13.4),
        _type("secondary", 1, 3.4, 2.6, 13.4),
        _type("secondary_link", 1, 3.4, 2.0, 13.4),
        _type("tertiary", 1, 3.25, 2.4, 13.4),
        _type("tertiary_link", 1, 3.25, 2.0, 13.4),
        _type("unclassified", 1, 3.0, 2.2, 13.4),
        _type("residential", 1, 2.9, 2.2, 13.4),
        _type("living_street", 1, 2.75, 1.8, 5.6),
        _type("service", 1, 2.6, 0.0, 5.6),
    )
}
"""Defaults of the classes on which the car and the traffic drive."""
UNDRIVEN: dict[str, StreetType] = {
    "track": _type("track", 1, 1.5, 0.0, 5.0),
    "pedestrian": _type("pedestrian", 1, 2.5, 0.0, 5.0),
    "service": _type("service", 1, 2.0, 0.0, 5.0),
}
"""Carriageways on which nothing drives."""
_ONE_WAY_CLASSES = ("motorway", "motorway_link")
_MINOR_SERVICE = ("driveway", "parking_aisle", "drive-through", "emergency_access", "alley")
_NO = ("no", "none", "separate")


def is_driven(tags: Tags) -> bool:
    """Check whether a way is a road on which vehicles drive.

    Args:
        tags: Its tags.

    Returns:
        Whether it is of a driven class, in use, on the ground and open to cars.
    """
    if tags.get("highway") not in DRIVEN or not _is_on_ground(tags):
        return False
    closed = "no" in (tags.get("motor_vehicle"), tags.get("vehicle"), tags.get("motorcar"))
    return not closed and tags.get("service") not in _MINOR_SERVICE


def is_undriven(tags: Tags) -> bool:
    """Check whether a way is a carriageway on which nothing drives.

    Args:
        tags: Its tags.

    Returns:
        Whether it is a track, a pedestrian street, a driveway or the like.
    """
    return tags.get("highway") in UNDRIVEN and not is_driven(tags) and _is_on_ground(tags)


def _is_on_ground(tags: Tags) -> bool:
    return tags.get("tunnel", "no") == "no" and tags.get("area") != "yes"


def is_reversed(tags: Tags) -> bool:
    """Check whether a one-way street is drawn against its traffic.

    Args:
        tags: Its tags.

    Returns:
        Whether oneway is -1.
    """
    return tags.get("oneway") in ("-1", "reverse")


def street_type(way: Way, *, built_up: bool, rng: np.random.Generator) -> StreetType:
    """Return the cross-section of a driven road.

    Args:
        way: The way.
        built_up: Whether buildings stand along it.
        rng: Random generator of this way.

    Returns:
        Its cross-section.
    """
    tags = way.tags
    default = DRIVEN[tags["highway"]]
    oneway = _is_oneway(tags)
    lanes = _lanes(tags, default, oneway=oneway)
    width = length_m(tags, "width:carriageway", "width", "est_width")
    parking = _parking_m(tags, default, built_up=built_up, rng=rng)
    lane = default.lane_width_m
    if width is not None:
        total = lanes * (1 if oneway else 2)
        parking = min(parking, max(width - total * LANE_RANGE_M[0], 0.0) / 2)
        parking = parking if parking > 1.8 else 0.0
        lane = float(np.clip((width - 2 * parking) / total, *LANE_RANGE_M))
    speed = speed_mps(tags, "maxspeed") or default.speed_limit_mps
    return replace(
        default,
        lanes=lanes,
        lane_width_m=lane,
        parking_m=parking,
        pavement_m=_pavement_m(tags, default, built_up=built_up),
        speed_limit_mps=float(np.clip(speed, *_SPEED_RANGE_MPS)),
        oneway=oneway,
    )


def _is_oneway(tags: Tags) -> bool:
    given = tags.get("oneway")
    if given is None:
        ring = tags.get("junction") in ("roundabout", "circular")
        return ring or tags["highway"] in _ONE_WAY_CLASSES
    return given in ("yes", "true", "1", "-1", "reverse")


def _lanes(tags: Tags, default: StreetType, *, oneway: bool) -> int:
    """Return the lanes of each direction, or of all of a one-way street."""
    total = count(tags, "lanes")
    if total is None:
        return default.lanes
    return int(np.clip(total if oneway else total // 2, 1, 4))


def _parking_m(tags: Tags, default: StreetType, *, built_up: bool, rng: np.random.Generator) -> float:
    """Return the width of the parking strips, drawn where the map does not say."""
    drawn = rng.random() < _PARKING_CHANCE
    keys = [key for key in tags if key.startswith(("parking:both", "parking:left", "parking:right"))]
    keys += [key for key in tags if key.startswith("parking:lane")]
    if keys:
        return _PARKING_M if any(tags[key] in ("lane", "parallel", "street_side") for key in keys) else 0.0
    return _PARKING_M if drawn and built_up and default.name == "residential" else 0.0


def _pavement_m(tags: Tags, default: StreetType, *, built_up: bool) -> float:
    given = tags.get("sidewalk", tags.get("sidewalk:both"))
    if given is None:
        return default.pavement_m if built_up else 0.0
    return 0.0 if given in _NO else max(default.pavement_m, 1.8)
