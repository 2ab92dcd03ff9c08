"""Records come back equal, to dtype, memory order and shared parts; damaged and foreign data are refused."""

import hashlib
import json
import math
import tracemalloc
from collections.abc import Callable
from dataclasses import dataclass, fields, is_dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra import numpy as hnp
from numpy.typing import NDArray

from echoscape.sim.datasets.files.record_file import MAGIC, RecordError, record_bytes, record_of

KEY = "town of seed 7"


@dataclass(frozen=True, kw_only=True)
class Part:
    values: NDArray[np.float32]
    name: str = ""


@dataclass(frozen=True, kw_only=True)
class LongPart(Part):
    more: tuple[float, ...] = ()


@dataclass(frozen=True, kw_only=True)
class Whole:
    parts: tuple[Part | LongPart, ...]
    by_name: dict[str, Part]
    number: float | int | None = None
    count: float = 1.0
    listed: list[bool] | None = None

    def __post_init__(self) -> None:
        if self.count < 0:
            raise ValueError(f"count must be 0 or more, got {self.count}")


@dataclass(frozen=True)
class Stranger:
    value: int = 1


def same(first: Any, second: Any) -> bool:
    """Whether two values are equal in types, values and the memory order of arrays; NaN equals NaN."""
    if type(first) is not type(second):
        return False
    if isinstance(first, np.ndarray):
        orders = [(each.flags.c_contiguous, each.flags.f_contiguous) for each in (first, second)]
        contiguous = all(map(any, orders))
        values = first.dtype == second.dtype and first.shape == second.shape
        return values and first.tobytes() == second.tobytes() and (orders[0] == orders[1] or not contiguous)
    if isinstance(first, dict):
        return list(first) == list(second) and all(same(first[name], second[name]) for name in first)
    if isinstance(first, (tuple, list)):
        return len(first) == len(second) and all(map(same, first, second))
    if is_dataclass(first):
        return all(same(getattr(first, each.name), getattr(second, each.name)) for each in fields(first))
    if isinstance(first, (float, np.inexact)):
        return np.array(first).tobytes() == np.array(second).tobytes()
    return first == second


def read(data: bytes, kind: Any = Whole, key: str = KEY) -> Any:
    return record_of(bytearray(data), kind, key=key)


def whole() -> Whole:
    part = Part(values=np.arange(6, dtype=np.float32).reshape(2, 3), name="first")
    return Whole(parts=(part, LongPart(values=np.ones(2, np.float32), more=(1.5,))), by_name={"again": part})


_DTYPES = st.one_of(
    hnp.boolean_dtypes(),
    hnp.integer_dtypes(endianness="<"),
    hnp.unsigned_integer_dtypes(endianness="<"),
    hnp.floating_dtypes(endianness="<", sizes=(32, 64)),
    hnp.complex_number_dtypes(endianness="<", sizes=(64, 128)),
)
_ARRAYS = hnp.arrays(_DTYPES, hnp.array_shapes(min_dims=0, max_dims=3, min_side=0, max_side=4)).flatmap(
    lambda array: st.sampled_from(
        [array, np.asfortranarray(array), array.T, array[::-1] if array.ndim else array]
    )
)
_NUMBERS = st.one_of(
    st.none(),
    st.integers(),
    st.floats(allow_nan=False),
    st.just(math.nan),
    st.floats(width=32, allow_nan=False).map(np.float32),
    st.floats().map(np.float64),
    st.integers(0, 255).map(np.uint8),
)
_PARTS = st.builds(Part, values=_ARRAYS, name=st.text()) | st.builds(
    LongPart, values=_ARRAYS, more=st.lists(st.floats(allow_nan=False)).map(tuple)
)
_WHOLES = st.builds(
    Whole,
    parts=st.lists(_PARTS, max_size=4).map(tuple),
    by_name=st.dictionaries(st.text(max_size=3), _PARTS, max_size=3),
    number=_NUMBERS,
    count=st.floats(0, 1e300),
    listed=st.none() | st.lists(st.booleans()),
)


@given(_WHOLES, st.text())
def test_any_record_comes_back_equal(record: Whole, key: str) -> None:
    assert same(read(record_bytes(record, Whole, key=key), key=key), record)


def test_equal_records_have_equal_bytes() -> None:
    assert record_bytes(whole(), Whole, key=KEY) == record_bytes(whole(), Whole, key=KEY)


def test_what_occurs_twice_is_stored_once_and_comes_back_as_one() -> None:
    big = Part(values=np.zeros(10_000, np.float32))
    data = record_bytes(Whole(parts=(big, big, replace(big)), by_name={"x": big}), Whole, key=KEY)
    found = read(data)
    assert found.parts[0] is found.parts[1] is found.by_name["x"]
    assert found.parts[2] is not found.parts[0]
    assert found.parts[2].values is found.parts[0].values
    assert len(data) < 41_500


def test_arrays_can_be_written_to() -> None:
    assert read(record_bytes(whole(), Whole, key=KEY)).parts[0].values.flags.writeable


@pytest.mark.parametrize(
    ("value", "name"),
    [
        (Stranger(), "Stranger"),
        (Path("x"), "PosixPath"),
        (b"x", "bytes"),
        (np.array(["text"]), "<U4"),
        (np.array([None]), "object"),
        (np.ma.masked_array([1.0]), "MaskedArray"),
        (np.zeros(2, ">f4"), ">f4"),
        (np.zeros(2, "M8[s]"), "datetime64"),
        ({1, 2}, "set"),
        (type("Number", (float,), {})(1.0), "Number"),
    ],
)
def test_values_of_other_types_are_refused_by_name(value: Any, name: str) -> None:
    with pytest.raises(RecordError, match=name):
        record_bytes(Whole(parts=(), by_name={}, number=value), Whole, key=KEY)


@given(st.data())
def test_a_changed_byte_is_noticed_wherever_it_is(data: st.DataObject) -> None:
    content = bytearray(record_bytes(whole(), Whole, key=KEY))
    place = data.draw(st.integers(0, len(content) - 1))
    content[place] ^= data.draw(st.integers(1, 255))
    with pytest.raises(RecordError):
        record_of(content, Whole, key=KEY)


@given(st.data())
def test_cut_and_lengthened_files_are_noticed(data: st.DataObject) -> None:
    content = record_bytes(whole(), Whole, key=KEY)
    with pytest.raises(RecordError):
        read(content[: data.draw(st.integers(0, len(content) - 1))])
    with pytest.raises(RecordError):
        read(content + data.draw(st.binary(min_size=1)))


@given(st.binary(max_size=200))
def test_foreign_bytes_are_refused(content: bytes) -> None:
    for data in (content, MAGIC + content):
        with pytest.raises(RecordError):
            read(data)


def test_another_key_or_type_is_refused() -> None:
    content = record_bytes(whole(), Whole, key=KEY)
    with pytest.raises(RecordError, match="another key"):
        read(content, key="town of seed 8")
    with pytest.raises(RecordError, match=r"an object of type .*Part"):
        read(content, kind=Part)
    with pytest.raises(RecordError, match="holds a Part"):
        read(record_bytes(whole().parts[0], Whole, key=KEY))


def forged(change: Callable[[dict], None]) -> bytes:
    """The file of `whole()` with another header, its sizes and checksum right again."""
    content = record_bytes(whole(), Whole, key=KEY)
    size = int.from_bytes(content[48:56], "little")
    header = json.loads(content[64 : 64 + size])
    change(header)
    text = json.dumps(header).encode()
    start, old = (-(-(64 + each) // 64) * 64 for each in (len(text), size))
    body = text.ljust(start - 64, b"\0") + content[old:]
    sizes = len(text).to_bytes(8, "little") + (64 + len(body)).to_bytes(8, "little")
    return MAGIC + hashlib.sha256(sizes + body).digest() + sizes + body


def array(place: int, entry: Any) -> Callable[[dict], None]:
    return lambda header: header["arrays"][0].__setitem__(place, entry)


def test_a_forged_header_without_a_change_is_read() -> None:
    assert same(read(forged(lambda header: None)), whole())


@pytest.mark.parametrize(
    "change",
    [
        array(0, "|O"),
        array(0, "<U4"),
        array(0, "<f4,<f4"),
        array(0, ["<f4"]),
        array(1, [-2, -3]),
        array(1, [2.0, 3.0]),
        array(1, [True, 3]),
        array(1, [2, 4_000_000_000_000]),
        array(1, [2**62, 2**62]),
        array(1, [0, 2**70]),
        array(1, "23"),
        array(2, "A"),
        array(3, -64),
        array(3, 10**9),
        array(3, None),
        lambda header: header.pop("arrays"),
        lambda header: header.pop("key"),
        lambda header: header.update(root={"object": 99}),
        lambda header: header.update(root={"object": -1}),
        lambda header: header.update(root={"array": True}),
        lambda header: header.update(root={"module": 0}),
        lambda header: header.update(root={"object": 0, "array": 0}),
        lambda header: header.update(root=[1, 2]),
        lambda header: header.update(root=None),
        lambda header: header["objects"].insert(0, header["objects"][-1]),
        lambda header: header["objects"][0].__setitem__(0, "subprocess.Popen"),
        lambda header: header["objects"][0].__setitem__(0, "pathlib.Path"),
        lambda header: header["objects"][0].__setitem__(0, f"{__name__}.Stranger"),
        lambda header: header["objects"][0][1].pop("name"),
        lambda header: header["objects"][0][1].update(other=1),
        lambda header: header["objects"][-1][1].update(count=-1.0),
        lambda header: header["objects"][-1][1].update(by_name={"dict": [[{"list": []}, 1]]}),
    ],
)
def test_a_header_that_lies_is_refused(change: Callable[[dict], None]) -> None:
    with pytest.raises(RecordError):
        read(forged(change))


def test_a_deeply_nested_header_is_refused() -> None:
    text = b'{"key":' + b"[" * 100_000
    body = text.ljust(-(-(64 + len(text)) // 64) * 64 - 64, b"\0")
    sizes = len(text).to_bytes(8, "little") + (64 + len(body)).to_bytes(8, "little")
    with pytest.raises(RecordError):
        read(MAGIC + hashlib.sha256(sizes + body).digest() + sizes + body)


def test_no_memory_is_taken_for_arrays_that_are_not_there() -> None:
    data = forged(array(1, [2, 500_000_000]))
    tracemalloc.start()
    try:
        with pytest.raises(RecordError, match="longer than the file"):
            read(data)
        assert tracemalloc.get_traced_memory()[1] < 1e6
    finally:
        tracemalloc.stop()
