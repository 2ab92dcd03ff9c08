"""Values of OpenStreetMap tags as numbers: lengths, speeds and counts, None where they cannot be read.

Formats: wiki.openstreetmap.org/wiki/Map_features/Units. What is no number in one of these formats is taken as
not given.
"""

import re

from echoscape.scenes.io.osm.elements.map_data import Tags

_LENGTH = re.compile(r"\s*(\d+(?:[.,]\d+)?)\s*(m|metres?|meters?|ft|feet|')?\s*")
_FEET = re.compile(r"\s*(\d+)\s*(?:'|ft)\s*(\d+(?:\.\d+)?)\s*(?:\"|in)\s*")
_SPEED = re.compile(r"\s*(\d+(?:\.\d+)?)\s*(km/h|kmh|kph|mph|knots)?\s*")
_FOOT_M = 0.3048
_UNIT_MPS = {"mph": 0.44704, "knots": 1852 / 3600}


def length_m(tags: Tags, *keys: str) -> float | None:
    """Read the first length given.

    Args:
        tags: Tags of an element.
        keys: Keys in order of preference.

    Returns:
        The length [m], None where no key holds one.
    """
    for key in keys:
        text = tags.get(key, "")
        if match := _FEET.fullmatch(text):
            return _FOOT_M * (float(match[1]) + float(match[2]) / 12)
        if match := _LENGTH.fullmatch(text):
            metres = float(match[1].replace(",", "."))
            return metres * (_FOOT_M if match[2] in ("ft", "feet", "'") else 1.0)
    return None


def speed_mps(tags: Tags, key: str) -> float | None:
    """Read a speed, in km/h without a unit.

    Args:
        tags: Tags of an element.
        key: The key.

    Returns:
        The speed [m/s], None where none is given.
    """
    match = _SPEED.fullmatch(tags.get(key, ""))
    return float(match[1]) * _UNIT_MPS.get(match[2], 1 / 3.6) if match else None


def count(tags: Tags, key: str) -> float | None:
    """Read a number of lanes or levels.

    Args:
        tags: Tags of an element.
        key: The key.

    Returns:
        The number, None where none is given.
    """
    try:
        value = float(tags.get(key, ""))
    except ValueError:
        return None
    return value if 0 <= value < 1000 else None
