"""Strict tables: values by type, and messages that name the file, the entry and the key."""

from pathlib import Path
from typing import Any

import pytest

from echoscape.scenes.io.strict_toml import SceneError, Table, read_toml


def _table(**content: Any) -> Table:
    return Table(content, "yard.toml")


def test_values_are_read_by_type_and_absent_ones_by_default() -> None:
    table = _table(
        name="car", solid=True, size=2, place=[1, 2.5], way={"y": 4, "x": 3}, points=[[0, 1], [2, 3]]
    )
    assert table.string("name", allowed=("car", "van")) == "car"
    assert table.string("other", "van") == "van"
    assert table.boolean("solid")
    assert not table.boolean("absent")
    assert table.number("size") == 2.0
    assert table.number("absent", 1.5) == 1.5
    assert table.numbers("place", ("x", "y")) == (1.0, 2.5)
    assert table.numbers("way", ("x", "y")) == (3.0, 4.0)
    assert table.rows("points", ("x", "y")) == ((0.0, 1.0), (2.0, 3.0))
    assert table.tables("absent") == []
    table.reject_unknown_keys()


@pytest.mark.parametrize("value", [True, "2", float("nan"), float("inf"), [1.0]])
def test_what_is_no_finite_number_is_refused(value: object) -> None:
    with pytest.raises(SceneError, match=r"^yard\.toml: size must be a finite number, got"):
        _table(size=value).number("size")
    with pytest.raises(SceneError, match=r"^yard\.toml: size must be \[x, y\], finite numbers, got"):
        _table(size=[1.0, value]).numbers("size", ("x", "y"))
    with pytest.raises(SceneError, match=r"^yard\.toml: size must be \[\[x, y\], \.\.\.\].*; row 2 is"):
        _table(size=[[0, 1], [1.0, value]]).rows("size", ("x", "y"))


@pytest.mark.parametrize(
    ("method", "arguments", "value", "message"),
    [
        ("string", {}, "", "key must be a non-empty string, got ''"),
        ("string", {}, 3, "key must be a non-empty string, got 3"),
        ("string", {"allowed": ("car", "van")}, "bus", "key must be one of car, van, got 'bus'"),
        ("boolean", {}, 1, "key must be true or false, got 1"),
        ("numbers", {"names": ("x", "y")}, [1.0], r"key must be \[x, y\], finite numbers, got \[1.0\]"),
        ("numbers", {"names": ("x", "y")}, {"x": 1.0, "z": 2.0}, "key must have the keys x, y, got x, z"),
        ("rows", {"names": ("x", "y")}, 3, r"key must be \[\[x, y\], \.\.\.\], got 3"),
        ("table", {}, [], r"key must be a table \(\[key\]\), got \[\]"),
        ("tables", {}, {}, r"key must be tables \(\[\[key\]\]\), got \{\}"),
        ("tables", {}, [{}, 2], r"key must be tables \(\[\[key\]\]\), got"),
    ],
)
def test_values_of_another_type_are_refused(
    method: str, arguments: dict, value: object, message: str
) -> None:
    with pytest.raises(SceneError, match=rf"^yard\.toml: {message}"):
        getattr(_table(key=value), method)("key", **arguments)


@pytest.mark.parametrize(
    ("method", "arguments"),
    [("string", {}), ("number", {}), ("numbers", {"names": "xy"}), ("rows", {"names": "xy"}), ("table", {})],
)
def test_missing_keys_are_refused(method: str, arguments: dict) -> None:
    with pytest.raises(SceneError, match=r"^yard\.toml: key is missing$"):
        getattr(_table(), method)("key", **arguments)


def test_nested_tables_have_their_place_in_messages() -> None:
    table = _table(radar={"height": "high"}, object=[{}, {"size": "big"}])
    with pytest.raises(SceneError, match=r"^yard\.toml: radar: height must be a finite number, got 'high'$"):
        table.table("radar").number("height")
    with pytest.raises(SceneError, match=r"^yard\.toml: object 2: size must be a finite number, got 'big'$"):
        table.tables("object")[1].number("size")


def test_unknown_keys_are_refused_with_the_nearest_that_is_allowed() -> None:
    table = _table(widht=1.0, height=2.0)
    assert table.number("height") == 2.0
    assert "width" not in table
    with pytest.raises(SceneError, match=r"'widht'; did you mean width\? allowed: height, width$"):
        table.reject_unknown_keys()
    with pytest.raises(SceneError, match=r"unknown key 'height'; allowed: widht$"):
        table.allow_only(["widht"])


def test_files_that_cannot_be_read_are_refused_by_name(tmp_path: Path) -> None:
    path = tmp_path / "yard.toml"
    with pytest.raises(SceneError, match=r"yard\.toml: cannot be read \(No such file"):
        read_toml(path)
    path.write_text("size = ")
    with pytest.raises(SceneError, match=r"yard\.toml: not valid TOML"):
        read_toml(path)
    path.write_bytes(b"name = '\xff'")
    with pytest.raises(SceneError, match=r"yard\.toml: not valid TOML"):
        read_toml(path)
    path.write_text("size = 'big'")
    with pytest.raises(SceneError, match=r"^yard\.toml: size must be"):
        read_toml(path).number("size")
