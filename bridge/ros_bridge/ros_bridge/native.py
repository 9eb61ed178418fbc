"""The data plane's C interface (ros_bridge_native, ``c_api.cpp`` and ``c_api_services.cpp``) as Python sees it.

Functions that make or end something of rcl's node keep Python's lock (``PyDLL``), because rclpy works on the same node under that
lock; those that may wait, and those that only read, let it go (``CDLL``).
"""

from __future__ import annotations

import ctypes
import os
from collections.abc import Sequence
from ctypes import POINTER, Structure, c_char_p, c_int32, c_int64, c_uint8, c_uint16, c_uint32, c_uint64, c_void_p
from enum import IntEnum
from pathlib import Path
from typing import Any, ClassVar

from ros_bridge.definitions import ament_prefixes
from ros_bridge.errors import BridgeError, WorldError
from ros_bridge.stats import BINS

LIBRARY = "libros_bridge_native.so"


class EventKind(IntEnum):
    """What an event tells (``events.hpp``)."""

    CONNECTED = 1
    CLOSED = 2
    REFUSED = 3
    NEEDS_WRITER = 4
    NEEDS_SERVER = 5
    BAD_MESSAGE = 6
    BAD_PEER = 7
    CALL_FAILED = 8
    MISSED = 9
    SUBSCRIBED = 10
    UNSUBSCRIBED = 11
    UNHEARD = 12
    HEARD = 13
    OTHER_VERSION = 14
    NOT_PUBLISHED = 15


class Specification(Structure):
    """A route, as ``PlaneSpecification``."""

    _fields_: ClassVar = [
        ("ros1_topic", c_char_p),
        ("ros1_type", c_char_p),
        ("md5sum", c_char_p),
        ("definition", c_char_p),
        ("ros2_topic", c_char_p),
        ("node", c_void_p),
        ("type_support", c_void_p),
        ("depth", c_uint64),
        ("program", POINTER(c_uint32)),
        ("operations", c_uint64),
        ("token", c_uint64),
        ("reliable", c_int32),
        ("latched", c_int32),
        ("converts", c_int32),
        ("bulky", c_int32),
    ]


class ServiceSpecification(Structure):
    """A service's route, as ``PlaneServiceSpecification``."""

    _fields_: ClassVar = [
        ("ros1_service", c_char_p),
        ("ros1_type", c_char_p),
        ("md5sum", c_char_p),
        ("ros2_service", c_char_p),
        ("node", c_void_p),
        ("type_support", c_void_p),
        ("request_program", POINTER(c_uint32)),
        ("request_operations", c_uint64),
        ("response_program", POINTER(c_uint32)),
        ("response_operations", c_uint64),
        ("timeout_ns", c_int64),
        ("token", c_uint64),
        ("converts", c_int32),
        ("refusal_has_flag", c_int32),
        ("refusal_has_text", c_int32),
        ("refusal_before", c_char_p),
        ("refusal_before_bytes", c_uint64),
        ("refusal_after", c_char_p),
        ("refusal_after_bytes", c_uint64),
    ]


class RouteFigures(Structure):
    """A route's counters, as ``PlaneFigures``."""

    _fields_: ClassVar = [
        ("count", c_uint64),
        ("bytes", c_uint64),
        ("errors", c_uint64),
        ("dropped_slow", c_uint64),
        ("dropped_overrun", c_uint64),
        ("peers", c_uint64),
        ("bins", c_uint32 * BINS),
    ]


class MessageKind(IntEnum):
    """What a message for Python is (``python_queue.hpp``)."""

    MESSAGE = 0
    REQUEST = 1
    RESPONSE = 2


class PythonMessage(Structure):
    """A message for Python, as ``PlanePythonMessage``."""

    _fields_: ClassVar = [("message", c_void_p), ("token", c_uint64), ("kind", c_int32), ("bytes", c_void_p), ("size", c_uint64)]


class Event(Structure):
    """An event, as ``PlaneEvent``; its text may have zeros in it, and be cut off at its end."""

    _fields_: ClassVar = [("kind", c_int32), ("token", c_uint64), ("text", c_uint8 * (1 << 16)), ("size", c_int32)]


KEEPING_THE_LOCK = {
    "plane_error": (c_char_p, []),
    "plane_new": (c_void_p, [c_char_p, c_char_p]),
    "plane_delete": (None, [c_void_p]),
    "plane_ros1_to_ros2_new": (c_void_p, [c_void_p, POINTER(Specification)]),
    "plane_connect_publisher": (c_int32, [c_void_p, c_uint64, c_char_p, c_uint16]),
    "plane_add_writer": (c_int32, [c_void_p, c_uint64]),
    "plane_ros2_to_ros1_new": (c_void_p, [c_void_p, POINTER(Specification)]),
    "plane_ros2_to_ros1_start": (c_int32, [c_void_p]),
    "plane_route_delete": (None, [c_void_p]),
    "plane_route_target_peers": (c_uint64, [c_void_p]),
    "plane_route_source_peers": (c_uint64, [c_void_p]),
    "plane_route_late_peers": (c_uint64, [c_void_p]),
    "plane_route_figures": (None, [c_void_p, POINTER(RouteFigures)]),
    "plane_service_in_ros1_new": (c_void_p, [c_void_p, POINTER(ServiceSpecification)]),
    "plane_service_in_ros2_new": (c_void_p, [c_void_p, POINTER(ServiceSpecification)]),
    "plane_service_found": (None, [c_void_p, c_char_p, c_uint16]),
    "plane_service_not_found": (None, [c_void_p, c_char_p]),
    "plane_end_older_connections": (None, [c_void_p, c_char_p]),
    "plane_python_done": (None, [c_void_p]),
    "plane_python_close": (None, [c_void_p]),
    "plane_port": (c_int32, [c_void_p]),
}
LETTING_IT_GO = {
    "plane_python_next": (c_int32, [c_void_p, c_int32, POINTER(PythonMessage)]),
    "plane_python_converted": (None, [c_void_p, c_void_p, c_char_p, c_uint64, c_char_p]),
    "plane_publish": (None, [c_void_p, c_char_p, c_uint64]),
    "plane_next_event": (c_int32, [c_void_p, c_int32, POINTER(Event)]),
    "plane_to_cdr": (c_int64, [POINTER(c_uint32), c_uint64, c_char_p, c_uint64, POINTER(c_uint8)]),
    "plane_to_ros1": (c_int64, [POINTER(c_uint32), c_uint64, c_char_p, c_uint64, c_uint32, POINTER(c_uint8)]),
}


class NativeError(BridgeError):
    """The data plane has refused something; the message is its own."""


class Native:
    """The library's functions by their names."""

    def __init__(self, path: Path) -> None:
        """Load it; raises OSError if that fails."""
        for library, functions in ((ctypes.PyDLL(str(path)), KEEPING_THE_LOCK), (ctypes.CDLL(str(path)), LETTING_IT_GO)):
            for name, (result, arguments) in functions.items():
                function = getattr(library, name)
                function.restype = result
                function.argtypes = arguments
                setattr(self, name.removeprefix("plane_"), function)

    def __getattr__(self, name: str) -> Any:
        """Tell type checkers that functions are looked up by name."""
        raise AttributeError(name)

    def require(self, result: int | None) -> int:
        """Return what a function returned; raise NativeError with its reason when that is nothing."""
        if not result:
            raise NativeError(self.error().decode(errors="replace"))
        return result


def load_library() -> Native:
    """Load the library from this environment's prefixes; ROS_BRIDGE_NATIVE names another one. Raises WorldError."""
    told = os.environ.get("ROS_BRIDGE_NATIVE")
    candidates = [Path(told)] if told else [prefix / "lib" / LIBRARY for prefix in ament_prefixes()]
    for path in candidates:
        if path.is_file():
            return Native(path)
    raise WorldError(f"no {told or LIBRARY} in {', '.join(map(str, candidates))}: build bridge/ros_bridge_native (./alula setup)")


def words_of(program: Sequence[int]) -> Any:
    """Return a layout program as the library takes it."""
    return (c_uint32 * len(program))(*program)
