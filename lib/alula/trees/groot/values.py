"""Blackboards as BehaviorTree.CPP 4 sends them to viewers: MessagePack with keys in order and each number as short as it can be."""

from __future__ import annotations

import struct
from collections.abc import Callable, Mapping, Sequence

import msgpack

from alula.common.plain import to_plain

_FLOAT32 = struct.Struct("<f")


def pack_values(values: Mapping[str, Mapping[str, object]]) -> bytes:
    """Return the values on blackboards of subtrees, by the subtrees' names; null where there is nothing."""
    parts: list[bytes] = []
    _Packing(parts.append).add({name: to_plain(board) or None for name, board in values.items()} or None)
    return b"".join(parts)


class _Packing:
    """Packs part by part, with packers that are made once: a mission's tick may have to wait for what holds the interpreter."""

    def __init__(self, put: Callable[[bytes], None]) -> None:
        self._put = put
        self._packer = msgpack.Packer()
        self._single = msgpack.Packer(use_single_float=True)

    def add(self, value: object) -> None:
        """Pack one."""
        if isinstance(value, Mapping):
            self._put(self._packer.pack_map_header(len(value)))
            for key in sorted(value):
                self._put(self._packer.pack(key))
                self.add(value[key])
        elif isinstance(value, Sequence) and not isinstance(value, str):
            self._put(self._packer.pack_array_header(len(value)))
            for part in value:
                self.add(part)
        elif isinstance(value, float):
            self._put((self._single if _fits_single(value) else self._packer).pack(value))
        else:
            self._put(self._whole(value))

    def _whole(self, value: object) -> bytes:
        try:
            return bytes(self._packer.pack(value))
        except OverflowError:  # an integer of more than 64 bits
            return bytes(self._packer.pack(str(value)))


def _fits_single(value: float) -> bool:
    try:
        single: float = _FLOAT32.unpack(_FLOAT32.pack(value))[0]
    except OverflowError:
        return False
    return single == value
