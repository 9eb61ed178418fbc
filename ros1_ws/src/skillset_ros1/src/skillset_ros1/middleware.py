"""The middleware port over rospy."""

from __future__ import annotations

import functools
import importlib
import queue
import threading
import time
from collections import deque
from collections.abc import Callable, Mapping
from types import ModuleType
from typing import Any

import rospy
import skillset_interfaces.msg
import skillset_interfaces.srv
from roslib.message import get_message_class
from skillset_interfaces.msg import Heartbeat

from alula.common.steady_clock import STEADY_CLOCK
from alula.runtime.codecs import Codecs, set_stamp, stamp_ns_of
from alula.runtime.middleware import (
    ALIVE_PERIOD_S,
    CALL_S,
    Goal,
    GoalListener,
    OnError,
    OnHeartbeat,
    OnReply,
    OnValue,
    Serve,
    Topic,
    thinned,
)
from alula.runtime.timers import Job
from skillset_ros1.actions import RospyLink, RospyServer, is_connected
from skillset_ros1.base import RospyBase
from skillset_ros1.calls import call
from skillset_ros1.convert import message_class
from skillset_ros1.names import QUEUE, action_types

LEASE_S = 2.0
"""Without a heartbeat for so long (wall clock), managers are doubted, as in the ROS 2 world."""
BROKEN_LEASE_S = 1.5 * ALIVE_PERIOD_S
"""The same where also the connection over which the heartbeats come is broken."""
WATCH_S = 0.25
ANSWER_S = 60.0
"""An answer to a service that has not come for so long will not come; the managers themselves give their hooks less."""
SOURCE_QUEUE = 10
FLUSH_STEP_S = 0.02
QUIET_S = 0.1


class RospyMiddleware(RospyBase):
    """The middleware port over rospy.

    Args:
        skillset: its name.
        place: what its names begin with, absolute.
        interfaces: the generated package ``<skillset>_interfaces``, or its module ``msg``; imported by name by default.
    """

    def __init__(self, skillset: str, place: str, interfaces: ModuleType | None = None) -> None:
        super().__init__(skillset, place, f"the client of {skillset}" if interfaces is None else f"the managers of {skillset}")
        self._interfaces = interfaces
        self._codecs = Codecs(skillset_interfaces.msg, skillset_interfaces.srv, message_class, self._clock)

    # --- topics ------------------------------------------------------------------------------------------------------

    def advertise(self, topic: Topic) -> RospyPublisher:
        """Open a topic for publishing."""
        codec = self._codecs.topic(topic)
        publisher = RospyPublisher(self.name(topic.name), codec.kind, functools.partial(codec.encode, self._skillset), topic.depth)
        self._parts.append(publisher.unregister)
        return publisher

    def subscribe(self, topic: Topic, callback: OnValue) -> Callable[[], bool]:
        """Follow a topic; the type of a data comes with each message."""
        codec = self._codecs.topic(topic)
        take = thinned(lambda message: callback(codec.decode(message)), topic, self.now_ns)
        if topic.outside:
            self.listen(topic.name, codec.kind, take, queue_size=SOURCE_QUEUE)
            return lambda: True
        if codec.kind is None:
            self.listen(self.name(topic.name), rospy.AnyMsg, lambda raw: self._take_raw(topic, raw, take))
            return lambda: True
        subscriber = self.listen(self.name(topic.name), codec.kind, take)
        return lambda: is_connected(subscriber, self.server)

    def _take_raw(self, topic: Topic, raw: Any, take: OnValue) -> None:
        type_name = raw._connection_header["type"]  # noqa: SLF001 - rospy's way to tell
        kind = get_message_class(type_name)
        if kind is None:
            rospy.logwarn_once(f"{topic.name}: no Python package has the type {type_name}; its values can't be followed here")
            return
        take(kind().deserialize(raw._buff))  # noqa: SLF001 - the bytes of an AnyMsg

    # --- services ----------------------------------------------------------------------------------------------------

    def serve(self, service: str, handler: Serve) -> None:
        """Serve a service; each call has a thread of rospy's, which waits for its answer."""
        codec = self._codecs.services[service]

        def answer(request: Any) -> Any:
            replies: queue.SimpleQueue[Any] = queue.SimpleQueue()
            fields = {name: getattr(request, name) for name in codec.fields}
            self.submit(lambda: handler(fields, replies.put))
            try:
                value = replies.get(timeout=ANSWER_S)
            except queue.Empty:
                raise rospy.ServiceException(f"{service} was not answered within {ANSWER_S:g} s") from None
            response = codec.kind._response_class()  # noqa: SLF001 - genpy's way to tell
            codec.encode(value, response)
            return response

        self._parts.append(rospy.Service(self.name(service), codec.kind, answer).shutdown)

    def call(
        self,
        service: str,
        request: Mapping[str, object],
        on_reply: OnReply,
        on_error: OnError,
        *,
        timeout_s: float = CALL_S,
        once: bool = False,  # noqa: ARG002 - no answer gets lost that its caller could ask for again
    ) -> None:
        """Call a service of the skillset on a thread of its own; one of the callbacks is called, in the loop."""
        codec = self._codecs.services[service]
        reply: OnValue = lambda response: self.submit(lambda: on_reply(codec.decode(response), 1))  # noqa: E731
        error: OnError = lambda reason: self.submit(lambda: on_error(reason))  # noqa: E731
        message = codec.kind._request_class(**request)  # noqa: SLF001 - genpy's way to tell
        call(self.name(service), codec.kind, message, reply, error, timeout_s=timeout_s)

    # --- actions -----------------------------------------------------------------------------------------------------

    def serve_action(self, skill: str, on_goal: Callable[[Goal], None], on_cancel: Callable[[str], None]) -> RospyServer:
        """Pass goals and cancellations of a skill to the callbacks."""
        server = RospyServer(self, action_types(self._messages, skill), skill, on_goal, on_cancel)
        self._parts.append(server.unregister)
        return server

    def action(self, skill: str, listener: GoalListener) -> RospyLink:
        """Return a link that sends goals of a skill and passes their events to the listener."""
        link = RospyLink(self, action_types(self._messages, skill), skill, listener)
        self._parts.append(link.unregister)
        return link

    @property
    def _messages(self) -> ModuleType:
        if self._interfaces is None:
            self._interfaces = importlib.import_module(f"{self._skillset}_interfaces.msg")
        return self._interfaces

    # --- heartbeats ----------------------------------------------------------------------------------------------------

    def announce(self, instance_id: str, on_rival: OnError) -> None:  # noqa: ARG002 - the master tells of rivals before
        """Send heartbeats from a thread of their own: simulated time may stand still, and hooks be slow."""
        publisher = rospy.Publisher(self.name("alive"), Heartbeat, latch=True, queue_size=1)
        self._parts.append(publisher.unregister)
        begun_ns = STEADY_CLOCK.now_ns()

        def beat() -> None:
            while not self._over.is_set() and not rospy.is_shutdown():
                heartbeat = Heartbeat(instance_id=instance_id, begun_ns=STEADY_CLOCK.stamp_ns(begun_ns))
                set_stamp(heartbeat.header.stamp, self._clock.stamp_ns(self._clock.now_ns()))
                publisher.publish(heartbeat)
                self._over.wait(ALIVE_PERIOD_S)

        threading.Thread(target=beat, name=f"{self._place}_alive", daemon=True).start()

    def watch(self, on_heartbeat: OnHeartbeat, on_doubt: Job) -> None:
        """Follow the heartbeats of the managers, and of their silence, once in a lease."""
        heard_s: list[float] = []

        def hear(heartbeat: Any) -> None:
            self.server = heartbeat._connection_header["callerid"]  # noqa: SLF001 - rospy's way to tell the sender
            heard_s[:] = [time.monotonic()]
            self._clock.hear(stamp_ns_of(heartbeat.header.stamp))
            on_heartbeat(heartbeat.instance_id, self._clock.moment_ns(stamp_ns_of(heartbeat.header.stamp)))

        heartbeats = self.listen(self.name("alive"), Heartbeat, hear)

        def look() -> None:
            lease_s = LEASE_S if is_connected(heartbeats) else BROKEN_LEASE_S
            if heard_s and time.monotonic() - heard_s[0] > lease_s:
                heard_s[:] = [time.monotonic()]
                on_doubt()
            self.later(WATCH_S, look)

        self.later(WATCH_S, look)


class RospyPublisher(rospy.SubscribeListener):  # type: ignore[misc]  # rospy has no types
    """A topic's writing end, with a history for late subscribers.

    A latched topic of ROS 1 keeps one message. Where more are to be kept, every new subscriber is sent what the others have had, as
    a transient local topic of ROS 2 would; a message that is published in that very moment may come before, and once more within it.
    """

    def __init__(self, name: str, kind: Any, encode: Callable[[Any], Any], depth: int) -> None:
        super().__init__()
        self._encode = encode
        self._lock = threading.Lock()
        self._history: deque[Any] = deque(maxlen=depth)
        options = {"latch": True} if depth == 1 else {"subscriber_listener": self}
        self._publisher: Any = rospy.Publisher(name, kind, queue_size=QUEUE, **options)

    def publish(self, value: Any) -> None:
        """Publish a value, and keep it for subscribers that come later."""
        message = self._encode(value)
        with self._lock:
            self._history.append(message)
            self._publisher.publish(message)

    def peer_subscribe(self, topic_name: str, topic_publish: OnValue, peer_publish: OnValue) -> None:  # noqa: ARG002
        """Send the history to a new subscriber."""
        with self._lock:
            for message in self._history:
                peer_publish(message)

    def flush(self, timeout_s: float) -> None:
        """Wait (wall clock) until all was handed to the network.

        rospy doesn't report when its sending threads have done their work: nothing was left to send for a while.
        """
        end = time.monotonic() + timeout_s
        quiet_since = time.monotonic()
        while (now := time.monotonic()) < end and now - quiet_since < QUIET_S and self._publisher.get_num_connections():
            if any(getattr(connection, "_queue", None) for connection in self._publisher.impl.connections):
                quiet_since = now
            time.sleep(FLUSH_STEP_S)

    def unregister(self) -> None:
        """Unregister the publisher at the master."""
        self._publisher.unregister()
