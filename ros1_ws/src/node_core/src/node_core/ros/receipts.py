"""Which of a node's messages their reader has taken: in lockstep, a message that crosses a busy machine takes no simulated time."""

from __future__ import annotations

import threading
import time
from typing import TYPE_CHECKING

import rospy
from std_msgs.msg import Header

from resource_reporter import ends_the_node

if TYPE_CHECKING:
    from collections.abc import Callable

LIMIT_S = 10.0  # wall clock: a reader that hangs is waited for no longer
LOOK_S = 0.5  # wall clock
QUEUE = 20


class Receipts:
    """Holds back what is to be done once the reader of an output has taken all that was sent.

    The reader publishes a Header on ``topic`` for each message that it has taken, with the message's stamp, and the absolute name of the
    topic that it came on in ``frame_id``. Nothing waits where nobody publishes there.
    """

    def __init__(self, topic: str, output: str) -> None:
        self._output = rospy.resolve_name(output)
        self._sent_ns = self._taken_ns = 0
        self._behind_since_s: float | None = None  # wall
        self._waiting: list[Callable[[], None]] = []
        self._lock = threading.Lock()
        self._subscriber = rospy.Subscriber(topic, Header, self._on_taken, queue_size=QUEUE, tcp_nodelay=True)
        threading.Thread(target=self._look, name="receipts", daemon=True).start()

    def sent(self, stamp_ns: int) -> None:
        """Note that a message with this stamp is sent now."""
        with self._lock:
            self._sent_ns = stamp_ns

    def when_settled(self, job: Callable[[], None]) -> None:
        """Do a job once all that was sent so far is taken: at once if it is, else in another thread, in the order given."""
        with self._lock:
            if self._waiting or not self._settled():
                self._waiting.append(job)
                return
        job()

    @ends_the_node
    def _on_taken(self, header: Header) -> None:
        if header.frame_id == self._output:
            with self._lock:
                self._taken_ns = header.stamp.to_nsec()
                self._do_settled()

    @ends_the_node
    def _look(self) -> None:
        """Look whether the reader has gone, or hangs."""
        while not rospy.is_shutdown():
            with self._lock:
                self._do_settled()
            time.sleep(LOOK_S)

    def _settled(self) -> bool:
        if self._taken_ns >= self._sent_ns or not self._subscriber.get_num_connections():
            self._behind_since_s = None
            return True
        now_s = time.monotonic()
        if self._behind_since_s is None:
            self._behind_since_s = now_s
        return now_s - self._behind_since_s >= LIMIT_S

    def _do_settled(self) -> None:
        if self._waiting and self._settled():
            for job in self._waiting:  # under the lock: what comes meanwhile comes after it
                job()
            self._waiting.clear()
