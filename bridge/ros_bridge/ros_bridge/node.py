"""The bridge: one node in each world, the routes between them, figures and heartbeats."""

from __future__ import annotations

import json
import logging
import os
import threading
from pathlib import Path
from typing import TYPE_CHECKING

from ros_bridge import raw, services, topics
from ros_bridge.config import Direction, TopicRoute
from ros_bridge.conversion import Types
from ros_bridge.master import Master, MasterWatch
from ros_bridge.stats import Stats

import rclpy  # isort: skip
import rospy  # isort: skip - after ros_bridge.raw, which fetches it
from rclpy.executors import ExternalShutdownException, SingleThreadedExecutor  # isort: skip
from rclpy.serialization import serialize_message  # isort: skip
from rospy.impl.registration import Registration, get_registration_listeners, get_service_manager, get_topic_manager  # isort: skip
from std_msgs.msg import String  # isort: skip

if TYPE_CHECKING:
    from ros_bridge.config import BridgeConfig

logger = logging.getLogger("ros_bridge")

STATE_TOPIC = "/bridge/state"
STATE_TYPE = "std_msgs/String"
HEARTBEAT_S = 0.5
HEARTBEATS_A_STATS_FILE = 4  # every 2 s
SPIN_END_S = 1.0


def register_again() -> None:
    """Tell the master about every topic and service of this process; publishers that it names in return get connected."""
    listeners = get_registration_listeners()
    for name, kind in get_topic_manager().get_publications():
        listeners.notify_added(name, kind, Registration.PUB)
    for name, kind in get_topic_manager().get_subscriptions():
        listeners.notify_added(name, kind, Registration.SUB)
    for name, uri in get_service_manager().get_services():
        listeners.notify_added(name, uri, Registration.SRV)


def require_types(config: BridgeConfig, types: Types) -> None:
    """Check that every route's type can cross, before anything is opened.

    Raises:
        TypeUnknownError: A world does not have a type.
        TypeDiffersError: The worlds lay a type out differently.
    """
    for topic in config.topics:
        types.message(topic.type_name)
        topics.interface_class(topic.type_name, "msg")
    for service in config.services:
        types.service(service.type_name)
        topics.interface_class(service.type_name, "srv")


class Bridge:
    """All routes, running. rospy and rclpy have to be initialised, and the types checked."""

    def __init__(self, config: BridgeConfig, types: Types, master: Master) -> None:
        """Open all routes."""
        self.stats = Stats()
        self._sequence = 0
        topic_types = [types.message(route.type_name) for route in config.topics]
        service_types = [types.service(route.type_name) for route in config.services]
        state_type = types.message(STATE_TYPE)
        self._node = rclpy.create_node("ros_bridge")
        self._topics = [
            topics.KINDS[route.direction](route, kind, self._node, self.stats.topic(route.ros1_name))
            for route, kind in zip(config.topics, topic_types, strict=True)
        ]
        self._services: list[services.ServiceBridge] = [
            services.KINDS[route.server](route, kind, self._node, self.stats.service(route.ros1_name))
            for route, kind in zip(config.services, service_types, strict=True)
        ]
        self._state_type = state_type
        state_route = TopicRoute(STATE_TOPIC, STATE_TOPIC, Direction.ROS1_TO_ROS2, STATE_TYPE, latched=True, depth=1)
        self._state_ros2 = self._node.create_publisher(String, STATE_TOPIC, topics.qos_profile(state_route))
        self._state_class = raw.message_class(state_type)
        self._state_ros1 = rospy.Publisher(STATE_TOPIC, self._state_class, latch=True, queue_size=1)
        self._executor = SingleThreadedExecutor()
        self._executor.add_node(self._node)
        self._spinner = threading.Thread(target=self._spin, name="ros2", daemon=True)
        self._watch = MasterWatch(master, rospy.get_caller_id(), register_again)

    def _spin(self) -> None:
        try:
            self._executor.spin()
        except ExternalShutdownException:
            logger.info("ROS 2 was shut down")

    def run(self, stop: threading.Event, stats_file: Path | None) -> None:
        """Bridge until asked to stop; heartbeats and figures are this thread's."""
        self._spinner.start()
        logger.info("bridging %d topics and %d services", len(self._topics), len(self._services))
        while not stop.is_set():
            self._beat("running")
            if stats_file is not None and self._sequence % HEARTBEATS_A_STATS_FILE == 0:
                self._write(stats_file)
            stop.wait(HEARTBEAT_S)
        self._beat("stopping")
        if stats_file is not None:
            self._write(stats_file)

    def _write(self, stats_file: Path) -> None:
        try:
            self.stats.write(stats_file)
        except OSError as error:
            logger.warning("the figures can't be written to %s: %s", stats_file, error)

    def _beat(self, state: str) -> None:
        """Publish the bridge's state in both worlds."""
        self._sequence += 1
        text = {
            "state": state,
            "sequence": self._sequence,
            "pid": os.getpid(),
            "ros1_master": self._watch.reachable,
            "topics": len(self._topics),
            "services": len(self._services),
            "errors": sum(stats.errors for stats in (*self.stats.topics.values(), *self.stats.services.values())),
        }
        cdr = serialize_message(String(data=json.dumps(text)))
        self._state_ros2.publish(cdr)
        self._state_ros1.publish(self._state_class(self._state_type.to_ros1(cdr)))

    def close(self) -> None:
        """End the routes, first the callers' side, then the executor."""
        self._watch.close()
        for bridge in (*self._services, *self._topics):
            bridge.close()
        self._executor.shutdown(timeout_sec=SPIN_END_S)
        if self._spinner.is_alive():
            self._spinner.join(SPIN_END_S)
