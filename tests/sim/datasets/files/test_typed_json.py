"""JSON becomes dataclasses of the declared types, or the entry that does not fit is named."""

import json
from dataclasses import asdict, dataclass
from typing import Any, Literal

import pytest
from hypothesis import given
from hypothesis import strategies as st

from echoscape.sim.datasets.files.atomic_write import DatasetError
from echoscape.sim.datasets.files.typed_json import from_json


@dataclass(frozen=True, kw_only=True)
class Inner:
    name: str
    size_m: tuple[float, ...] = ()


@dataclass(frozen=True, kw_only=True)
class Wrapped:
    inner: Inner


@dataclass(frozen=True, kw_only=True)
class Outer:
    count: int
    on: bool
    level: float
    table: tuple[tuple[float, float], ...]
    kind: Literal["a", "b"]
    maybe: Inner | None = None
    either: tuple[Inner | Wrapped, ...] = ()

    def __post_init__(self) -> None:
        if self.count < 0:
            raise ValueError(f"count must be 0 or more, got {self.count}")


NUMBER = st.floats(allow_nan=False, allow_infinity=False) | st.integers(-9, 9)
INNER = st.builds(Inner, name=st.text(), size_m=st.lists(NUMBER).map(tuple))
OUTER = st.builds(
    Outer,
    count=st.integers(0, 2**40),
    on=st.booleans(),
    level=NUMBER,
    table=st.lists(st.tuples(NUMBER, NUMBER)).map(tuple),
    kind=st.sampled_from(["a", "b"]),
    maybe=st.none() | INNER,
    either=st.lists(INNER | st.builds(Wrapped, inner=INNER)).map(tuple),
)


@given(OUTER)
def test_a_dataclass_survives_json_with_the_same_text(value: Outer) -> None:
    text = json.dumps(asdict(value))
    found = from_json(Outer, json.loads(text), "outer")
    assert found == value
    assert json.dumps(asdict(found)) == text


GOOD = asdict(Outer(count=1, on=True, level=2.5, table=((0, 1),), kind="a"))


@pytest.mark.parametrize(
    ("change", "message"),
    [
        ({"count": 1.0}, "outer.count must be a whole number, got 1.0"),
        ({"count": True}, "outer.count must be a whole number, got True"),
        ({"on": 1}, "outer.on must be true or false, got 1"),
        ({"level": "loud"}, "outer.level must be a number, got 'loud'"),
        ({"level": False}, "outer.level must be a number, got False"),
        ({"kind": "c"}, "outer.kind must be one of 'a', 'b', got 'c'"),
        ({"table": [[0, 1], [2]]}, r"outer.table\[1\] must have 2 entries, got 1"),
        ({"table": {}}, "outer.table must be a list, got {}"),
        ({"maybe": 3}, "outer.maybe must be a table, got 3"),
        ({"maybe": {"name": "x"}}, "outer.maybe.size_m is missing"),
        ({"either": [{"inner": {"name": 5, "size_m": []}}]}, r"outer.either\[0\].inner.name must be a text"),
        ({"extra": 1}, "outer.extra is unknown; outer has count, on, level"),
        ({"count": -1}, "outer: count must be 0 or more, got -1"),
    ],
)
def test_the_entry_that_does_not_fit_is_named(change: dict[str, Any], message: str) -> None:
    content = json.loads(json.dumps(GOOD)) | change
    with pytest.raises(DatasetError, match=message):
        from_json(Outer, content, "outer")


@pytest.mark.parametrize("name", GOOD)
def test_every_field_must_be_given(name: str) -> None:
    content = {key: value for key, value in json.loads(json.dumps(GOOD)).items() if key != name}
    with pytest.raises(DatasetError, match=f"outer.{name} is missing"):
        from_json(Outer, content, "outer")
