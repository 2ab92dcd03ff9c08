"""Strict reading of TOML tables: keys are read by name and type, and unknown keys are refused.

TOML 1.0 (toml.io) through the standard library. Messages name the file, the entry and the key.
"""

import difflib
import math
import tomllib
from collections.abc import ItemsView, Sequence
from pathlib import Path
from typing import Any


class SceneError(ValueError):
    """A scene, a target or the file that describes it is invalid; the message names it."""


class Table:
    """One table of a TOML file.

    Attributes:
        place: Name of the table in messages, such as "yard.toml: object 2".
    """

    def __init__(self, content: dict[str, Any], place: str) -> None:
        """Wrap the content of a table.

        Args:
            content: Values by key.
            place: Name of the table in messages.
        """
        self._content = content
        self._known: list[str] = []
        self.place = place

    def __contains__(self, key: str) -> bool:
        """Return whether the table has a key, which is then known."""
        self._known.append(key)
        return key in self._content

    def items(self) -> ItemsView[str, Any]:
        """Return all keys and values.

        Returns:
            The items of the table.
        """
        return self._content.items()

    def error(self, message: str) -> SceneError:
        """Make an error about this table.

        Args:
            message: What is wrong.

        Returns:
            The error, whose message begins with the name of the table.
        """
        return SceneError(f"{self.place}: {message}")

    def string(self, key: str, default: str | None = None, *, allowed: Sequence[str] = ()) -> str:
        """Read a string.

        Args:
            key: The key.
            default: Value where the key is absent; None if it is required.
            allowed: Allowed values; empty for any.

        Returns:
            The string.

        Raises:
            SceneError: The key is missing, or its value is no string, is empty, or is not allowed.
        """
        value = self._value(key, default)
        if not isinstance(value, str) or not value:
            raise self.error(f"{key} must be a non-empty string, got {value!r}")
        if allowed and value not in allowed:
            raise self.error(f"{key} must be one of {', '.join(allowed)}, got {value!r}")
        return value

    def boolean(self, key: str) -> bool:
        """Read true or false.

        Args:
            key: The key.

        Returns:
            The value; False where the key is absent.

        Raises:
            SceneError: The value is neither true nor false.
        """
        value = self._value(key, False)
        if not isinstance(value, bool):
            raise self.error(f"{key} must be true or false, got {value!r}")
        return value

    def number(self, key: str, default: float | None = None) -> float:
        """Read a finite number.

        Args:
            key: The key.
            default: Value where the key is absent; None if it is required.

        Returns:
            The number.

        Raises:
            SceneError: The key is missing, or its value is no finite number.
        """
        value = self._value(key, default)
        if not _is_number(value):
            raise self.error(f"{key} must be a finite number, got {value!r}")
        return float(value)

    def numbers(self, key: str, names: Sequence[str]) -> tuple[float, ...]:
        """Read a fixed number of finite numbers, given as an array or as a table with named values.

        Args:
            key: The key.
            names: Names of the numbers, in the order of the array.

        Returns:
            The numbers in that order.

        Raises:
            SceneError: The key is missing, or its value has another shape.
        """
        value = self._value(key, None)
        if isinstance(value, dict):
            if set(value) != set(names):
                raise self.error(f"{key} must have the keys {', '.join(names)}, got {', '.join(value)}")
            value = [value[name] for name in names]
        if not isinstance(value, list) or len(value) != len(names) or not all(map(_is_number, value)):
            raise self.error(f"{key} must be [{', '.join(names)}], finite numbers, got {value!r}")
        return tuple(float(number) for number in value)

    def rows(self, key: str, names: Sequence[str]) -> tuple[tuple[float, ...], ...]:
        """Read an array of arrays of finite numbers.

        Args:
            key: The key.
            names: Names of the numbers of each inner array.

        Returns:
            The inner arrays.

        Raises:
            SceneError: The key is missing, or its value has another shape.
        """
        value = self._value(key, None)
        shape = f"[[{', '.join(names)}], ...]"
        if not isinstance(value, list):
            raise self.error(f"{key} must be {shape}, got {value!r}")
        for i, row in enumerate(value):
            if not isinstance(row, list) or len(row) != len(names) or not all(map(_is_number, row)):
                raise self.error(f"{key} must be {shape}, finite numbers; row {i + 1} is {row!r}")
        return tuple(tuple(float(number) for number in row) for row in value)

    def table(self, key: str) -> "Table":
        """Read a nested table.

        Args:
            key: The key.

        Returns:
            The table.

        Raises:
            SceneError: The key is missing, or its value is no table.
        """
        value = self._value(key, None)
        if not isinstance(value, dict):
            raise self.error(f"{key} must be a table ([{key}]), got {value!r}")
        return Table(value, f"{self.place}: {key}")

    def tables(self, key: str) -> list["Table"]:
        """Read an array of tables.

        Args:
            key: The key.

        Returns:
            The tables; none where the key is absent.

        Raises:
            SceneError: The value is no array of tables.
        """
        value = self._value(key, [])
        if not isinstance(value, list) or not all(isinstance(row, dict) for row in value):
            raise self.error(f"{key} must be tables ([[{key}]]), got {value!r}")
        return [Table(row, f"{self.place}: {key} {i + 1}") for i, row in enumerate(value)]

    def reject_unknown_keys(self) -> None:
        """Refuse keys that have not been read.

        Raises:
            SceneError: There is one; the message names it, the key that may have been meant, and all allowed
                keys.
        """
        self.allow_only(self._known)

    def allow_only(self, keys: Sequence[str]) -> None:
        """Refuse keys other than the given ones, so that a misspelt key is reported before a missing one.

        Args:
            keys: The allowed keys.

        Raises:
            SceneError: There is another; see `reject_unknown_keys`.
        """
        allowed = list(dict.fromkeys(keys))
        for key in self._content:
            if key not in allowed:
                near = difflib.get_close_matches(key, allowed, 1)
                hint = f"did you mean {near[0]}? " if near else ""
                raise self.error(f"unknown key {key!r}; {hint}allowed: {', '.join(allowed)}")

    def _value(self, key: str, default: object) -> Any:
        self._known.append(key)
        value = self._content.get(key, default)
        if value is None:
            raise self.error(f"{key} is missing")
        return value


def read_toml(path: Path) -> Table:
    """Read a TOML file.

    Args:
        path: The file.

    Returns:
        Its top-level table.

    Raises:
        SceneError: It cannot be read or is not valid TOML.
    """
    try:
        return Table(tomllib.loads(path.read_text(encoding="utf-8")), path.name)
    except OSError as error:
        raise SceneError(f"{path}: cannot be read ({error.strerror})") from error
    except (tomllib.TOMLDecodeError, UnicodeDecodeError) as error:
        raise SceneError(f"{path}: not valid TOML ({error})") from error


def _is_number(value: object) -> bool:
    """Return whether a value is a finite number."""
    return isinstance(value, (int, float)) and not isinstance(value, bool) and math.isfinite(value)
