"""The bridge's state as a latched heartbeat in both worlds: who hears none for half a second knows that there is no bridge."""

from __future__ import annotations

import json
import logging
import threading
from collections.abc import Callable, Mapping
from typing import TYPE_CHECKING

from ros_bridge import raw

import rospy  # isort: skip - after ros_bridge.raw, which fetches it
from rclpy.qos import DurabilityPolicy, QoSProfile
from rclpy.serialization import serialize_message
from std_msgs.msg import String

if TYPE_CHECKING:
    from rclpy.node import Node

    from ros_bridge.conversion import Types

logger = logging.getLogger("ros_bridge")

STATE_TOPIC = "/ros_bridge/state"
STATE_TYPE = "std_msgs/String"
PERIOD_S = 0.2  # two beats may be late before the limit of 0.5 s
LATCHED = QoSProfile(depth=1, durability=DurabilityPolicy.TRANSIENT_LOCAL)


class Heartbeat:
    """Publishes the state every ``PERIOD_S``, and at once when told that it has changed."""

    def __init__(self, node: Node, types: Types, state: Callable[[], Mapping[str, object]]) -> None:
        """Open both ends; ``state`` is called for each beat."""
        self._state = state
        self._type = types.message(STATE_TYPE)
        self._class = raw.message_class(self._type)
        self._ros2 = node.create_publisher(String, STATE_TOPIC, LATCHED)
        self._ros1 = rospy.Publisher(STATE_TOPIC, self._class, latch=True, queue_size=1)
        self._sequence = 0
        self._wake = threading.Event()
        self._ending = threading.Event()
        self._thread = threading.Thread(target=self._run, name="heartbeat", daemon=True)

    def start(self) -> None:
        """Begin to beat."""
        self._thread.start()

    def changed(self) -> None:
        """Beat now."""
        self._wake.set()

    def _run(self) -> None:
        while not self._ending.is_set():
            self._beat("running")
            self._wake.wait(PERIOD_S)
            self._wake.clear()
        self._beat("stopping")

    def _beat(self, state: str) -> None:
        self._sequence += 1
        text = json.dumps({"state": state, "sequence": self._sequence, **self._state()})
        cdr = serialize_message(String(data=text))
        try:
            self._ros2.publish(cdr)
            self._ros1.publish(self._class(self._type.to_ros1(cdr)))
        except Exception as error:  # noqa: BLE001 - of a world that is going away; the other one still has to hear
            logger.warning("a heartbeat failed: %s", error)

    def close(self, within_s: float) -> None:
        """Say that the bridge stops, and stop beating."""
        self._ending.set()
        self._wake.set()
        if self._thread.is_alive():
            self._thread.join(within_s)
