"""TOML tables read strictly: each key is asked for by name and kind; one that nobody asked for is an error.

TOML 1.0 (toml.io) through the standard library; messages name the file, the entry and the key.
"""

import difflib
import math
import tomllib
from collections.abc import ItemsView, Sequence
from pathlib import Path
from typing import Any


class SceneError(ValueError):
    """A scene, a target or a file that describes them is not what it should be; the message names it."""


class Table:
    """One table of a TOML file; `place` is what messages call it, such as "yard.toml: object 2"."""

    def __init__(self, content: dict[str, Any], place: str) -> None:
        self._content = content
        self._known: list[str] = []
        self.place = place

    def __contains__(self, key: str) -> bool:
        self._known.append(key)
        return key in self._content

    def items(self) -> ItemsView[str, Any]:
        """Return the keys and values as they stand in the file."""
        return self._content.items()

    def fault(self, message: str) -> SceneError:
        """Return the error that tells `message` of this table."""
        return SceneError(f"{self.place}: {message}")

    def text(self, key: str, default: str | None = None, *, allowed: Sequence[str] = ()) -> str:
        """Return a string, one of `allowed` if that is given; without `default` the key must be there."""
        value = self._value(key, default)
        if not isinstance(value, str) or not value:
            raise self.fault(f"{key} must be a text, got {value!r}")
        if allowed and value not in allowed:
            raise self.fault(f"{key} must be one of {', '.join(allowed)}, got {value!r}")
        return value

    def flag(self, key: str) -> bool:
        """Return true or false; false where the key is absent."""
        value = self._value(key, False)
        if not isinstance(value, bool):
            raise self.fault(f"{key} must be true or false, got {value!r}")
        return value

    def number(self, key: str, default: float | None = None) -> float:
        """Return a finite number; without `default` the key must be there."""
        value = self._value(key, default)
        if not _is_number(value):
            raise self.fault(f"{key} must be a finite number, got {value!r}")
        return float(value)

    def numbers(self, key: str, names: Sequence[str]) -> tuple[float, ...]:
        """Return as many finite numbers as `names`: an array in their order, or a table with these keys."""
        value = self._value(key, None)
        if isinstance(value, dict):
            if set(value) != set(names):
                raise self.fault(f"{key} must have the keys {', '.join(names)}, got {', '.join(value)}")
            value = [value[name] for name in names]
        if not isinstance(value, list) or len(value) != len(names) or not all(map(_is_number, value)):
            raise self.fault(f"{key} must be [{', '.join(names)}], finite numbers, got {value!r}")
        return tuple(float(number) for number in value)

    def rows(self, key: str, names: Sequence[str]) -> tuple[tuple[float, ...], ...]:
        """Return an array of arrays of finite numbers, each as long as `names`."""
        value = self._value(key, None)
        shape = f"[[{', '.join(names)}], ...]"
        if not isinstance(value, list):
            raise self.fault(f"{key} must be {shape}, got {value!r}")
        for i, row in enumerate(value):
            if not isinstance(row, list) or len(row) != len(names) or not all(map(_is_number, row)):
                raise self.fault(f"{key} must be {shape}, finite numbers; its row {i + 1} is {row!r}")
        return tuple(tuple(float(number) for number in row) for row in value)

    def table(self, key: str) -> "Table":
        """Return a table within this one."""
        value = self._value(key, None)
        if not isinstance(value, dict):
            raise self.fault(f"{key} must be a table ([{key}]), got {value!r}")
        return Table(value, f"{self.place}: {key}")

    def tables(self, key: str) -> list["Table"]:
        """Return the tables of an array of tables, none where the key is absent."""
        value = self._value(key, [])
        if not isinstance(value, list) or not all(isinstance(row, dict) for row in value):
            raise self.fault(f"{key} must be tables ([[{key}]]), got {value!r}")
        return [Table(row, f"{self.place}: {key} {i + 1}") for i, row in enumerate(value)]

    def finish(self) -> None:
        """Refuse a key that nobody asked for.

        Raises:
            SceneError: there is one; the message names it, the one that may have been meant, and all others.
        """
        self.expect(self._known)

    def expect(self, keys: Sequence[str]) -> None:
        """Refuse a key that is none of `keys`, so that a misspelt one is told before what lacks without it.

        Raises:
            SceneError: there is one; see `finish`.
        """
        allowed = list(dict.fromkeys(keys))
        for key in self._content:
            if key not in allowed:
                near = difflib.get_close_matches(key, allowed, 1)
                hint = f"did you mean {near[0]}? " if near else ""
                raise self.fault(f"unknown key {key!r}; {hint}allowed: {', '.join(allowed)}")

    def _value(self, key: str, default: object) -> Any:
        self._known.append(key)
        value = self._content.get(key, default)
        if value is None:
            raise self.fault(f"{key} is missing")
        return value


def read_toml(path: Path) -> Table:
    """Return the outermost table of a TOML file.

    Raises:
        SceneError: it cannot be read, or is no TOML.
    """
    try:
        return Table(tomllib.loads(path.read_text(encoding="utf-8")), path.name)
    except OSError as error:
        raise SceneError(f"{path}: cannot be read ({error.strerror})") from error
    except (tomllib.TOMLDecodeError, UnicodeDecodeError) as error:
        raise SceneError(f"{path}: no TOML ({error})") from error


def _is_number(value: object) -> bool:
    return isinstance(value, (int, float)) and not isinstance(value, bool) and math.isfinite(value)
