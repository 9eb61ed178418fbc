"""Takes the ticks of a simulated clock beside a node's executor, which wakes only for those that something is due at.

A turn of rclpy's executor gathers all entities of the node and makes a wait set for them, and a simulated clock ticks fifty times a
second. What was sent before a tick is still dealt with before what is due at it: such a tick is applied by the executor, after a wait.
"""

from __future__ import annotations

import struct
import threading
from typing import Any

from rclpy.callback_groups import MutuallyExclusiveCallbackGroup
from rclpy.clock import ClockType
from rclpy.guard_condition import GuardCondition
from rclpy.impl.implementation_singleton import rclpy_implementation
from rclpy.node import Node
from rclpy.qos import QoSProfile, ReliabilityPolicy
from rclpy.time import Time
from rclpy.time_source import CLOCK_TOPIC
from rclpy.waitable import NumberOfEntities
from rosgraph_msgs.msg import Clock

from skillset_ros2.base import QUIET
from skillset_ros2.executor import LastingWaitable

NEVER_NS = 1 << 63
NEWEST = QoSProfile(depth=1, reliability=ReliabilityPolicy.BEST_EFFORT)


def _time_of(message: bytes) -> Time:
    """Return the time of a serialized Clock; to make a message object of it takes as long as all the rest."""
    seconds, nanoseconds = struct.unpack_from("<iI" if message[1] else ">iI", message, offset=4)
    return Time(seconds=seconds, nanoseconds=nanoseconds, clock_type=ClockType.ROS_TIME)


class _Elsewhere(MutuallyExclusiveCallbackGroup):  # type: ignore[misc]  # rclpy has no types
    """Holds what no executor waits for."""

    def can_execute(self, entity: Any) -> bool:  # noqa: ARG002 - rclpy's signature
        """Return False: it may not."""
        return False


class SimulatedTime(LastingWaitable):
    """Gives a node the ticks of ``/clock``, from a thread of its own; of a node with another clock it does nothing.

    To be made before what else the executor waits for, and closed before the node is destroyed.
    """

    def __init__(self, node: Node) -> None:
        super().__init__(MutuallyExclusiveCallbackGroup())
        self._node = node
        self._source = node._time_source  # noqa: SLF001 - rclpy 7.1.6 has no other way to its subscription
        self._lock = threading.Lock()
        self._waits = False
        self._due_ns = NEVER_NS
        self._tick: Time | None = None
        """The newest, where it is not applied yet."""
        self._thread: threading.Thread | None = None
        if not self._source.ros_time_is_active:
            return
        # In place of rclpy's own, whose warnings about the other end's QoS are entities that wake the executor at each message.
        node.destroy_subscription(self._source._clock_sub)  # noqa: SLF001
        self._subscription = self._source._clock_sub = node.create_subscription(  # noqa: SLF001
            Clock, CLOCK_TOPIC, lambda _: None, NEWEST, callback_group=_Elsewhere(), event_callbacks=QUIET
        )
        self._wake = GuardCondition(None, None, context=node.context)
        self._over = GuardCondition(None, None, context=node.context)
        self._closed = False
        node.add_waitable(self)
        self._thread = threading.Thread(target=self._follow, name=f"{node.get_name()}_clock", daemon=True)
        self._thread.start()
        # Of a node that is given up while it is made, nobody ends it.
        node.context.on_shutdown(self.close)

    def close(self) -> None:
        """Take no more ticks; a second call does nothing."""
        if self._thread is None:
            return
        self._closed = True
        self._over.trigger()
        self._thread.join()
        self._thread = None
        self._node.remove_waitable(self)

    # --- on the thread -------------------------------------------------------------------------------------------------

    def _follow(self) -> None:
        handle, over, context = self._subscription.handle, self._over.handle, self._node.context
        with handle, over, context.handle:
            wait_set = rclpy_implementation.WaitSet(1, 1, 0, 0, 0, 0, context.handle)
            while not self._closed and context.ok():
                wait_set.clear_entities()
                wait_set.add_subscription(handle)
                wait_set.add_guard_condition(over)
                wait_set.wait(-1)
                taken = handle.take_message(Clock, True)
                if taken is not None:
                    self._take(_time_of(taken[0]))

    def _take(self, tick: Time) -> None:
        with self._lock:
            self._tick = tick
            if self._waits:
                self._settle()

    def _settle(self) -> None:
        """Apply the tick while the executor waits, or wake it where something is due at it."""
        if self._tick is None:
            return
        if self._tick.nanoseconds < self._due_ns:
            self._apply()
        else:
            self._wake.trigger()

    def _apply(self) -> None:
        if self._tick is not None:
            # As rclpy's own callback does it; a clock that is attached later begins with this.
            self._source._last_time_set = self._tick  # noqa: SLF001
            for clock in self._source._associated_clocks:  # noqa: SLF001
                clock.set_ros_time_override(self._tick)
            self._tick = None

    # --- on the executor ---------------------------------------------------------------------------------------------

    def get_num_entities(self) -> NumberOfEntities:
        """Return that it waits for being woken."""
        return NumberOfEntities(num_gcs=1)

    def add_to_wait_set(self, wait_set: Any) -> None:
        """Begin a wait: look when the first timer is due."""
        with self._lock:
            wait_set.add_guard_condition(self._wake.handle)
            self._due_ns = self._first_due_ns()
            self._waits = True
            self._settle()

    def is_ready(self, wait_set: Any) -> bool:  # noqa: ARG002 - rclpy's signature
        """End a wait: whatever came before the tick is known to be ready, so what is due at it comes after that."""
        with self._lock:
            self._waits = False
            self._apply()
        return False

    def take_data(self) -> None:
        """Do nothing: this is never ready."""

    async def execute(self, taken: None) -> None:
        """Do nothing: this is never ready."""

    def _first_due_ns(self) -> int:
        left_ns = [
            left
            for timer in self._node.timers
            if timer.clock in self._source._associated_clocks and (left := timer.time_until_next_call()) is not None  # noqa: SLF001
        ]
        return int(self._node.get_clock().now().nanoseconds) + min(left_ns) if left_ns else NEVER_NS
