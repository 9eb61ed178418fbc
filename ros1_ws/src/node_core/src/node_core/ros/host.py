"""A core in a ROS 1 node: its inputs are subscribed, its outputs published, its timers run on the ROS clock."""

from __future__ import annotations

import math
from collections.abc import Callable
from threading import Lock
from typing import TYPE_CHECKING, Any

import rospy

from node_core.core import Switched
from node_core.ros.receipts import Receipts
from node_core.ros.subscription import RawSubscriber
from node_core.ros.switch import EnableSwitch
from node_core.ros.worker import NewestWorker
from resource_reporter import DoneReporter, ResourceReporter, send_directly

if TYPE_CHECKING:
    from collections.abc import Sequence

    from node_core.core import Core, Output


class RosHost:
    """The host of a core in a node; to be made after ``rospy.init_node``. ``run`` begins, once the core is made.

    Args:
        outputs: what the core publishes.
        skillsets: have the resources that the core reports.
    """

    def __init__(self, outputs: Sequence[Output], *skillsets: str) -> None:
        send_directly()
        self._publishers = {each.topic: _publisher(each) for each in outputs}
        self._receipts = {each.topic: Receipts(each.taken, each.topic) for each in outputs if each.taken}
        self._subscribers: dict[str, RawSubscriber] = {}
        self._reporters = {skillset: ResourceReporter(skillset) for skillset in skillsets}
        self._done: DoneReporter | None = None
        self._worker = NewestWorker[Callable[[], None]](lambda work: work())
        self._lock = Lock()
        self._warned_s: dict[str, float] = {}

    def run(self, core: Core) -> None:
        """Subscribe to the core's inputs, serve its switch where it has one, and run its timers."""
        self._switch = EnableSwitch(core.switch) if isinstance(core, Switched) else None
        for each in core.inputs:
            self._subscribers[each.topic] = RawSubscriber(each)
        # reset: a clock that jumps back (a bag played again) must not end the timer's thread.
        self._timers = [rospy.Timer(rospy.Duration.from_sec(period_s), _job(work), reset=True) for period_s, work in core.timers]
        self._done = DoneReporter(*self._reporters.values(), *self._receipts.values())

    def now_ns(self) -> int:
        """Return the ROS clock."""
        return int(rospy.Time.now().to_nsec())

    def publish(self, topic: str, message: Any) -> None:
        """Publish on an output."""
        if topic in self._receipts:
            self._receipts[topic].sent(message.header.stamp.to_nsec())
        self._publishers[topic].publish(message)

    def wanted(self, topic: str) -> bool:
        """Return whether an output has a subscriber."""
        return bool(self._publishers[topic].get_num_connections())

    def published(self, topic: str) -> bool:
        """Return whether an input has a publisher."""
        return self._subscribers[topic].published

    def done(self, stamp_ns: int) -> None:
        """Publish the stamp on ``~done``."""
        if self._done is not None:  # nobody has heard of this node yet
            self._done.done(stamp_ns)

    def report(self, resource: str, state: str, reason: str = "", *, insist: bool = True) -> None:
        """Report to the skillset."""
        skillset, _, name = resource.partition(".")
        self._reporters[skillset].report(name, state, reason, insist=insist)

    def offer(self, work: Callable[[], None]) -> None:
        """Offer this to the node's worker."""
        self._worker.offer(work)

    def info(self, text: str) -> None:
        """Log a text."""
        rospy.loginfo(text)

    def warn(self, about: str, text: str, *, every_s: float = 2.0) -> None:
        """Log a warning; the time since the last one is the mission clock's, which may go back."""
        now_s = rospy.get_time()
        with self._lock:
            due = abs(now_s - self._warned_s.get(about, -math.inf)) >= every_s
            if due:
                self._warned_s[about] = now_s
        if due:
            rospy.logwarn(text)


def _publisher(output: Output) -> rospy.Publisher:
    queue, latch = output.queue_size, output.latch
    return rospy.Publisher(output.topic, output.kind, queue_size=queue, latch=latch, tcp_nodelay=output.tcp_nodelay)


def _job(work: Callable[[], None]) -> Callable[[object], None]:
    return lambda _event: work()
