"""Messages as values, for types whose fields do not lie alike in the two worlds: taken apart and put together as ROS 1 serializes them.

ROS 2's types are serialized in the same way here (the data plane's layout), so one codec serves both. A number, a string or an array of
numbers is its bytes: a string need not be UTF-8, and a NaN has many. A message is a dict, in which a field that is missing is zero; an
array of anything else is a list.
"""

from __future__ import annotations

import struct
from collections.abc import Callable
from typing import TYPE_CHECKING, Any, cast

from rosbags.interfaces import Nodetype

from ros_bridge.errors import WireError
from ros_bridge.layout import HEADER, PADDING, SIZES

if TYPE_CHECKING:
    from rosbags.interfaces.typing import FieldDesc, Typesdict

LENGTH = struct.Struct("<I")
SEQUENCE_NUMBER: tuple[str, FieldDesc] = ("seq", (Nodetype.BASE, ("uint32", 0)))
MOST_EMPTY = 1 << 20  # elements of an array whose messages have no bytes
Read = Callable[[memoryview, int], tuple[Any, int]]
Write = Callable[[Any, list[bytes]], None]


def fields_of(definitions: Typesdict, name: str) -> list[tuple[str, FieldDesc]]:
    """Return the fields that a message ``package/msg/Name`` has in ROS 1's serialization, where each header has a number."""
    fields = [(field, kind) for field, kind in definitions[name][1] if field != PADDING]
    return [SEQUENCE_NUMBER, *fields] if name == HEADER and fields[0][0] != "seq" else fields


class Codec:
    """Takes the messages of one set of definitions apart and puts them together."""

    def __init__(self, definitions: Typesdict) -> None:
        """``definitions`` may grow; what is in it stays as it is."""
        self._definitions = definitions
        self._readers: dict[str, Read] = {}
        self._writers: dict[str, Write] = {}

    def read(self, name: str, data: bytes) -> dict[str, Any]:
        """Return the fields of a message ``package/msg/Name``; raises WireError when its bytes are not what its type says."""
        try:
            value, end = self._reader(name)(memoryview(data), 0)
        except struct.error as error:
            raise WireError(f"a message of {len(data)} bytes ends early: {error}") from None
        if end != len(data):
            raise WireError(f"a message of {len(data)} bytes goes on behind its end at byte {end}")
        return cast("dict[str, Any]", value)

    def write(self, name: str, value: dict[str, Any]) -> bytes:
        """Return a message as bytes."""
        parts: list[bytes] = []
        self._writer(name)(value, parts)
        return b"".join(parts)

    def _reader(self, name: str) -> Read:
        if name not in self._readers:
            fields = [(field, self._read_field(kind)) for field, kind in fields_of(self._definitions, name)]

            def read(data: memoryview, at: int) -> tuple[Any, int]:
                values = {}
                for field, read_field in fields:
                    values[field], at = read_field(data, at)
                return values, at

            self._readers[name] = read
        return self._readers[name]

    def _read_field(self, kind: FieldDesc) -> Read:
        if kind[0] == Nodetype.NAME:
            return self._reader(str(kind[1]))
        if kind[0] == Nodetype.BASE:
            base = _base(kind)
            return _read_string if base == "string" else _block_reader(SIZES[base], 1)
        element, number = cast("tuple[FieldDesc, int]", kind[1])
        length = number if kind[0] == Nodetype.ARRAY else None
        if (size := _size(element)) is not None:
            return _block_reader(size, length)
        return _list_reader(self._read_field(element), length)

    def _writer(self, name: str) -> Write:
        if name not in self._writers:
            fields = [(field, self._write_field(kind)) for field, kind in fields_of(self._definitions, name)]

            def write(value: Any, parts: list[bytes]) -> None:
                for field, write_field in fields:
                    write_field((value or {}).get(field), parts)

            self._writers[name] = write
        return self._writers[name]

    def _write_field(self, kind: FieldDesc) -> Write:
        """Return what writes a field; of the value None, zero."""
        if kind[0] == Nodetype.NAME:
            return self._writer(str(kind[1]))
        if kind[0] == Nodetype.BASE:
            base = _base(kind)
            return _write_string if base == "string" else _block_writer(SIZES[base], 1)
        element, number = cast("tuple[FieldDesc, int]", kind[1])
        length = number if kind[0] == Nodetype.ARRAY else None
        if (size := _size(element)) is not None:
            return _block_writer(size, length)
        return _list_writer(self._write_field(element), length)


def _base(kind: FieldDesc) -> str:
    return cast("tuple[str, int]", kind[1])[0]


def _size(element: FieldDesc) -> int | None:
    """Return the bytes of an element that is a number."""
    return SIZES.get(_base(element)) if element[0] == Nodetype.BASE else None


def _take(data: memoryview, at: int, size: int) -> bytes:
    if size > len(data) - at:
        raise struct.error(f"{size} more wanted at byte {at}")
    return bytes(data[at : at + size])


def _read_string(data: memoryview, at: int) -> tuple[bytes, int]:
    size = LENGTH.unpack_from(data, at)[0]
    return _take(data, at + LENGTH.size, size), at + LENGTH.size + size


def _block_reader(size: int, length: int | None) -> Read:
    def read(data: memoryview, at: int) -> tuple[bytes, int]:
        number, start = (length, at) if length is not None else (LENGTH.unpack_from(data, at)[0], at + LENGTH.size)
        return _take(data, start, number * size), start + number * size

    return read


def _list_reader(read_element: Read, length: int | None) -> Read:
    def read(data: memoryview, at: int) -> tuple[list[Any], int]:
        number, at = (length, at) if length is not None else (LENGTH.unpack_from(data, at)[0], at + LENGTH.size)
        values = []
        for _ in range(number):
            value, end = read_element(data, at)
            if end == at and number > MOST_EMPTY:
                raise struct.error(f"an array of {number} empty messages at byte {at}")
            values.append(value)
            at = end
        return values, at

    return read


def _write_string(value: bytes | None, parts: list[bytes]) -> None:
    parts += (LENGTH.pack(len(value or b"")), value or b"")


def _block_writer(size: int, length: int | None) -> Write:
    def write(value: bytes | None, parts: list[bytes]) -> None:
        if length is None:
            parts.append(LENGTH.pack(len(value or b"") // size))
        parts.append(value if value is not None else bytes(size * (length or 0)))

    return write


def _list_writer(write_element: Write, length: int | None) -> Write:
    def write(value: list[Any] | None, parts: list[bytes]) -> None:
        elements = value if value is not None else [None] * (length or 0)
        if length is None:
            parts.append(LENGTH.pack(len(elements)))
        for element in elements:
            write_element(element, parts)

    return write
