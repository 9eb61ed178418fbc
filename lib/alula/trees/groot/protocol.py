"""What goes over the wire between BehaviorTree.CPP 4 and a viewer such as Groot2: headers, requests, statuses, transitions, values.

Source: BehaviorTree.CPP 4.8.2, ``loggers/groot2_protocol.h`` and ``groot2_publisher.cpp``. A request is a header, for some a second part;
a reply is the header again with the tree's UUID, for most a second part; a refusal is ``error`` and a sentence. Numbers are little-endian.
"""

from __future__ import annotations

import struct
from collections.abc import Iterable
from dataclasses import dataclass
from enum import Enum, IntEnum
from typing import TypeAlias

PROTOCOL = 2
DEFAULT_PORT = 1667
"""Of requests; the next one is the publisher's."""

REFUSAL = b"error"
_HEADER = struct.Struct("<BBI")
_STATUS = struct.Struct("<HB")
_TRANSITION = struct.Struct("<IHHB")  # its time has 48 bits
_LONGEST_US = (1 << 48) - 1
IDLE_FROM = 10
"""Added to the last status of a node that is idle by now."""


class Status(IntEnum):
    """Of a node, by BehaviorTree.CPP's numbers."""

    IDLE = 0
    RUNNING = 1
    SUCCESS = 2
    FAILURE = 3
    SKIPPED = 4


class Request(Enum):
    """What a viewer may ask for."""

    FULL_TREE = ord("T")
    STATUS = ord("S")
    BLACKBOARD = ord("B")
    HOOK_INSERT = ord("I")
    HOOK_REMOVE = ord("R")
    BREAKPOINT_UNLOCK = ord("U")
    HOOKS_DUMP = ord("D")
    REMOVE_ALL_HOOKS = ord("A")
    DISABLE_ALL_HOOKS = ord("X")
    TOGGLE_RECORDING = ord("r")
    GET_TRANSITIONS = ord("t")


class ProtocolError(Exception):
    """Bytes are not what the protocol has in their place; the message says it to the viewer."""


@dataclass(frozen=True)
class Header:
    """Begins a request; ``number`` is the viewer's own, for it to find its reply."""

    request: Request
    number: int

    @classmethod
    def read(cls, data: bytes) -> Header:
        """Read it as a viewer sends it; raises ProtocolError."""
        if len(data) != _HEADER.size:
            raise ProtocolError("wrong request header")
        _, kind, number = _HEADER.unpack(data)  # the version is not looked at, as in BehaviorTree.CPP
        try:
            return cls(Request(kind), number)
        except ValueError:
            raise ProtocolError("Request not recognized") from None

    def reply(self, tree: bytes) -> bytes:
        """Return the reply's; ``tree``: 16 bytes, another at each start of a server."""
        return _HEADER.pack(PROTOCOL, self.request.value, self.number) + tree


Change: TypeAlias = tuple[int, int, int]
"""Of a node: its uid, what it was, what it is, by the numbers of `Status`."""


@dataclass(frozen=True)
class Transition:
    """A node's change of status as records have it; ``at_us``: microseconds since the record began."""

    at_us: int
    uid: int
    status: Status

    SIZE = _TRANSITION.size

    @classmethod
    def unpack(cls, data: bytes) -> Transition:
        """Read its nine bytes; raises ProtocolError at a status that there is not."""
        low, high, uid, status = _TRANSITION.unpack(data)
        try:
            return cls(high << 32 | low, uid, Status(status))
        except ValueError:
            raise ProtocolError(f"there is no status {status}; a status is 0 to {max(Status)}") from None


def pack_transitions(changes: Iterable[Change], at_us: int) -> bytes:
    """Return the nine bytes of each change, all of one moment."""
    moment, pack = min(max(at_us, 0), _LONGEST_US).to_bytes(6, "little"), _STATUS.pack
    return moment.join([b"", *[pack(uid, status) for uid, _, status in changes]])


def pack_status(uid: int, code: int) -> bytes:
    """Return a node's three bytes in the reply to STATUS; ``code``: a `Status`, or one that has passed plus `IDLE_FROM`."""
    return _STATUS.pack(uid, code)
