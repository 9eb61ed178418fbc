"""What Python keeps of a route of the data plane, of a topic or a service: its handle, and its figures also when it is gone."""

from __future__ import annotations

import ctypes
import threading

from ros_bridge import native
from ros_bridge.stats import Durations, Figures

SLOW_SUBSCRIBER = "a subscriber in ROS 1 does not keep up"
OVERRUN = "arrived faster than they crossed"


class NativeRoute:
    """Owns the handle, which a subclass makes. Figures may be asked for from any thread, also after ``_delete``."""

    def __init__(self, library: native.Native) -> None:
        self._native = library
        self._handle: int | None = None
        self._lock = threading.Lock()
        self._last = native.RouteFigures()

    def figures(self) -> Figures:
        """Return what has crossed."""
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

    def _delete(self) -> None:
        """End the route; its last figures are kept."""
        with self._lock:
            self._read()
            handle, self._handle = self._handle, None
            if handle is not None:
                self._native.route_delete(handle)

    def _read(self) -> None:
        if self._handle is not None:
            self._native.route_figures(self._handle, ctypes.byref(self._last))
