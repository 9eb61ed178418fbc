"""Topics: a route a class, one for each direction. Bytes go in on one side and out on the other, in the thread that brought them.

No message waits inside the bridge: from ROS 1 the queue is the connection's socket, of which each read keeps the newest ``depth``
messages; towards ROS 1 each subscriber has a queue of ``depth`` messages and a thread of its own, so one that does not
read loses its oldest messages and holds up nobody.
"""

from __future__ import annotations

import importlib
import logging
import time
from collections.abc import Mapping
from typing import TYPE_CHECKING, Any

from ros_bridge import raw
from ros_bridge.config import Direction, Reliability, TopicRoute
from ros_bridge.echoes import ECHOES
from ros_bridge.errors import TypeUnknownError
from ros_bridge.fast_topics import FastTopic
from ros_bridge.stats import RouteStats

import rospy  # isort: skip - after ros_bridge.raw, which fetches it
from rclpy.qos import DurabilityPolicy, HistoryPolicy, QoSProfile, ReliabilityPolicy

if TYPE_CHECKING:
    from rclpy.node import Node
    from rclpy.subscription import Subscription

    from ros_bridge.conversion import TypePair
    from ros_bridge.raw import ArrivingMessage
    from ros_bridge.routes import Context, TopicBridge
    from ros_bridge.stats import Figures

logger = logging.getLogger("ros_bridge")

RECEIVE_BUFFER_BYTES = 262_144  # rospy's read size; its default of 64 kB makes 57 reads of an image
RELIABILITY = {Reliability.RELIABLE: ReliabilityPolicy.RELIABLE, Reliability.BEST_EFFORT: ReliabilityPolicy.BEST_EFFORT}


def interface_class(package_and_name: str, kind: str) -> Any:
    """Return ROS 2's class of a message (kind ``msg``) or service (``srv``); rclpy takes the type support from it.

    Raises:
        TypeUnknownError: It is not installed.
    """
    package, name = package_and_name.split("/")
    try:
        return getattr(importlib.import_module(f"{package}.{kind}"), name)
    except (ImportError, AttributeError) as error:
        raise TypeUnknownError(f"{package}/{kind}/{name} is not installed in the ROS 2 world: build or install {package}") from error


def qos_profile(route: TopicRoute) -> QoSProfile:
    """Return the quality of service of a route's ROS 2 end."""
    return QoSProfile(
        history=HistoryPolicy.KEEP_LAST,
        depth=route.depth,
        reliability=RELIABILITY[route.reliability],
        durability=DurabilityPolicy.TRANSIENT_LOCAL if route.latched else DurabilityPolicy.VOLATILE,
    )


def complain(stats: RouteStats, name: str, error: Exception) -> None:
    """Count a message that can't cross, and say so at the first and at every thousandth."""
    number = stats.failed()
    if number % 1000 == 1:
        logger.error("%s: message %d that can't be converted: %s: %s", name, number, type(error).__name__, error)


class Ros1ToRos2:
    """A ROS 1 topic republished in ROS 2, in rospy's receiving thread of each connection."""

    def __init__(self, route: TopicRoute, pair: TypePair, node: Node) -> None:
        """Offer the topic in ROS 2."""
        self._name = route.ros1_name
        self._ros2_name = route.ros2_name
        self._depth = route.depth
        self._pair = pair
        self._stats = RouteStats()
        self._node = node
        self._publisher = node.create_publisher(interface_class(pair.ros2_name, "msg"), route.ros2_name, qos_profile(route))
        self._subscriber: rospy.Subscriber | None = None

    def start(self) -> None:
        """Subscribe in ROS 1; messages flow from here on."""
        self._subscriber = rospy.Subscriber(
            self._name,
            raw.arriving_class(self._pair),
            self._forward,
            buff_size=RECEIVE_BUFFER_BYTES,
            tcp_nodelay=True,
        )

    def target_peers(self) -> int:
        """Return how many subscriptions in ROS 2 are matched."""
        return int(self._publisher.get_subscription_count())

    def source_peers(self) -> int:
        """Return how many publishers in ROS 1 are connected."""
        return 0 if self._subscriber is None else int(self._subscriber.get_num_connections())

    def figures(self) -> Figures:
        """Return what has crossed."""
        return self._stats.figures()

    def _forward(self, message: ArrivingMessage) -> None:
        start_ns = time.perf_counter_ns()
        if message.take() >= self._depth:
            self._stats.dropped("arrived faster than they crossed")
            return
        if message._connection_header.get("callerid") == rospy.get_caller_id():  # noqa: SLF001 - rospy's attribute
            return  # what we have published ourselves
        try:
            cdr = self._pair.to_ros2(bytes(message.data))
            ECHOES.sent(self._ros2_name, cdr)
            self._publisher.publish(cdr)
        except Exception as error:  # noqa: BLE001 - whatever garbage a peer sends must not end the connection's thread
            complain(self._stats, self._name, error)
        else:
            self._stats.crossed(time.perf_counter_ns() - start_ns, len(cdr))

    def close(self) -> None:
        """Stop receiving, then withdraw the topic from ROS 2."""
        if self._subscriber is not None:
            self._subscriber.unregister()
        self._node.destroy_publisher(self._publisher)


class Ros2ToRos1:
    """A ROS 2 topic republished in ROS 1; the executor's thread only converts and hands over."""

    def __init__(self, route: TopicRoute, pair: TypePair, node: Node) -> None:
        """Offer the topic in ROS 1."""
        self._route = route
        self._name = route.ros2_name
        self._pair = pair
        self._stats = RouteStats()
        self._node = node
        self._seq = 0
        self._last_sequence = 0
        self._raw_class = raw.message_class(pair)
        self._publisher = rospy.Publisher(route.ros1_name, self._raw_class, latch=route.latched, queue_size=route.depth, tcp_nodelay=True)
        self._subscription: Subscription[Any] | None = None

    def start(self) -> None:
        """Subscribe in ROS 2; messages flow as soon as the node is spun."""
        ECHOES.listen(self._name)
        self._subscription = self._node.create_subscription(
            interface_class(self._pair.ros2_name, "msg"), self._name, self._forward, qos_profile(self._route), raw=True
        )

    def target_peers(self) -> int:
        """Return how many subscribers in ROS 1 are connected."""
        return int(self._publisher.get_num_connections())

    def source_peers(self) -> int:
        """Return how many publishers in ROS 2 are matched."""
        return 0 if self._subscription is None else int(self._subscription.handle.get_publisher_count())

    def figures(self) -> Figures:
        """Return what has crossed."""
        return self._stats.figures()

    def _forward(self, cdr: bytes, info: Mapping[str, int]) -> None:
        start_ns = time.perf_counter_ns()
        if ECHOES.returned(self._name, cdr):
            return
        self._count_missed(info["publication_sequence_number"])
        try:
            self._seq += 1
            ros1 = self._pair.to_ros1(cdr, seq=self._seq)
            self._count_drops()
            self._publisher.publish(self._raw_class(ros1))
        except Exception as error:  # noqa: BLE001 - whatever garbage a peer sends must not end the executor's thread
            complain(self._stats, self._name, error)
        else:
            self._stats.crossed(time.perf_counter_ns() - start_ns, len(ros1))

    def _count_missed(self, sequence: int) -> None:
        """Count what DDS dropped before we took it: a gap in the publisher's numbers. With several publishers gaps mean nothing."""
        missed = sequence - self._last_sequence - 1
        alone = self._subscription is not None and self._subscription.handle.get_publisher_count() == 1
        if self._last_sequence and missed > 0 and alone:
            self._stats.dropped("arrived faster than they crossed", missed)
        self._last_sequence = sequence

    def _count_drops(self) -> None:
        """Count the connections whose queue is full: publishing now drops the oldest message of each."""
        full = sum(len(connection._queue) >= self._route.depth for connection in self._publisher.impl.connections)  # noqa: SLF001
        if full:
            self._stats.dropped("a subscriber in ROS 1 does not keep up", full)

    def close(self) -> None:
        """Stop receiving, then withdraw the topic from ROS 1."""
        if self._subscription is not None:
            self._node.destroy_subscription(self._subscription)
            ECHOES.forget(self._name)
        self._publisher.unregister()


KINDS: dict[Direction, type[Ros1ToRos2 | Ros2ToRos1]] = {
    Direction.ROS1_TO_ROS2: Ros1ToRos2,
    Direction.ROS2_TO_ROS1: Ros2ToRos1,
}


def make(spec: TopicRoute, context: Context) -> TopicBridge:
    """Make a topic's route, by the native data plane where the layouts agree; raises BridgeError when its type can't cross."""
    pair = context.types.message(spec.type_name, spec.ros2_type)
    if context.plane is not None and pair.same_layout:
        return FastTopic(spec, pair, interface_class(pair.ros2_name, "msg"), context.node, context.plane)
    return KINDS[spec.direction](spec, pair, context.node)
