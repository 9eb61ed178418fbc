"""The events of a skillset as messages, with a history for who subscribes late.

A latched topic of ROS 1 keeps one message. So every new subscriber is sent what the others have had, the last 1000 events, as
a transient local topic of ROS 2 would. An event published in the very moment of the subscription may come before that history,
and then once more within it: ``sequence`` tells.
"""

from __future__ import annotations

import threading
import time
from collections import deque
from collections.abc import Callable, Sequence
from typing import Any

import rospy
from skillset_interfaces.msg import Event

from skill_runtime.core.events import EngineEvent
from skill_runtime.messages import event_message
from skillset_ros1.names import HISTORY, QUEUE, stamp_of

FLUSH_STEP_S = 0.02
QUIET_S = 0.1


class EventPublisher(rospy.SubscribeListener):  # type: ignore[misc]  # rospy has no types
    """Publishes the events of each step on ``events``; ``life`` (in ``header.frame_id``) tells these managers from earlier ones."""

    def __init__(self, place: str, skillset: str, life: str) -> None:
        super().__init__()
        self._skillset = skillset
        self._life = life
        self._lock = threading.Lock()
        self._history: deque[Any] = deque(maxlen=HISTORY)
        self._publisher = rospy.Publisher(f"{place}/events", Event, subscriber_listener=self, queue_size=QUEUE)

    def publish(self, events: Sequence[EngineEvent]) -> None:
        """Publish in order."""
        for event in events:
            message = event_message(self._skillset, event)
            message.header.stamp, message.header.frame_id = stamp_of(event.stamp_ns), self._life
            with self._lock:
                self._history.append(message)
                self._publisher.publish(message)

    def peer_subscribe(self, topic_name: str, topic_publish: Callable[[Any], None], peer_publish: Callable[[Any], None]) -> None:  # noqa: ARG002
        """Send the history to somebody who has just subscribed."""
        with self._lock:
            for message in self._history:
                peer_publish(message)

    def flush(self, timeout_s: float) -> None:
        """Wait (wall clock) until all events were handed to the network: those of a process that ends would be lost.

        rospy doesn't tell when its sending threads have done their work: nothing was left to send for a while.
        """
        end = time.monotonic() + timeout_s
        quiet_since = time.monotonic()
        while (now := time.monotonic()) < end and now - quiet_since < QUIET_S and self._publisher.get_num_connections():
            if any(getattr(connection, "_queue", None) for connection in self._publisher.impl.connections):
                quiet_since = now
            time.sleep(FLUSH_STEP_S)

    def close(self) -> None:
        """Take the topic away."""
        self._publisher.unregister()
