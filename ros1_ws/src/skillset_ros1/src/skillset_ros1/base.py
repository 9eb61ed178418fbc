"""What the middleware port over rospy is built on: a thread of its own as the loop, names and subscriptions."""

from __future__ import annotations

import threading
import uuid
from collections.abc import Callable
from typing import Any

import rospy

from alula.runtime.middleware import OnValue
from alula.runtime.timers import Job, Timer
from alula.runtime.waiting import Waiter
from alula.runtime.workers import Workers
from skillset_ros1.loop import Loop
from skillset_ros1.names import mission_clock

LOOK_S = 0.02
"""How often (wall clock) connections are looked at while they are being made."""
ID_DIGITS = 12


class RospyBase:
    """The loop, names and subscriptions of one side of one skillset's interface, on this process's node.

    Args:
        skillset: its name.
        place: what its names begin with, absolute.
        what: what this side is, for its thread's name and its log.
    """

    def __init__(self, skillset: str, place: str, what: str) -> None:
        self._clock = mission_clock()
        self.loop = Loop(what, self._raised)
        self.waiter: Waiter = self.loop
        self.server = ""
        """The node of the managers, from a client's last heartbeat."""
        self._skillset = skillset
        self._place = place
        self._workers = Workers(f"{skillset}_hooks", self.log)
        self._over = threading.Event()
        self._parts: list[Callable[[], object]] = []

    def now_ns(self) -> int:
        """Return the mission clock, nanoseconds."""
        return self._clock.now_ns()

    def at(self, when_ns: int, job: Job) -> Timer:
        """Run a job at a moment of the mission clock."""
        return self.loop.at(when_ns, job)

    def later(self, delay_s: float, job: Job) -> Timer:
        """Run a job after a delay of wall clock."""
        return self.loop.after(delay_s, job)

    def submit(self, job: Job) -> None:
        """Run a job on the loop."""
        self.loop.submit(job)

    def defer(self, job: Job) -> None:
        """Run a job on a thread of its own."""
        self._workers.submit(job)

    def when(self, condition: Callable[[], bool], job: Job) -> None:
        """Run a job once a condition holds."""
        if condition():
            self.submit(job)
        else:
            self.later(LOOK_S, lambda: self.when(condition, job))

    def log(self, error: str) -> None:
        """Write an error to rospy's log, and so to ``/rosout``."""
        rospy.logerr("%s", error)

    def new_id(self) -> str:
        """Return a random id of ``ID_DIGITS`` hexadecimal digits."""
        return uuid.uuid4().hex[:ID_DIGITS]

    def _raised(self, error: Exception) -> None:
        self.log(f"{self._skillset}: {type(error).__name__}: {error}")

    def name(self, relative: str) -> str:
        """Return a name of the skillset's."""
        return f"{self._place}/{relative}"

    def listen(self, name: str, kind: Any, callback: OnValue, *, queue_size: int | None = None) -> Any:
        """Subscribe; the callback comes on the loop."""
        hand_over = lambda message: self.submit(lambda: callback(message))  # noqa: E731
        subscriber = rospy.Subscriber(name, kind, hand_over, queue_size=queue_size, tcp_nodelay=True)
        self._parts.append(subscriber.unregister)
        return subscriber

    def close_hooks(self, timeout_s: float) -> bool:
        """Wait for all deferred jobs."""
        return self._workers.close(timeout_s)

    def close(self) -> None:
        """Unregister all topics and services, and end the loop."""
        self._over.set()
        self.loop.close()
        for unregister in self._parts:
            unregister()
