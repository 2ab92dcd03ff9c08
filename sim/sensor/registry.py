"""The built-in sensors by name, and custom ones from TOML files with a base, or with all fields.

docs/sensors.md lists the fields. Every error names the file and the field.
"""

import tomllib
from collections.abc import Mapping
from dataclasses import fields
from pathlib import Path
from typing import Any

from echoscape.sim.sensor.cir204 import CIR204
from echoscape.sim.sensor.cir304 import CIR304, CIR304_RT
from echoscape.sim.sensor.cts350x import CTS350X
from echoscape.sim.sensor.cts_small import CTS_SMALL
from echoscape.sim.sensor.sensor import Sensor

SENSORS: Mapping[str, Sensor] = {each.name: each for each in (CTS350X, CIR204, CIR304, CIR304_RT, CTS_SMALL)}
"""The built-in sensors."""

_TABLES = tuple(each.name for each in fields(Sensor) if isinstance(getattr(CTS350X, each.name), tuple))
_WORDS = tuple(each.name for each in fields(Sensor) if isinstance(getattr(CTS350X, each.name), str))
_COUNTS = tuple(each.name for each in fields(Sensor) if isinstance(getattr(CTS350X, each.name), int))


def sensor_from(word: str) -> Sensor:
    """Look up a built-in sensor, or read a custom one.

    Args:
        word: Name of a built-in sensor, or path of a .toml file.

    Returns:
        The sensor.

    Raises:
        ValueError: There is no such sensor, or the file describes none.
    """
    if word.endswith(".toml"):
        return read_sensor(Path(word))
    if word not in SENSORS:
        raise ValueError(f"a sensor must be one of {', '.join(SENSORS)} or a .toml file, got {word!r}")
    return SENSORS[word]


def read_sensor(path: Path) -> Sensor:
    """Read a custom sensor.

    Args:
        path: TOML file with `base = "cts350x"` and the fields that differ, or without a base all fields.

    Returns:
        The sensor.

    Raises:
        ValueError: The file cannot be read, its base is unknown, or a field is unknown, missing, of the wrong
            type or refused; the message names the file and the field.
    """
    content = _toml(Path(path))
    base = content.pop("base", None)
    if base is not None and (not isinstance(base, str) or base not in SENSORS):
        raise ValueError(f"{path}: base must be one of {', '.join(SENSORS)}, got {base!r}")
    names = [each.name for each in fields(Sensor)]
    for name in content:
        if name not in names:
            raise ValueError(f"{path}: {name} is not a field of a sensor")
    values = {} if base is None else {name: getattr(SENSORS[base], name) for name in names}
    try:
        values |= {name: _value(name, value) for name, value in content.items()}
        lacking = [name for name in names if name not in values]
        if lacking:
            raise ValueError(f"{lacking[0]} is missing; give it or a base")
        return Sensor(**values)
    except ValueError as error:
        raise ValueError(f"{path}: {error}") from error


def _toml(path: Path) -> dict[str, Any]:
    try:
        return tomllib.loads(path.read_text(encoding="utf-8"))
    except OSError as error:
        raise ValueError(f"{path}: cannot be read ({error.strerror})") from error
    except (UnicodeDecodeError, tomllib.TOMLDecodeError) as error:
        raise ValueError(f"{path}: not valid TOML ({error})") from error


def _value(name: str, value: Any) -> Any:
    """Return a value of a TOML file as the type of the field `name`, or raise ValueError."""
    if name in _WORDS:
        if not isinstance(value, str):
            raise ValueError(f"{name} must be a word in quotes, got {value!r}")
        return value
    if name in _TABLES:
        if not isinstance(value, list) or not all(isinstance(row, list) and len(row) == 2 for row in value):
            raise ValueError(f"{name} must be a list of [x, y] rows, got {value!r}")
        return tuple((_number(name, x), _number(name, y)) for x, y in value)
    if name in _COUNTS:
        if isinstance(value, bool) or not isinstance(value, int):
            raise ValueError(f"{name} must be a whole number, got {value!r}")
        return value
    return _number(name, value)


def _number(name: str, value: Any) -> float:
    if isinstance(value, bool) or not isinstance(value, (int, float)):
        raise ValueError(f"{name} must be a number, got {value!r}")
    return float(value)
