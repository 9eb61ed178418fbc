"""actionlib's messages as ROS 1 serializes them, apart from what is of the action's own type, which stays bytes at the end.

Little-endian, packed (ROS wiki, "msg"): a string is a uint32 length and its bytes, a time two uint32 (s, ns), an array a uint32 length and
its elements. The layouts are those of actionlib_msgs and of what genaction makes of an ``.action`` file: ``ActionGoal`` = header, goal
id, goal; ``ActionResult`` and ``ActionFeedback`` = header, status, payload. Stamps are nanoseconds here.
"""

from __future__ import annotations

import struct
from collections.abc import Iterable
from dataclasses import dataclass

from ros_bridge.action_states import Ros1Status
from ros_bridge.errors import WireError

UINT32 = struct.Struct("<I")
TIME = struct.Struct("<II")
SECOND_NS = 1_000_000_000
LAST_SECOND = 0xFFFFFFFF


@dataclass(frozen=True)
class GoalId:
    """A goal's name and its stamp; in a cancel request an empty name or a zero stamp means "any"."""

    name: str
    stamp_ns: int


@dataclass(frozen=True)
class GoalStatus:
    """What the server says about a goal."""

    goal_id: GoalId
    status: Ros1Status
    text: str = ""


class _Reader:
    """Takes one message apart from its beginning; never reads beyond its end."""

    def __init__(self, data: bytes | memoryview) -> None:
        self._data = memoryview(data)
        self._at = 0

    def _take(self, size: int) -> memoryview:
        if size > len(self._data) - self._at:
            raise WireError(f"an actionlib message of {len(self._data)} bytes ends early: {size} more wanted at byte {self._at}")
        self._at += size
        return self._data[self._at - size : self._at]

    def number(self) -> int:
        return int(UINT32.unpack(self._take(4))[0])

    def text(self) -> str:
        return str(self._take(self.number()), "utf-8", "replace")

    def stamp_ns(self) -> int:
        seconds, nanoseconds = TIME.unpack(self._take(8))
        return int(seconds * SECOND_NS + nanoseconds)

    def skip_header(self) -> None:
        self._take(12)
        self._take(self.number())

    def goal_id(self) -> GoalId:
        stamp_ns = self.stamp_ns()
        return GoalId(self.text(), stamp_ns)

    def goal_status(self) -> GoalStatus:
        goal_id = self.goal_id()
        value = self._take(1)[0]
        try:
            status = Ros1Status(value)
        except ValueError:
            raise WireError(f"goal '{goal_id.name}' has status {value}, which actionlib does not know") from None
        return GoalStatus(goal_id, status, self.text())

    def rest(self) -> bytes:
        return bytes(self._take(len(self._data) - self._at))

    def end(self) -> None:
        if self._at != len(self._data):
            raise WireError(f"an actionlib message of {len(self._data)} bytes goes on behind its end at byte {self._at}")


def _text(value: str) -> bytes:
    encoded = value.encode("utf-8", "replace")
    return UINT32.pack(len(encoded)) + encoded


def _stamp(stamp_ns: int) -> bytes:
    seconds, nanoseconds = divmod(max(stamp_ns, 0), SECOND_NS)
    return TIME.pack(min(seconds, LAST_SECOND), nanoseconds)


def _header(seq: int, stamp_ns: int) -> bytes:
    return UINT32.pack(seq & 0xFFFFFFFF) + _stamp(stamp_ns) + _text("")


def _status(status: GoalStatus) -> bytes:
    return encode_goal_id(status.goal_id) + bytes([status.status]) + _text(status.text)


def encode_goal_id(goal_id: GoalId) -> bytes:
    """Return an actionlib_msgs/GoalID, which is also the message of a cancel request."""
    return _stamp(goal_id.stamp_ns) + _text(goal_id.name)


def decode_goal_id(data: bytes | memoryview) -> GoalId:
    """Read an actionlib_msgs/GoalID; raises WireError."""
    reader = _Reader(data)
    goal_id = reader.goal_id()
    reader.end()
    return goal_id


def encode_goal(goal_id: GoalId, goal: bytes | memoryview, *, seq: int, stamp_ns: int) -> bytes:
    """Return an ActionGoal around a serialized goal."""
    return _header(seq, stamp_ns) + encode_goal_id(goal_id) + goal


def decode_goal(data: bytes | memoryview) -> tuple[GoalId, bytes]:
    """Return a goal's id and the serialized goal; raises WireError."""
    reader = _Reader(data)
    reader.skip_header()
    return reader.goal_id(), reader.rest()


def encode_outcome(status: GoalStatus, payload: bytes | memoryview, *, seq: int, stamp_ns: int) -> bytes:
    """Return an ActionResult or ActionFeedback around a serialized result or feedback."""
    return _header(seq, stamp_ns) + _status(status) + payload


def decode_outcome(data: bytes | memoryview) -> tuple[GoalStatus, bytes]:
    """Read an ActionResult or ActionFeedback; raises WireError."""
    reader = _Reader(data)
    reader.skip_header()
    return reader.goal_status(), reader.rest()


def encode_status_array(statuses: Iterable[GoalStatus], *, seq: int, stamp_ns: int) -> bytes:
    """Return a serialized actionlib_msgs/GoalStatusArray."""
    parts = [_status(status) for status in statuses]
    return _header(seq, stamp_ns) + UINT32.pack(len(parts)) + b"".join(parts)


def decode_status_array(data: bytes | memoryview) -> list[GoalStatus]:
    """Read an actionlib_msgs/GoalStatusArray; raises WireError."""
    reader = _Reader(data)
    reader.skip_header()
    statuses = [reader.goal_status() for _ in range(reader.number())]
    reader.end()
    return statuses
