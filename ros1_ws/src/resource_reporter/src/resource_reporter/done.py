"""Publish how far a node has come, so that a simulator can wait and a person can see how far the node is behind."""

from __future__ import annotations

from collections.abc import Callable
from functools import partial
from typing import Protocol

import rospy
from std_msgs.msg import Header

NS = 1_000_000_000
QUEUE = 20  # ticks or measurements; a simulator that waits for them never has so many under way


class Settling(Protocol):
    """What a node sends to others; it is settled when they have received it."""

    def when_settled(self, job: Callable[[], None]) -> None:
        """Run a job once others have received all that was sent so far."""


class DoneReporter:
    """Publishes ``~done``, a Header with the stamp of each measurement, or tick of the clock, that the node has dealt with.

    It is dealt with when others know what the node has told by then, as the skillsets the states that a ``ResourceReporter`` reports: what
    crosses a busy machine takes no simulated time. Make it when the node listens to all that it works on: a simulator may take it for
    ready from then on.
    """

    def __init__(self, *told: Settling) -> None:
        self._told = told
        self._publisher = rospy.Publisher("~done", Header, queue_size=QUEUE, tcp_nodelay=True)

    def done(self, stamp_ns: int) -> None:
        """Report that the measurement, or the tick, of ``stamp_ns`` is processed."""
        job: Callable[[], None] = partial(self._publisher.publish, Header(stamp=rospy.Time(*divmod(stamp_ns, NS))))
        for each in self._told:
            job = partial(each.when_settled, job)
        job()
