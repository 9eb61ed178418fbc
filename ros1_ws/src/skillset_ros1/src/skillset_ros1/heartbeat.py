"""Signs of life of the managers: ROS 1 itself tells nobody of a node that died."""

from __future__ import annotations

import threading

import rospy
from std_msgs.msg import Header

from skillset_ros1.names import now_ns, stamp_of
from skillset_ros1.presence import ALIVE_PERIOD_S


class Heartbeat:
    """Publishes ``alive`` twice a second of wall clock, from a thread of its own: simulated time may stand still, and hooks be slow."""

    def __init__(self, place: str, life: str) -> None:
        self._life = life
        self._over = threading.Event()
        self._publisher = rospy.Publisher(f"{place}/alive", Header, latch=True, queue_size=1)
        self._thread = threading.Thread(target=self._run, name=f"{place}_alive", daemon=True)
        self._thread.start()

    def close(self) -> None:
        """End the signs."""
        self._over.set()
        self._thread.join()
        self._publisher.unregister()

    def _run(self) -> None:
        while not self._over.is_set() and not rospy.is_shutdown():
            self._publisher.publish(Header(stamp=stamp_of(now_ns()), frame_id=self._life))
            self._over.wait(ALIVE_PERIOD_S)
