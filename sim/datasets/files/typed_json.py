"""Dataclasses from JSON: values are checked against the type hints, and every error names its entry.

Supported types: dataclasses, all of whose fields must be given, tuples, Literal, str, bool, int, float, None
and unions of them. A float field keeps a whole number as it is, so that JSON written from it is the same.
"""

import types
from dataclasses import fields, is_dataclass
from typing import Any, Literal, Union, get_args, get_origin, get_type_hints

from echoscape.sim.datasets.files.atomic_write import DatasetError

_NAMES = {str: "a text", bool: "true or false", int: "a whole number", float: "a number", type(None): "null"}


def from_json(kind: Any, value: Any, name: str) -> Any:
    """Convert a JSON value to a type.

    Args:
        kind: The type, such as a dataclass or `tuple[float, ...]`.
        value: What `json.loads` returned.
        name: Dotted name of the entry, for messages.

    Returns:
        A value of type `kind`.

    Raises:
        DatasetError: A key is unknown or missing, or a value has another type or is refused by its dataclass;
            the message names the entry.
    """
    origin, options = get_origin(kind), get_args(kind)
    if is_dataclass(kind):
        return _dataclass(kind, value, name)
    if origin is Literal:
        if value not in options:
            raise DatasetError(f"{name} must be one of {', '.join(map(repr, options))}, got {_short(value)}")
        return value
    if origin in (Union, types.UnionType):
        return _union(options, value, name)
    if origin is tuple:
        return _tuple(options, value, name)
    return _plain(kind, value, name)


def _dataclass(kind: Any, value: Any, name: str) -> Any:
    if not isinstance(value, dict):
        raise DatasetError(f"{name} must be a table, got {_short(value)}")
    hints, known = get_type_hints(kind), [each.name for each in fields(kind)]
    for key in value:
        if key not in known:
            raise DatasetError(f"{name}.{key} is unknown; {name} has {', '.join(known)}")
    for key in known:
        if key not in value:
            raise DatasetError(f"{name}.{key} is missing")
    settings = {key: from_json(hints[key], entry, f"{name}.{key}") for key, entry in value.items()}
    try:
        return kind(**settings)
    except DatasetError:
        raise
    except (TypeError, ValueError) as error:
        raise DatasetError(f"{name}: {error}") from error


def _union(options: tuple[Any, ...], value: Any, name: str) -> Any:
    """Take the option that fits: null, the dataclass with most keys in common, or the first plain type."""
    if value is None and type(None) in options:
        return None
    rest = [each for each in options if each is not type(None)]
    classes = [each for each in rest if is_dataclass(each)]
    if classes and isinstance(value, dict):
        best = max(classes, key=lambda each: sum(field.name in value for field in fields(each)))
        return from_json(best, value, name)
    if len(rest) == 1:
        return from_json(rest[0], value, name)
    for each in rest:
        try:
            return from_json(each, value, name)
        except DatasetError:
            continue
    raise DatasetError(f"{name} has none of the types it may have, got {_short(value)}")


def _tuple(options: tuple[Any, ...], value: Any, name: str) -> tuple[Any, ...]:
    if not isinstance(value, list):
        raise DatasetError(f"{name} must be a list, got {_short(value)}")
    if len(options) == 2 and options[1] is ...:
        options = (options[0],) * len(value)
    if len(options) != len(value):
        raise DatasetError(f"{name} must have {len(options)} entries, got {len(value)}")
    pairs = zip(options, value, strict=True)
    return tuple(from_json(kind, each, f"{name}[{index}]") for index, (kind, each) in enumerate(pairs))


def _plain(kind: Any, value: Any, name: str) -> Any:
    fits = isinstance(value, (int, float) if kind is float else kind)
    if not fits or (isinstance(value, bool) and kind is not bool):
        raise DatasetError(f"{name} must be {_NAMES.get(kind, kind.__name__)}, got {_short(value)}")
    return value


def _short(value: Any) -> str:
    text = repr(value)
    return text if len(text) <= 60 else f"{text[:57]}..."
