"""What runs cores over a bag: virtual time, no graph and no threads. The same messages make the same messages."""

from __future__ import annotations

import heapq
import itertools
import json
import logging
from collections.abc import Callable, Mapping, Sequence
from typing import TYPE_CHECKING, Any

from std_msgs.msg import String

if TYPE_CHECKING:
    from node_core.core import Output

log = logging.getLogger(__name__)
Publish = Callable[[str, Any], None]
WORK_S = 0.1
"""How long a node takes for a measurement: by then the poses up to its end are there, as they are in flight."""
CALLS = "/calls"


class Timeline:
    """The mission clock and its jobs."""

    def __init__(self) -> None:
        self.now_ns = 0
        self._jobs: list[tuple[int, int, Callable[[], None]]] = []
        self._numbers = itertools.count()

    def after(self, delay_s: float, job: Callable[[], None]) -> None:
        """Run a job after a delay."""
        heapq.heappush(self._jobs, (self.now_ns + round(delay_s * 1e9), next(self._numbers), job))

    def every(self, period_s: float, job: Callable[[], None]) -> None:
        """Run a job in each period."""

        def again() -> None:
            self.after(period_s, again)
            job()

        self.after(period_s, again)

    def advance_to(self, stamp_ns: int) -> None:
        """Advance the clock, and run the jobs that are due."""
        while self._jobs and self._jobs[0][0] <= stamp_ns:
            self.now_ns, _, job = heapq.heappop(self._jobs)
            job()
        self.now_ns = max(self.now_ns, stamp_ns)


class BagHost:
    """The host of one core in a replay; the bag stands for the drivers, and nobody takes what is made for subscribers alone.

    Args:
        name: the node's.
        outputs: what the core publishes.
        initial: the states in which resources begin, by ``skillset.resource``; UNKNOWN where none is named.
        publish: gets what is published, ``publish(topic, message)``; not what other nodes publish, too.
    """

    def __init__(self, name: str, outputs: Sequence[Output], initial: Mapping[str, str], timeline: Timeline, publish: Publish) -> None:
        self._name, self._initial, self._timeline, self._publish = name, initial, timeline, publish
        self.topics = {self._resolved(output.topic) for output in outputs if not output.shared}
        """Topics that the core alone publishes."""
        self._shown: dict[str, tuple[str, str]] = {}
        self._waiting: list[Callable[[], None]] = []
        self._busy = False

    def now_ns(self) -> int:
        """Return the bag's time, nanoseconds."""
        return self._timeline.now_ns

    def publish(self, topic: str, message: Any) -> None:
        """Publish a message under the node's name; on a topic that others publish, too, the record's messages stand instead."""
        resolved = self._resolved(topic)
        if resolved in self.topics:
            self._publish(resolved, message)

    def _resolved(self, topic: str) -> str:
        return f"/{self._name}/{topic[1:]}" if topic.startswith("~") else topic

    def wanted(self, _topic: str) -> bool:
        """Return False: nobody reads it."""
        return False

    def published(self, _topic: str) -> bool:
        """Return True: the bag publishes it."""
        return True

    def done(self, _stamp_ns: int) -> None:
        """Ignore it: time goes on when all of a moment is processed."""

    def report(self, resource: str, state: str, reason: str = "", *, insist: bool = True) -> None:
        """Record a new state or reason as a call that was accepted.

        The skillset's reason before the first call is not known here: a reason alone is recorded only after a call from here.
        """
        before, known = self._shown.get(resource, (self._initial.get(resource, "UNKNOWN"), reason))
        if insist if before != state else reason not in {"", known}:
            self._shown[resource] = state, reason
            now_s = self.now_ns() / 1e9
            response = {"accepted": True, "reason": "", "state": state}
            skillset, _, name = resource.partition(".")
            request = {"resource": name, "to": state, "reason": reason}
            call = {"service": f"/{skillset}/transition", "request": request, "response": response, "error": ""}
            self._publish(CALLS, String(data=json.dumps({**call, "begin_s": now_s, "end_s": now_s})))

    def offer(self, work: Callable[[], None]) -> None:
        """Run this after `WORK_S`; of what is offered meanwhile only the newest waits."""
        self._waiting = [work]
        if not self._busy:
            self._begin()

    def _begin(self) -> None:
        if self._waiting:
            self._busy, work = True, self._waiting.pop()
            self._timeline.after(WORK_S, lambda: self._finish(work))

    def _finish(self, work: Callable[[], None]) -> None:
        self._busy = False
        try:
            work()
        except Exception as error:  # noqa: BLE001 -- one bad measurement must not end the node, as in flight
            log.debug("%s: %s", type(error).__name__, error)
        self._begin()

    def info(self, text: str) -> None:
        """Log a text."""
        log.debug(text)

    def warn(self, _about: str, text: str, *, every_s: float = 2.0) -> None:  # noqa: ARG002 -- a protocol's signature
        """Log a warning."""
        log.debug(text)
