"""A thread that works on the newest item and forgets older ones: slower than its input, it skips, but never lags."""

from __future__ import annotations

from threading import Condition, Thread
from typing import TYPE_CHECKING, Generic, TypeVar

import rospy

if TYPE_CHECKING:
    from collections.abc import Callable

Item = TypeVar("Item")
WAIT_S = 0.5


class NewestWorker(Generic[Item]):
    """Call ``work`` with the newest offered item, one at a time; an exception is logged and ends that item only."""

    def __init__(self, work: Callable[[Item], None]) -> None:
        self._work = work
        self._newest: Item | None = None
        self._arrived = Condition()
        self._thread = Thread(target=self._run, daemon=True)
        self._thread.start()

    def offer(self, item: Item) -> None:
        """Replace what waits by this item."""
        with self._arrived:
            self._newest = item
            self._arrived.notify()

    def _take(self) -> Item | None:
        with self._arrived:
            self._arrived.wait_for(lambda: self._newest is not None, timeout=WAIT_S)
            item, self._newest = self._newest, None
            return item

    def _run(self) -> None:
        while not rospy.is_shutdown():
            item = self._take()
            if item is None:
                continue
            try:
                self._work(item)
            except Exception as error:  # noqa: BLE001 -- one bad measurement must not end the node
                rospy.logerr_throttle(1.0, f"{type(error).__name__}: {error}")
