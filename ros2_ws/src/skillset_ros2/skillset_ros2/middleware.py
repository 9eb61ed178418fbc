"""The middleware port over rclpy."""

from __future__ import annotations

import functools
import importlib
import time
from collections.abc import Callable, Mapping
from typing import Any

import skillset_interfaces.msg
import skillset_interfaces.srv
from rclpy.duration import Duration
from rclpy.event_handler import SubscriptionEventCallbacks
from rclpy.node import Node
from skillset_interfaces.msg import Heartbeat

from alula.common.steady_clock import STEADY_CLOCK
from alula.runtime.codecs import Codecs, ServiceCodec, set_stamp, stamp_ns_of
from alula.runtime.middleware import ALIVE_PERIOD_S, CALL_S, Goal, GoalListener, OnError, OnHeartbeat, OnReply, OnValue, Serve, Topic
from alula.runtime.timers import Job
from skillset_ros2.actions import RclpyLink, RclpyServer
from skillset_ros2.base import QUIET_PUBLISHER, RclpyBase
from skillset_ros2.calls import Calls, Discovery
from skillset_ros2.convert import message_class
from skillset_ros2.names import ALIVE, SERVICE, SOURCE, action_type, in_namespace, latched

EARLY_S = 0.02
"""A heartbeat that is at most so early is sent for the moment that is to come."""


class RclpyMiddleware(RclpyBase):
    """The middleware port over rclpy.

    Args:
        node: whose executor serves it.
        skillset: its name.
        root: what its names begin with, relative to the node's namespace or absolute.
        interfaces: the generated package ``<skillset>_interfaces``, or its module ``action``; imported by name by default.
    """

    def __init__(self, node: Node, skillset: str, *, root: str = "", interfaces: Any = None) -> None:
        super().__init__(node, skillset, root=root)
        self._interfaces = interfaces
        self._codecs = Codecs(skillset_interfaces.msg, skillset_interfaces.srv, message_class, self._clock)
        self._send_heartbeat: Job = lambda: None

    # --- topics ------------------------------------------------------------------------------------------------------

    def advertise(self, topic: Topic) -> RclpyPublisher:
        """Open a topic for publishing."""
        codec = self._codecs.topic(topic)
        made = self.node.create_publisher(codec.kind, self.name(topic.name), latched(topic.depth), event_callbacks=QUIET_PUBLISHER)
        return RclpyPublisher(made, functools.partial(codec.encode, self._skillset))

    def subscribe(self, topic: Topic, callback: OnValue) -> Callable[[], bool]:
        """Follow a topic; the type of a data is asked of the graph where it is not known."""
        if self._closed:
            return lambda: False
        codec = self._codecs.topic(topic)
        take: OnValue = lambda message: callback(codec.decode(message))  # noqa: E731
        if topic.outside:
            self.listen(in_namespace(topic.name), codec.kind, take, SOURCE, events=None, every_s=topic.every_s)
            return lambda: True
        if codec.kind is None:
            self._listen_once_known(topic, take)
            return lambda: True
        self.listen(self.name(topic.name), codec.kind, take, latched(topic.depth), every_s=topic.every_s)
        publishers = self.node.resolve_topic_name(self.name(topic.name))
        return Discovery(lambda: bool(self.node.count_publishers(publishers)))

    def _listen_once_known(self, followed: Topic, callback: OnValue) -> None:
        """Subscribe as soon as the graph tells the topic's type."""
        topic = self.node.resolve_topic_name(self.name(followed.name))
        found: list[str] = []

        def known() -> bool:
            found[:] = sorted({info.topic_type for info in self.node.get_publishers_info_by_topic(topic)})
            return bool(found)

        def listen() -> None:
            try:
                self.listen(topic, message_class(found[0]), callback, latched(followed.depth), every_s=followed.every_s)
            except (ImportError, AttributeError):
                self.log(f"{topic}: no Python package has the type {found[0]}; its values can't be followed here")

        self.when(known, listen)

    # --- services ----------------------------------------------------------------------------------------------------

    def serve(self, service: str, handler: Serve) -> None:
        """Serve a service; its answers may come later, from any thread, and the executor goes on meanwhile."""
        codec = self._codecs.services[service]
        made: Any = self.node.create_service(
            codec.kind, self.name(service), lambda request, _: request, qos_profile=SERVICE, callback_group=self._group
        )
        respond = made.send_response

        def reply(header: Any, value: Any) -> None:
            response = codec.kind.Response()
            codec.encode(value, response)
            if not self._closed:
                respond(response, header)

        def take(request: Any, header: Any) -> None:
            fields = {name: getattr(request, name) for name in codec.fields}
            handler(fields, functools.partial(reply, header))
            if service == "describe":
                # The client may have given these managers up before this answer comes, and DDS tells of no change.
                self._send_heartbeat()

        # What rclpy takes for the sending of the callback's return value is where the request is dealt with.
        made.send_response = self.on_loop(take)

    def call(
        self,
        service: str,
        request: Mapping[str, object],
        on_reply: OnReply,
        on_error: OnError,
        *,
        timeout_s: float = CALL_S,
        once: bool = False,
    ) -> None:
        """Call a service of the skillset, in the codec's plain values; one of the callbacks is called once."""
        codec = self._codecs.services[service]
        decoded: OnReply = lambda response, tries: on_reply(codec.decode(response), tries)  # noqa: E731
        self._calls_of(service, codec).call(codec.kind.Request(**request), decoded, on_error, timeout_s=timeout_s, once=once)

    def prepare_calls(self) -> None:
        """Have DDS discover all services before they are called: the first answer of one that was just discovered may get lost."""
        for service, codec in self._codecs.services.items():
            self._calls_of(service, codec)

    def _calls_of(self, service: str, codec: ServiceCodec) -> Calls:
        return self._calls.get(service) or self.calls(service, codec.kind)

    # --- actions -----------------------------------------------------------------------------------------------------

    def serve_action(self, skill: str, on_goal: Callable[[Goal], None], on_cancel: Callable[[str], None]) -> RclpyServer:
        """Have goals and cancellations of a skill given to the callbacks."""
        return RclpyServer(self, self._action(skill), skill, on_goal, on_cancel)

    def action(self, skill: str, listener: GoalListener) -> RclpyLink:
        """Return a link that sends goals of a skill and gives their news to the listener."""
        return RclpyLink(self, self._action(skill), skill, listener)

    def _action(self, skill: str) -> type:
        if self._interfaces is None:
            self._interfaces = importlib.import_module(f"{self._skillset}_interfaces.action")
        return action_type(self._interfaces, skill)

    # --- heartbeats ----------------------------------------------------------------------------------------------------

    def announce(self, instance_id: str, on_rival: OnError) -> None:
        """Send heartbeats, latched, from the executor: one that hangs goes silent. Those that were there first stay."""
        begun_ns = STEADY_CLOCK.now_ns()
        heartbeat = Heartbeat(instance_id=instance_id)
        told = f"managers of {self._skillset} are there already ({self.node.resolve_topic_name(self.name('alive'))}); end them first"
        later: set[str] = set()

        def hear(other: Any) -> None:
            mine, others = (STEADY_CLOCK.stamp_ns(begun_ns), instance_id), (other.begun_ns, other.instance_id)
            if others[1] != instance_id and others < mine:
                on_rival(told)
            elif others[1] != instance_id and others[1] not in later:
                later.add(others[1])
                self.log(f"other managers of {self._skillset} were started later; they will end")

        def beat() -> None:
            if not self._closed:
                self._send_heartbeat()
                self.later(until_beat_s(time.monotonic()), beat)

        def send() -> None:
            # Both in wall time as that is set now: whoever began first still did when the clock was set meanwhile.
            heartbeat.begun_ns = STEADY_CLOCK.stamp_ns(begun_ns)
            set_stamp(heartbeat.header.stamp, self._clock.stamp_ns(self.now_ns()))
            publisher.publish(heartbeat)

        self.listen(self.name("alive"), Heartbeat, hear, latched(1))
        publisher: Any = self.node.create_publisher(Heartbeat, self.name("alive"), ALIVE, event_callbacks=QUIET_PUBLISHER)
        self._send_heartbeat = send
        beat()

    def watch(self, on_heartbeat: OnHeartbeat, on_doubt: Job) -> None:
        """Follow the heartbeats of the managers, by DDS."""
        last: list[str] = []

        def hear(heartbeat: Any) -> None:
            last[:] = [heartbeat.instance_id]
            self._clock.hear(stamp_ns_of(heartbeat.header.stamp))
            on_heartbeat(heartbeat.instance_id, self._clock.moment_ns(stamp_ns_of(heartbeat.header.stamp)))

        def changed(info: Any) -> None:
            # By the changes: the counts are wrong where both sides are in one process (alive from 0 to -1).
            if info.alive_count_change < 0 or info.not_alive_count_change > 0:
                on_doubt()
            elif info.alive_count_change > 0 and last:
                # Perhaps the managers that were heard last: it may be others that live, whose name comes in a moment.
                on_heartbeat(last[0], 0)

        self.node.create_subscription(
            Heartbeat,
            self.name("alive"),
            self.on_loop(hear),
            ALIVE,
            callback_group=self._group,
            event_callbacks=SubscriptionEventCallbacks(liveliness=self.on_loop(changed), use_default_callbacks=False),
        )


def until_beat_s(now_s: float) -> float:
    """Return how long it is from a moment of the machine's monotonic clock to the next heartbeat.

    All skillsets send theirs at the same moments: whoever hears several wakes once for them.
    """
    left_s = ALIVE_PERIOD_S - now_s % ALIVE_PERIOD_S
    return left_s if left_s > EARLY_S else left_s + ALIVE_PERIOD_S


class RclpyPublisher:
    """Publishes plain values of a topic as its messages."""

    def __init__(self, publisher: Any, encode: Callable[[Any], Any]) -> None:
        self._publisher = publisher
        self._encode = encode

    def publish(self, value: Any) -> None:
        """Encode a value and publish the message."""
        self._publisher.publish(self._encode(value))

    def flush(self, timeout_s: float) -> None:
        """Wait (wall clock) until all subscribers have all messages."""
        self._publisher.wait_for_all_acked(Duration(seconds=timeout_s))
