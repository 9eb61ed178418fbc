"""Finds calls that do not return.

It counts its own time, not the mission clock, which may stand still: ticks during which this process could run. A process that
was frozen for a minute, or gets little of the processor, counts one tick.
"""

from __future__ import annotations

import threading
import time
from collections.abc import Callable

TICK_S = 0.25
IDLE_TICKS = 20
"""A watchdog without work for so long ends its thread."""


class Watch:
    """One call that is watched."""

    __slots__ = ("_dog", "left_s", "overdue")

    def __init__(self, dog: Watchdog, limit_s: float, overdue: Callable[[], None]) -> None:
        self._dog = dog
        self.left_s = limit_s
        self.overdue = overdue

    def end(self) -> bool:
        """End the watch: the call has returned. False when it was found overdue before."""
        return self._dog.forget(self)


class Watchdog:
    """Watches calls from one thread, which runs while there are any."""

    def __init__(self) -> None:
        self._lock = threading.Lock()
        self._watches: set[Watch] = set()
        self._thread: threading.Thread | None = None

    def watch(self, limit_s: float, overdue: Callable[[], None]) -> Watch:
        """Watch a call that begins now; ``overdue`` is called once, on the watchdog's thread, when it takes longer than the limit."""
        watch = Watch(self, limit_s + TICK_S, overdue)
        with self._lock:
            self._watches.add(watch)
            if self._thread is None:
                self._thread = threading.Thread(target=self._run, name="hook watchdog", daemon=True)
                self._thread.start()
        return watch

    def forget(self, watch: Watch) -> bool:
        """Watch a call no longer; False when it was found overdue."""
        with self._lock:
            if watch not in self._watches:
                return False
            self._watches.remove(watch)
            return True

    def tick(self, passed_s: float) -> bool:
        """Let time pass, seconds; return whether any call is still watched."""
        with self._lock:
            for watch in self._watches:
                watch.left_s -= passed_s
            late = [watch for watch in self._watches if watch.left_s <= 0.0]
            self._watches.difference_update(late)
            busy = bool(self._watches)
        for watch in late:
            watch.overdue()
        return busy

    def _run(self) -> None:
        idle, before_s = 0, time.monotonic()
        while idle < IDLE_TICKS or not self._may_end():
            time.sleep(TICK_S)
            now_s = time.monotonic()
            idle = 0 if self.tick(min(now_s - before_s, 2.0 * TICK_S)) else idle + 1
            before_s = now_s

    def _may_end(self) -> bool:
        with self._lock:
            if self._watches:
                return False
            self._thread = None
            return True


WATCHDOG = Watchdog()
"""The one of this process."""
