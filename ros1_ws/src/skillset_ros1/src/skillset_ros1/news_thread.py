"""The one thread of a client: it does jobs in the order in which they came, and looks at the time in between."""

from __future__ import annotations

import queue
import threading
import time
from collections.abc import Callable
from typing import Any, Protocol

import rospy

from skill_runtime.waiting import CannotWaitError

TICK_S = 0.02
IDLE_S = 0.25
END_S = 1.0
Job = Callable[[], None]


class Owner(Protocol):
    """Whose thread it is; all of it is called on the thread."""

    @property
    def restless(self) -> bool:
        """Tell whether there is something that has to be looked at soon."""
        ...

    def look(self) -> None:
        """See what time has brought: after each job, and once a while without any."""
        ...

    def ending(self) -> None:
        """Take no more requests: the last jobs follow."""
        ...

    def ended(self, reason: str) -> None:
        """End every wait: nothing comes any more."""
        ...


class NewsThread:
    """Runs until it is closed or the node is shut down; what a job raises is logged, and ends nothing."""

    def __init__(self, skillset: str, owner: Owner) -> None:
        self._skillset = skillset
        self._owner = owner
        self._over = ""
        self._lock = threading.Lock()
        self._inbox: queue.SimpleQueue[Job | None] = queue.SimpleQueue()
        self._thread = threading.Thread(target=self._run, name=f"client_{skillset}", daemon=True)

    def start(self) -> None:
        """Begin with what has been asked for so far."""
        self._thread.start()

    def do(self, job: Job) -> None:
        """Run a job, soon."""
        self._inbox.put(job)

    def do_unless_over(self, job: Job) -> bool:
        """Run a job, soon and for sure; False when it is too late for that, and the job is not run."""
        with self._lock:
            if not self._over:
                self._inbox.put(job)
            return not self._over

    def handing_over(self, handler: Callable[[Any], None]) -> Callable[[Any], None]:
        """Return a callback, for any thread, that has ``handler`` called on this one."""
        return lambda message: self._inbox.put(lambda: handler(message))

    def wait(self, event: threading.Event, timeout_s: float | None) -> bool:
        """Wait for an event that this thread brings; None: until it comes or can't come any more.

        Raises:
            CannotWaitError: the caller is on this thread, or it has ended.
        """
        if threading.current_thread() is self._thread:
            raise CannotWaitError("this thread brings all news of the skillset and can't wait for them: use a callback, or another thread")
        end_s = float("inf") if timeout_s is None else time.monotonic() + timeout_s
        while not event.wait(min(IDLE_S, max(0.0, end_s - time.monotonic()))):
            if time.monotonic() >= end_s:
                return False
            if timeout_s is None and not self._thread.is_alive():
                raise CannotWaitError(f"the client of {self._skillset} was closed; nothing comes any more")
        return True

    def close(self, reason: str) -> None:
        """End for this reason, and wait for the end unless called on this thread."""
        with self._lock:
            self._over = self._over or reason
        self._inbox.put(None)
        if self._thread is not threading.current_thread():
            self._thread.join(END_S)

    def _run(self) -> None:
        while True:
            try:
                job = self._inbox.get(timeout=TICK_S if self._owner.restless else IDLE_S)
            except queue.Empty:
                job = _nothing
            if job is None or rospy.is_shutdown():
                break
            self._attempt(job)
            self._attempt(self._owner.look)
        self._owner.ending()
        with self._lock:
            self._over = self._over or "the node was shut down"
        while not self._inbox.empty():
            self._attempt(self._inbox.get() or _nothing)
        self._owner.ended(self._over)

    def _attempt(self, job: Job) -> None:
        try:
            job()
        except Exception as error:  # noqa: BLE001 - a callback must not end the client
            rospy.logerr("client of %s: %s: %s", self._skillset, type(error).__name__, error)


def _nothing() -> None:
    """Have come to look at the time."""
