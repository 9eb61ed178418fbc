"""A node that spins by itself, for scripts that have none."""

from __future__ import annotations

import atexit
import os
import threading
import traceback

import rclpy
from rclpy.context import Context
from rclpy.executors import Executor, ExternalShutdownException, ShutdownException
from rclpy.node import Node
from rclpy.parameter import Parameter
from rclpy.qos import QoSProfile, ReliabilityPolicy
from rclpy.signals import SignalHandlerOptions
from rclpy.time_source import CLOCK_TOPIC
from rosgraph_msgs.msg import Clock

from alula.common.fast_dds import leave
from skillset_ros2.executor import NodeExecutor

JOIN_S = 5.0


class Session:
    """A context, a node and a thread that spins it, of their own; ``close`` ends them.

    Args:
        name: begins the node's name.
        domain: the DDS domain; by default the environment's ROS_DOMAIN_ID.
        namespace: of the robot whose mission clock it takes, as ``/robot1``.
        executor: what spins the node.
    """

    def __init__(self, name: str, *, domain: int | None = None, namespace: str = "", executor: type[Executor] = NodeExecutor) -> None:
        self._clock = f"{namespace.rstrip('/')}/clock"
        self._context = Context()
        rclpy.init(args=[], context=self._context, domain_id=domain, signal_handler_options=SignalHandlerOptions.NO)
        self.node = Node(f"{name}_{os.getpid():x}_{threading.get_native_id():x}", context=self._context, enable_rosout=False)
        self._executor = executor(context=self._context)
        self._executor.add_node(self.node)
        self._over = threading.Event()
        self._thread = threading.Thread(target=self._spin, name=f"{name}_spin", daemon=True)
        self._thread.start()
        # A script that ends without closing: the spinning thread must not be in DDS when the interpreter goes.
        atexit.register(self.close)

    def follow_clock(self) -> None:
        """Take the mission clock where one is published: in the robot's namespace, or else ``/clock``, which several may share."""
        if self._clock != CLOCK_TOPIC and self.node.count_publishers(self._clock):
            # rclpy's own subscription can be led elsewhere when the node is made only, and nothing is known of the graph then.
            tick = self.node._time_source.clock_callback  # noqa: SLF001
            self.node.create_subscription(Clock, self._clock, tick, QoSProfile(depth=1, reliability=ReliabilityPolicy.BEST_EFFORT))
        if self.node.count_publishers(self._clock) or self.node.count_publishers(CLOCK_TOPIC):
            self.node.set_parameters([Parameter("use_sim_time", value=True)])

    def close(self) -> None:
        """End the spinning, the node and the context; a second call does nothing."""
        atexit.unregister(self.close)
        if self._over.is_set():
            return
        self._over.set()
        self._executor.shutdown(timeout_sec=0)
        if threading.current_thread() is not self._thread:
            self._thread.join(JOIN_S)
        leave(self.node)

    def _spin(self) -> None:
        while not self._over.is_set():
            try:
                self._executor.spin()
            except (ExternalShutdownException, ShutdownException):
                return
            except Exception as error:  # noqa: BLE001 - a user's callback; the others must go on
                if not self._over.is_set():
                    self.node.get_logger().error("".join(traceback.format_exception(error)))
