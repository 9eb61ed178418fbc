"""Blackboards as BehaviorTree.CPP 4 sends them to viewers: MessagePack with keys in order and each number as short as it can be."""

from __future__ import annotations

import struct
from collections.abc import Mapping, Sequence

import msgpack

from alula.runtime.plain import to_plain

_FLOAT32 = struct.Struct("<f")


def pack_values(values: Mapping[str, Mapping[str, object]]) -> bytes:
    """Return the values on blackboards of subtrees, by the subtrees' names; null where there is nothing."""
    return _packed({name: to_plain(board) or None for name, board in values.items()} or None)


def _packed(value: object) -> bytes:
    packer = msgpack.Packer()
    if isinstance(value, Mapping):
        pairs = sorted(value.items())
        return bytes(packer.pack_map_header(len(pairs))) + b"".join(_packed(key) + _packed(part) for key, part in pairs)
    if isinstance(value, Sequence) and not isinstance(value, str):
        return bytes(packer.pack_array_header(len(value))) + b"".join(map(_packed, value))
    if isinstance(value, float):
        return bytes(msgpack.packb(value, use_single_float=_fits_single(value)))
    try:
        return bytes(packer.pack(value))
    except OverflowError:  # an integer of more than 64 bits
        return bytes(packer.pack(str(value)))


def _fits_single(value: float) -> bool:
    try:
        single: float = _FLOAT32.unpack(_FLOAT32.pack(value))[0]
    except OverflowError:
        return False
    return single == value
