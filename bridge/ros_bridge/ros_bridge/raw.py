"""rospy message and service classes that carry bytes: rospy checks type and MD5 sum as ever, and never makes a message object."""

from __future__ import annotations

import threading
from typing import TYPE_CHECKING, Any, BinaryIO, ClassVar, Protocol

from ros_bridge import two_worlds

two_worlds.import_ros1()

import genpy  # noqa: E402 - only after rospy is there

if TYPE_CHECKING:
    from ros_bridge.conversion import ServiceType


class Ros1Type(Protocol):
    """What rospy compares and passes on of a message type."""

    @property
    def ros1_name(self) -> str:
        """``package/Name``."""

    @property
    def md5sum(self) -> str:
        """The type's fingerprint."""

    @property
    def full_text(self) -> str:
        """The definition, followed by those of its parts."""


class RawMessage(genpy.Message):  # type: ignore[misc]  # rospy has no types
    """A message of any type, serialized. Subclasses made below say which type."""

    __slots__ = ("data",)
    _type = "*"
    _md5sum = "*"
    _full_text = ""
    _has_header = False  # rospy would look into the object to set header.seq; the converter does it in the bytes
    _slot_types: ClassVar[list[str]] = []

    def __init__(self, data: bytes | memoryview = b"") -> None:
        self.data = data

    def serialize(self, buff: BinaryIO) -> None:
        """Write the bytes (rospy calls it when it sends)."""
        buff.write(self.data)

    def deserialize(self, data: bytes) -> RawMessage:
        """Keep the bytes (rospy calls it when it has received)."""
        self.data = data
        return self


class ArrivingMessage(RawMessage):
    """A message that knows how many newer ones of its connection wait behind it.

    rospy makes all messages of one read in the connection's thread, then calls back for each in the same thread.
    """

    __slots__ = ()
    waiting: ClassVar[threading.local]

    def deserialize(self, data: bytes) -> RawMessage:
        """Keep the bytes and count."""
        self.waiting.number = getattr(self.waiting, "number", 0) + 1
        return super().deserialize(data)

    def take(self) -> int:
        """Return how many wait behind this one; to be called once for each message."""
        self.waiting.number -= 1
        return int(self.waiting.number)


def message_class(message: Ros1Type) -> type[RawMessage]:
    """Return the class for ``rospy.Publisher`` and for services of a type."""
    return type(_class_name(message.ros1_name), (RawMessage,), _message_fields(message))


def arriving_class(message: Ros1Type) -> type[ArrivingMessage]:
    """Return the class for one ``rospy.Subscriber`` of a type."""
    return type(_class_name(message.ros1_name), (ArrivingMessage,), _message_fields(message) | {"waiting": threading.local()})


def _message_fields(message: Ros1Type) -> dict[str, object]:
    return {"__slots__": (), "_type": message.ros1_name, "_md5sum": message.md5sum, "_full_text": message.full_text}


def _class_name(ros1_name: str) -> str:
    return ros1_name.replace("/", "_")


def service_class(service: ServiceType) -> Any:
    """Return the class for ``rospy.Service`` of a type."""
    fields = {
        "_type": service.ros1_name,
        "_md5sum": service.md5sum,
        "_request_class": message_class(service.request),
        "_response_class": message_class(service.response),
    }
    return type(_class_name(service.ros1_name), (), fields)
