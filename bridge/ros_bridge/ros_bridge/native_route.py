"""The Python side of a data plane's route, of a topic or a service: its handle, its figures, its converters."""

from __future__ import annotations

import ctypes
import threading
from typing import TYPE_CHECKING

from ros_bridge import native
from ros_bridge.native import MessageKind
from ros_bridge.stats import Durations, Figures

if TYPE_CHECKING:
    from ros_bridge.conversion import BytesConverter
    from ros_bridge.plane import Plane

SLOW_SUBSCRIBER = "a subscriber in ROS 1 does not keep up"
OVERRUN = "arrived faster than they crossed"


class NativeRoute:
    """Owns the handle, which a subclass makes. Figures may be asked for from any thread, also after ``_delete``."""

    def __init__(self, plane: Plane, label: str) -> None:
        self._plane = plane
        self._native = plane.native
        self._token = plane.token(label)
        self._handle: int | None = None
        self._lock = threading.Lock()
        self._last = native.RouteFigures()
        self._converters: dict[MessageKind, BytesConverter] = {}

    def figures(self) -> Figures:
        """Return the figures so far."""
        with self._lock:
            self._read()
            counters = self._last
            durations = Durations.of(counters.bins)
            dropped = {SLOW_SUBSCRIBER: int(counters.dropped_slow), OVERRUN: int(counters.dropped_overrun)}
            return Figures(
                count=int(counters.count),
                bytes=int(counters.bytes),
                p50_ms=durations.percentile_ms(0.50),
                p95_ms=durations.percentile_ms(0.95),
                dropped={reason: number for reason, number in dropped.items() if number},
                errors=int(counters.errors),
            )

    def convert(self, message: native.PythonMessage, content: bytes) -> None:
        """Convert a message and hand it back. Called in the plane's thread for Python."""
        problem, converted = b"", b""
        try:
            converted = bytes(self._converters[MessageKind(message.kind)](content))
        except Exception as error:  # noqa: BLE001 - whatever garbage a peer sends; the route tells it
            problem = f"{type(error).__name__}: {error}".encode()
        with self._lock:
            if self._handle is not None:
                self._native.python_converted(self._handle, message.message, converted, len(converted), problem)

    def _convert_in_python(self, converters: dict[MessageKind, BytesConverter]) -> None:
        """Have messages converted by Python, because the worlds lay them out differently."""
        self._converters = converters
        self._plane.take_messages(self._token, self.convert)

    def _delete(self) -> None:
        """End the route; its last figures are kept."""
        self._plane.take_no_messages(self._token)
        with self._lock:
            self._read()
            handle, self._handle = self._handle, None
            if handle is not None:
                self._native.route_delete(handle)

    def _read(self) -> None:
        if self._handle is not None:
            self._native.route_figures(self._handle, ctypes.byref(self._last))
