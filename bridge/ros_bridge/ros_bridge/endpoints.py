"""ROS 1 topics whose other end is Python: publish bytes, or receive bytes in a callback.

They are routes of the data plane without an end in ROS 2.
"""

from __future__ import annotations

import ctypes
import logging
from collections.abc import Callable
from typing import TYPE_CHECKING, Protocol

from ros_bridge import native
from ros_bridge.native_route import NativeRoute
from ros_bridge.ros1_node import Kind

if TYPE_CHECKING:
    from ros_bridge.plane import Plane

logger = logging.getLogger("ros_bridge")

QUEUE = 100  # messages towards each peer, or towards Python; the oldest gives way


class Ros1Type(Protocol):
    """The parts of a message type that ROS 1's nodes compare and send in connection headers."""

    @property
    def ros1_name(self) -> str:
        """Name of the type in ROS 1, ``package/Name``."""

    @property
    def md5sum(self) -> str:
        """ROS 1's checksum of the type, 32 hexadecimal digits."""

    @property
    def full_text(self) -> str:
        """The definition, followed by those of its parts."""


class _Endpoint(NativeRoute):
    """An end of a ROS 1 topic."""

    def __init__(self, plane: Plane, topic: str, ros1_type: Ros1Type) -> None:
        super().__init__(plane, topic)
        self._topic = topic
        self._type_name = ros1_type.ros1_name

    def _open(self, make: Callable[..., int | None], ros1_type: Ros1Type, *, latched: bool, depth: int) -> None:
        specification = native.Specification(
            ros1_topic=self._topic.encode(),
            ros1_type=ros1_type.ros1_name.encode(),
            md5sum=ros1_type.md5sum.encode(),
            definition=ros1_type.full_text.encode(),
            ros2_topic=b"",
            depth=depth,
            token=self._token,
            latched=latched,
        )
        self._handle = self._native.require(make(self._plane.context, ctypes.byref(specification)))


class Ros1Publisher(_Endpoint):
    """Publishes bytes on a ROS 1 topic."""

    def __init__(self, plane: Plane, topic: str, ros1_type: Ros1Type, *, latched: bool = False, depth: int = QUEUE) -> None:
        """Advertise the topic; raises BridgeError."""
        super().__init__(plane, topic, ros1_type)
        self._open(self._native.ros2_to_ros1_new, ros1_type, latched=latched, depth=depth)
        plane.node.register(Kind.PUBLISHER, topic, self._type_name)

    def publish(self, message: bytes | memoryview) -> None:
        """Send a message, as ROS 1 serializes it, to all subscribers; never waits. Nothing happens after ``close``."""
        content = bytes(message)
        with self._lock:
            if self._handle is not None:
                self._native.publish(self._handle, content, len(content))

    def peers(self) -> int:
        """Return how many subscribers are connected."""
        with self._lock:
            return 0 if self._handle is None else int(self._native.route_target_peers(self._handle))

    def close(self) -> None:
        """Unregister the publisher and free it."""
        self._plane.node.unregister(Kind.PUBLISHER, self._topic, self._type_name)
        self._delete()


class Ros1Subscriber(_Endpoint):
    """Calls ``receive`` with the bytes of each message of a ROS 1 topic, in the plane's thread for Python."""

    def __init__(self, plane: Plane, topic: str, ros1_type: Ros1Type, receive: Callable[[bytes], None], *, depth: int = QUEUE) -> None:
        """Subscribe; raises BridgeError. What ``receive`` raises is logged."""
        super().__init__(plane, topic, ros1_type)
        plane.take_messages(self._token, lambda _, content: receive(content))
        self._open(self._native.ros1_to_ros2_new, ros1_type, latched=False, depth=depth)
        if self._handle is not None:
            plane.links.subscribe(topic, self._type_name, self._handle)

    def peers(self) -> int:
        """Return how many publishers are connected."""
        with self._lock:
            return 0 if self._handle is None else int(self._native.route_source_peers(self._handle))

    def late(self) -> bool:
        """Return whether something may come late that a publisher has sent while it was away."""
        with self._lock:
            return self._handle is not None and bool(self._native.route_late_peers(self._handle))

    def close(self) -> None:
        """Unregister the subscription and free it."""
        if self._handle is not None:
            self._plane.links.unsubscribe(self._handle)
        self._delete()
