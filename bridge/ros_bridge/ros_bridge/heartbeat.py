"""The bridge's state as a latched heartbeat in both worlds: half a second without one means that there is no bridge."""

from __future__ import annotations

import json
import logging
import threading
from collections.abc import Callable, Mapping
from typing import TYPE_CHECKING

from rclpy.qos import DurabilityPolicy, QoSProfile
from rclpy.serialization import serialize_message
from std_msgs.msg import String

from ros_bridge.endpoints import Ros1Publisher

if TYPE_CHECKING:
    from ros_bridge.routes import Context

logger = logging.getLogger("ros_bridge")

STATE_TOPIC = "/ros_bridge/state"  # in ROS 2 in the node's namespace
STATE_TYPE = "std_msgs/String"
PERIOD_S = 0.2  # two beats may be late before the limit of 0.5 s
LATCHED = QoSProfile(depth=1, durability=DurabilityPolicy.TRANSIENT_LOCAL)


class Heartbeat:
    """Publishes the state every ``PERIOD_S``, and at once when told that it has changed."""

    def __init__(self, context: Context, state: Callable[[], Mapping[str, object]]) -> None:
        """Open both ends; ``state`` is called for each beat."""
        self._state = state
        self._type = context.types.message(STATE_TYPE)
        self._ros2 = context.node.create_publisher(String, STATE_TOPIC.lstrip("/"), LATCHED)
        self._ros1 = Ros1Publisher(context.plane, STATE_TOPIC, self._type, latched=True, depth=1)
        self._sequence = 0
        self._wake = threading.Event()
        self._ending = threading.Event()
        self._thread = threading.Thread(target=self._run, name="heartbeat", daemon=True)

    def start(self) -> None:
        """Start the thread that beats."""
        self._thread.start()

    def changed(self) -> None:
        """Beat at once: something has changed."""
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
            self._ros1.publish(self._type.to_ros1(cdr))
        except Exception as error:  # noqa: BLE001 - one world may be shutting down; the other one still gets its heartbeat
            logger.warning("a heartbeat failed: %s", error)

    def close(self, within_s: float) -> None:
        """Publish that the bridge stops, and send no more heartbeats."""
        self._ending.set()
        self._wake.set()
        if self._thread.is_alive():
            self._thread.join(within_s)
        self._ros1.close()
