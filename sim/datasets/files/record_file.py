"""Dataclasses with arrays as one file, a JSON header and the arrays, that is read without running any code.

The reader names the type that it expects. Only dataclasses that the type hints of this type lead to are made,
through their constructors. What occurs several times is stored once and comes back as one object.

    16 bytes  `MAGIC`, which holds the number of the format
    32 bytes  SHA-256 of all that follows
     8 bytes  size of the header, little-endian
     8 bytes  size of the file, little-endian
    header    JSON: key, arrays (dtype, shape, order, offset), objects (type, fields) and the root
    arrays    each begins at a multiple of 64 bytes
"""

import hashlib
import json
import math
from collections.abc import Mapping
from dataclasses import fields, is_dataclass
from typing import Any, get_args, get_origin, get_type_hints

import numpy as np
from numpy.typing import NDArray

MAGIC = b"echoscape rec 1\n"
"""First bytes of a file."""

_DIGEST = slice(len(MAGIC), len(MAGIC) + 32)
_HEADER = _DIGEST.stop + 16
_ALIGNMENT = 64
_DTYPES = ("|b1", "|i1", "|u1", "<i2", "<u2", "<i4", "<u4", "<i8", "<u8", "<f4", "<f8", "<c8", "<c16")
_PLAIN = (type(None), bool, int, float, str)


class RecordError(ValueError):
    """A value cannot be stored, or a file is damaged or holds something else; the message says what."""


def record_bytes(record: Any, kind: Any, *, key: str) -> bytes:
    """Encode a record.

    Args:
        record: A dataclass, or a tuple, list or dict of them.
        kind: Its type, such as a dataclass or `tuple[Mover, ...]`.
        key: What the reader must ask for.

    Returns:
        The content of the file, the same for the same record.

    Raises:
        RecordError: The record holds a value of a type that cannot be stored; the message names the type.
    """
    encoder = _Encoder({each: name for name, each in _dataclasses(kind).items()})
    root = encoder.node(record)
    content = {"key": key, "root": root, "objects": encoder.objects}
    header, starts, size = _header(content, encoder.arrays)
    data = bytearray(size)
    data[: len(MAGIC)] = MAGIC
    data[_DIGEST.stop : _HEADER] = len(header).to_bytes(8, "little") + size.to_bytes(8, "little")
    data[_HEADER : _HEADER + len(header)] = header
    for start, array in zip(starts, encoder.arrays, strict=True):
        data[start : start + array.nbytes] = array.tobytes("A")
    data[_DIGEST] = _digest(data)
    return bytes(data)


def record_of(data: bytearray, kind: Any, *, key: str) -> Any:
    """Decode a record.

    Args:
        data: Content of the file. The arrays of the record are views of it.
        kind: Type of the record, as in `record_bytes`.
        key: The key that the file must have.

    Returns:
        The record. Arrays have the memory order in which they were stored.

    Raises:
        RecordError: The data are damaged, of another format, or of another key or type.
    """
    try:
        return _decoded(data, kind, key)
    except RecordError:
        raise
    except (ArithmeticError, LookupError, RecursionError, TypeError, ValueError) as error:
        raise RecordError(f"has a wrong entry ({type(error).__name__}: {error})") from error


def _digest(data: bytes | bytearray) -> bytes:
    return hashlib.sha256(memoryview(data)[_DIGEST.stop :]).digest()


def _dataclasses(kind: Any) -> dict[str, type]:
    """Return the dataclasses that the hints of a type lead to, by module and name."""
    found: dict[str, type] = {}
    waiting = [kind]
    while waiting:
        each = waiting.pop()
        waiting += get_args(each)
        if isinstance(each, type) and is_dataclass(each) and each not in found.values():
            found[f"{each.__module__}.{each.__qualname__}"] = each
            hints = get_type_hints(each)
            waiting += [hints[field.name] for field in fields(each)]
    return found


def _header(content: Mapping[str, Any], arrays: list[NDArray]) -> tuple[bytes, list[int], int]:
    """Return the header, where each array begins, and the size of the file.

    Offsets in the header count from its end, so that its size does not depend on itself.
    """
    offsets, end = [], 0
    for array in arrays:
        offsets.append(end)
        end += -(-array.nbytes // _ALIGNMENT) * _ALIGNMENT
    described = [
        [array.dtype.str, list(array.shape), _order(array), offset]
        for array, offset in zip(arrays, offsets, strict=True)
    ]
    header = json.dumps({**content, "arrays": described}, separators=(",", ":")).encode()
    first = _first_array(len(header))
    return header, [first + offset for offset in offsets], first + end


def _first_array(header_size: int) -> int:
    return -(-(_HEADER + header_size) // _ALIGNMENT) * _ALIGNMENT


def _order(array: NDArray) -> str:
    return "F" if array.flags.f_contiguous and not array.flags.c_contiguous else "C"


class _Encoder:
    """Turns values into JSON, and collects the objects and arrays that they refer to by number."""

    def __init__(self, names: Mapping[type, str]) -> None:
        self.arrays: list[NDArray] = []
        self.objects: list[Any] = []
        self._names = names
        self._seen: dict[int, dict[str, int]] = {}

    def node(self, value: Any) -> Any:
        """Return a value as JSON: plain ones as they are, others as a table of one entry."""
        kind = type(value)
        if kind in _PLAIN:
            return value
        if kind in (tuple, list):
            return {kind.__name__: [self.node(each) for each in value]}
        if kind is dict:
            return {"dict": [[self.node(name), self.node(each)] for name, each in value.items()]}
        if isinstance(value, np.generic):
            return {"scalar": self._add(np.array(value))["array"]}
        if id(value) not in self._seen:
            self._seen[id(value)] = self._add(value) if kind is np.ndarray else self._object(value)
        return self._seen[id(value)]

    def _add(self, array: NDArray) -> dict[str, int]:
        if array.dtype.str not in _DTYPES:
            raise RecordError(f"arrays of {array.dtype} cannot be stored")
        self.arrays.append(array)
        return {"array": len(self.arrays) - 1}

    def _object(self, value: Any) -> dict[str, int]:
        kind = type(value)
        if kind not in self._names:
            raise RecordError(f"{kind.__module__}.{kind.__qualname__} cannot be stored")
        nodes = {field.name: self.node(getattr(value, field.name)) for field in fields(value)}
        self.objects.append([self._names[kind], nodes])
        return {"object": len(self.objects) - 1}


def _decoded(data: bytearray, kind: Any, key: str) -> Any:
    if len(data) < _HEADER or data[: len(MAGIC)] != MAGIC:
        raise RecordError("is not a record of this format")
    header_size, size = (
        int.from_bytes(data[start : start + 8], "little") for start in (_HEADER - 16, _HEADER - 8)
    )
    if size != len(data) or _first_array(header_size) > size or data[_DIGEST] != _digest(data):
        raise RecordError("is damaged")
    header = json.loads(data[_HEADER : _HEADER + header_size])
    if header["key"] != key:
        raise RecordError("has another key")
    view = memoryview(data)[_first_array(header_size) :]
    decoder = _Decoder(_dataclasses(kind), [_array(view, *entry) for entry in header["arrays"]])
    for name, nodes in header["objects"]:
        decoder.add(name, nodes)
    root = decoder.value(header["root"])
    if not isinstance(root, get_origin(kind) or kind):
        raise RecordError(f"holds a {type(root).__name__}")
    return root


def _array(view: memoryview, dtype: str, shape: list[int], order: str, offset: int) -> NDArray:
    """Return an array as a part of `view`, which bounds its size."""
    if dtype not in _DTYPES or order not in ("C", "F"):
        raise RecordError(f"has an array of dtype {dtype!r} and order {order!r}")
    if any(type(each) is not int or each < 0 for each in (*shape, offset)):
        raise RecordError(f"has an array of shape {shape} at {offset}")
    count = math.prod(shape)
    if offset + count * np.dtype(dtype).itemsize > len(view):
        raise RecordError(f"has an array of shape {shape}, which is longer than the file")
    if count == 0:
        return np.zeros(shape, dtype, order)
    return np.frombuffer(view, dtype, count, offset).reshape(shape, order=order)


class _Decoder:
    """Turns JSON back into values; objects refer to earlier ones only, so that they form no circle."""

    def __init__(self, types: Mapping[str, type], arrays: list[NDArray]) -> None:
        self._types = types
        self._arrays = arrays
        self._objects: list[Any] = []

    def add(self, name: str, nodes: Mapping[str, Any]) -> None:
        """Make the next object."""
        if name not in self._types:
            raise RecordError(f"holds an object of type {name!r}")
        kind = self._types[name]
        if nodes.keys() != {field.name for field in fields(kind)}:
            raise RecordError(f"has other fields of {name} than this version")
        self._objects.append(kind(**{field: self.value(node) for field, node in nodes.items()}))

    def value(self, node: Any) -> Any:
        """Return the value of a JSON node."""
        if not isinstance(node, dict):
            if type(node) not in _PLAIN:
                raise RecordError("has a bare list")
            return node
        ((what, inner),) = node.items()
        if what in ("tuple", "list"):
            return (tuple if what == "tuple" else list)(map(self.value, inner))
        if what == "dict":
            return {self.value(name): self.value(each) for name, each in inner}
        if type(inner) is not int or inner < 0:
            raise RecordError(f"refers to {what} {inner!r}")
        if what == "object":
            return self._objects[inner]
        if what == "array":
            return self._arrays[inner]
        if what == "scalar":
            return self._arrays[inner][()]
        raise RecordError(f"has an unknown entry {what!r}")
