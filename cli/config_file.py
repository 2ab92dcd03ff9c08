"""Options of a command from a TOML file: keys are option names, dotted options are keys in tables.

TOML 1.0 (toml.io). `--artefacts.ghosts 0.5` is `ghosts = 0.5` in the table `[artefacts]`; hyphens and
underscores mean the same, as on the command line. Unknown keys and values of a wrong type are refused.
"""

import types
from collections.abc import Mapping
from dataclasses import fields, is_dataclass
from pathlib import Path
from typing import Annotated, Any, Literal, Union, get_args, get_origin, get_type_hints

import tyro

from echoscape.scenes.io.strict_toml import SceneError, Table, read_toml


class ConfigFileError(ValueError):
    """A configuration file is not valid; the message names the file and the key."""


def words_of_config(kind: type[Any], path: Path) -> list[str]:
    """Read the options in a TOML file as words of the command line.

    Args:
        kind: The options dataclass of the command.
        path: The file.

    Returns:
        The words, such as ["--scans=40", "--artefacts.ghosts=0.5"].

    Raises:
        ConfigFileError: The file cannot be read or is not valid TOML, a key is not an option, or a value has
            another type than the option.
    """
    try:
        return _words(option_types(kind), read_toml(path), "")
    except SceneError as error:
        raise ConfigFileError(str(error)) from error


def option_types(kind: type[Any]) -> dict[str, Any]:
    """List the options of a dataclass that a configuration file can hold.

    Args:
        kind: The options dataclass; positional arguments, hidden fields and `config` itself are left out.

    Returns:
        The type of each option by its name with hyphens, for a group of dotted options a dictionary likewise.
    """
    found: dict[str, Any] = {}
    hints = get_type_hints(kind, include_extras=True)
    for field in fields(kind):
        hint = hints[field.name]
        value, marks = (hint.__origin__, hint.__metadata__) if get_origin(hint) is Annotated else (hint, ())
        if field.name == "config" or tyro.conf.Positional in marks or tyro.conf.Suppress in marks:
            continue
        names = [mark.name for mark in marks if getattr(mark, "name", None) is not None]
        name = names[0] if names else field.name.replace("_", "-")
        if is_dataclass(value) and isinstance(value, type):
            inner = option_types(value)
            found |= inner if name == "" else {name: inner}
        else:
            found[name] = value
    return found


def _words(options: Mapping[str, Any], table: Table, prefix: str) -> list[str]:
    """Return the words of one table; `prefix` is that of its dotted options."""
    content: dict[str, Any] = {}
    for key, value in table.items():
        name = key.replace("_", "-")
        if name in content:
            raise table.error(f"{name} is given twice, with hyphens and with underscores")
        content[name] = value
    table = Table(content, table.place)
    table.allow_only(tuple(options))
    words: list[str] = []
    for name, value in content.items():
        if isinstance(options[name], dict):
            words += _words(options[name], table.table(name), f"{prefix}{name}.")
        else:
            words += _option_words(f"--{prefix}{name}", options[name], value, name, table)
    return words


def _option_words(option: str, kind: Any, value: Any, key: str, table: Table) -> list[str]:
    """Return the words that give `option` a value from the file, whose key is `key`."""
    if kind is bool:
        _check(value, bool, key, table)
        prefix, dot, name = option.removeprefix("--").rpartition(".")
        return [option if value else f"--{prefix}{dot}no-{name}"]
    if get_origin(kind) is not tuple:
        return [f"{option}={_text(value, kind, key, table)}"]
    words = [_text(item, item_kind, key, table) for item, item_kind in _items(value, kind, key, table)]
    for word in words:
        if word.startswith("--"):
            raise table.error(f"{key} must not hold a text that begins with --, got {word!r}")
    return [option, *words]


def _items(value: Any, kind: Any, key: str, table: Table) -> list[tuple[Any, Any]]:
    """Return the entries of an array with the type of each, nested arrays in one list."""
    kinds = get_args(kind)
    if not isinstance(value, list):
        raise table.error(f"{key} must be an array, got {value!r}")
    if len(kinds) == 2 and kinds[1] is Ellipsis:
        kinds = (kinds[0],) * len(value)
    if len(value) != len(kinds):
        raise table.error(f"{key} must be an array of {len(kinds)}, got {value!r}")
    found: list[tuple[Any, Any]] = []
    for item, item_kind in zip(value, kinds, strict=True):
        nested = get_origin(item_kind) is tuple
        found += _items(item, item_kind, key, table) if nested else [(item, item_kind)]
    return found


def _text(value: Any, kind: Any, key: str, table: Table) -> str:
    """Return a value as a word, checked against the type of its option."""
    if get_origin(kind) in (Union, types.UnionType):
        (kind,) = (each for each in get_args(kind) if each is not types.NoneType)
    _check(value, kind, key, table)
    return repr(value) if isinstance(value, float) else str(value)


def _check(value: Any, kind: Any, key: str, table: Table) -> None:
    """Refuse a value of another type than the option's."""
    if get_origin(kind) is Literal:
        choices = get_args(kind)
        if not any(value == choice and type(value) is type(choice) for choice in choices):
            raise table.error(f"{key} must be one of {', '.join(map(str, choices))}, got {value!r}")
        return
    name, allowed = _KINDS[kind]
    if type(value) not in allowed or value == "":
        raise table.error(f"{key} must be {name}, got {value!r}")


_KINDS: Mapping[Any, tuple[str, tuple[type, ...]]] = {
    bool: ("true or false", (bool,)),
    int: ("a whole number", (int,)),
    float: ("a number", (int, float)),
    str: ("a non-empty string", (str,)),
    Path: ("a path", (str,)),
}
"""What messages call a type of option, and the types of TOML values that it takes."""
