"""The middleware port over rclpy: one node, its executor is the loop."""

from __future__ import annotations

import functools
import importlib
import queue
import threading
import time
import uuid
from collections.abc import Callable, Mapping
from typing import Any, TypeVar

from rclpy.callback_groups import MutuallyExclusiveCallbackGroup
from rclpy.clock import Clock, ClockType
from rclpy.duration import Duration
from rclpy.event_handler import PublisherEventCallbacks, SubscriptionEventCallbacks
from rclpy.node import Node
from rclpy.qos import QoSProfile
from std_msgs.msg import Header

from skill_runtime.codecs import SERVICES, TOPICS, set_stamp, stamp_ns_of
from skill_runtime.middleware import CALL_S, Goal, GoalListener, Job, OnError, OnReply, OnSign, OnValue, Serve, Topic
from skill_runtime.plain import message_class
from skill_runtime.ros2.actions import ID_DIGITS, RclpyLink, RclpyServer
from skill_runtime.ros2.alarms import Alarm, Alarms
from skill_runtime.ros2.calls import Calls
from skill_runtime.ros2.empty_wakes import watch_empty_wakes
from skill_runtime.ros2.names import ALIVE, SERVICE, SOURCE, action_type, latched
from skill_runtime.ros2.spinning import SpunHost
from skill_runtime.views import Sample
from skill_runtime.waiting import Host
from skill_runtime.workers import Workers

LOOK_S = 0.05
"""How often (wall clock) the graph is looked at for what it does not tell."""
AT_ONCE = 100
"""So many messages of a topic are taken in one turn of the executor, which by itself takes one."""
QUIET = SubscriptionEventCallbacks(use_default_callbacks=False)
"""For the skillset's own topics, whose both ends are made here: each of rclpy's warnings about the other end's QoS and type is one more
entity that the executor gathers at each of its turns, and more than half of them all. A node made elsewhere gets its own warning."""
CallbackT = TypeVar("CallbackT", bound=Callable[..., Any])


class RestingGroup(MutuallyExclusiveCallbackGroup):  # type: ignore[misc]  # rclpy has no types
    """Runs one callback at a time, and lets entities rest that nothing is awaited of.

    rclpy's executor gathers all entities of a node at each of its turns, so a client of a hundred skills would pay for all of them
    with each message, though it uses one or two. What ``can_execute`` denies is not gathered.
    """

    def __init__(self) -> None:
        super().__init__()
        self.resting: set[Any] = set()

    def can_execute(self, entity: Any) -> bool:
        """Tell whether the executor should wait for an entity, and may call back."""
        return entity not in self.resting and bool(super().can_execute(entity))


class RclpyMiddleware:
    """One side of one skillset's interface, on a node.

    Callbacks come on the thread that spins the node, in a callback group of their own: with an executor of several threads, other
    callbacks may wait for a skill.

    Args:
        node: whose executor serves it.
        skillset: its name.
        root: what its names begin with, relative to the node's namespace or absolute.
        interfaces: the generated package ``<skillset>_interfaces``, or its module ``action``; imported by name by default.
    """

    def __init__(self, node: Node, skillset: str, *, root: str = "", interfaces: Any = None) -> None:
        self.node = node
        self.host: Host = SpunHost(node)
        watch_empty_wakes(node)
        self._skillset = skillset
        self._root = root or skillset
        self._interfaces = interfaces
        self._group = RestingGroup()
        self._here = threading.local()
        self._steady = Clock(clock_type=ClockType.STEADY_TIME)
        self._alarms = Alarms(node, node.get_clock(), self._group, self._is_here)
        self._delays = Alarms(node, self._steady, self._group, self._is_here)
        self._jobs: queue.SimpleQueue[Job] = queue.SimpleQueue()
        self._wake: Any = node.create_guard_condition(self.on_loop(self._work), callback_group=self._group)
        self._workers = Workers(f"{skillset}_hooks", self.log)
        self._calls: dict[str, Calls] = {}
        self._closed = False
        self._give_sign: Job = lambda: None
        self._ended_ns = 0
        """When this was closed, mission clock: the node may be destroyed afterwards."""

    # --- the loop ----------------------------------------------------------------------------------------------------

    def now_ns(self) -> int:
        """Return the mission clock."""
        return self._ended_ns or int(self.node.get_clock().now().nanoseconds)

    def at(self, when_ns: int, job: Job) -> Alarm:
        """Have a job done at a moment of the mission clock."""
        return self._alarms.at(when_ns, self.on_loop(job))

    def later(self, delay_s: float, job: Job) -> Alarm:
        """Have a job done after a delay of wall clock."""
        return self._delays.after(delay_s, self.on_loop(job))

    def submit(self, job: Job) -> None:
        """Have a job done on the executor."""
        self._jobs.put(job)
        self._wake.trigger()

    def defer(self, job: Job) -> None:
        """Have a job done on a thread of its own."""
        self._workers.submit(job)

    def when(self, condition: Callable[[], bool], job: Job) -> None:
        """Have a job done once a condition holds."""
        if self._closed:
            return
        if condition():
            self.submit(job)
        else:
            self.later(LOOK_S, lambda: self.when(condition, job))

    def log(self, error: str) -> None:
        """Log an error."""
        self.node.get_logger().error(error)

    def new_id(self) -> str:
        """Return a random id."""
        return uuid.uuid4().hex[:ID_DIGITS]

    def on_loop(self, callback: CallbackT) -> CallbackT:
        """Mark a callback of the executor: what it sets need not wake the executor."""

        @functools.wraps(callback)
        def call(*arguments: Any) -> Any:
            before, self._here.inside = self._is_here(), True
            try:
                return callback(*arguments)
            finally:
                self._here.inside = before

        return call  # type: ignore[return-value]  # takes what the callback takes

    def _is_here(self) -> bool:
        return getattr(self._here, "inside", False)

    def _work(self) -> None:
        while not self._jobs.empty():
            self._jobs.get()()

    # --- topics ------------------------------------------------------------------------------------------------------

    def name(self, relative: str) -> str:
        """Return a name of the skillset's."""
        return f"{self._root}/{relative}"

    def advertise(self, topic: Topic) -> RclpyPublisher:
        """Open a topic for publishing."""
        if topic.name in TOPICS:
            codec = TOPICS[topic.name]
            kind, encode = codec.kind, functools.partial(codec.encode, self._skillset)
        else:
            kind = message_class(topic.type_name)
            encode = functools.partial(_wrap if topic.wrapped else _value, kind)
        quiet = PublisherEventCallbacks(use_default_callbacks=False)
        return RclpyPublisher(self.node.create_publisher(kind, self.name(topic.name), latched(topic.keep), event_callbacks=quiet), encode)

    def subscribe(self, topic: Topic, callback: OnValue) -> Callable[[], bool]:
        """Follow a topic; the type of a data is asked of the graph where it is not known."""
        if self._closed:
            return lambda: False
        if topic.name in TOPICS:
            codec = TOPICS[topic.name]
            self._listen(self.name(topic.name), codec.kind, lambda message: callback(codec.decode(message)), latched(topic.keep))
            publishers = self.node.resolve_topic_name(self.name(topic.name))
            return lambda: bool(self.node.count_publishers(publishers))
        take: OnValue = lambda message: callback(Sample(message.data if topic.wrapped else message, None))  # noqa: E731
        if topic.outside:
            self._listen(topic.name, message_class(topic.type_name), take, SOURCE, events=None)
        else:
            self._listen_once_known(self.name(topic.name), take, latched(topic.keep))
        return lambda: True

    def _listen(self, name: str, kind: Any, callback: OnValue, qos: QoSProfile, events: Any = QUIET) -> Any:
        """Subscribe; all messages that are there are taken in one turn of the executor."""
        made: list[Any] = []

        def hear(message: Any) -> None:
            callback(message)
            for _ in range(AT_ONCE if made else 0):
                with made[0].handle:
                    taken = made[0].handle.take_message(kind, False)
                if taken is None:
                    return
                callback(taken[0])

        made.append(self.node.create_subscription(kind, name, self.on_loop(hear), qos, callback_group=self._group, event_callbacks=events))
        return made[0]

    def _listen_once_known(self, name: str, callback: OnValue, qos: QoSProfile) -> None:
        """Subscribe as soon as the graph tells the topic's type."""
        topic = self.node.resolve_topic_name(name)
        found: list[str] = []

        def known() -> bool:
            found[:] = sorted({info.topic_type for info in self.node.get_publishers_info_by_topic(topic)})
            return bool(found)

        def listen() -> None:
            try:
                self._listen(topic, message_class(found[0]), callback, qos)
            except (ImportError, AttributeError):
                self.log(f"{topic}: no Python package has the type {found[0]}; its values can't be followed here")

        self.when(known, listen)

    def resting_subscription(self, relative: str, kind: Any, callback: OnValue) -> Callable[[bool], None]:
        """Subscribe to what is of interest only now and then; the returned function has the executor wait for it, or not."""
        subscription = self._listen(self.name(relative), kind, callback, QoSProfile(depth=AT_ONCE))
        self._group.resting.add(subscription)
        return functools.partial(self._await, subscription)

    # --- services ----------------------------------------------------------------------------------------------------

    def serve(self, service: str, handler: Serve) -> None:
        """Serve a service; its answers may come later, from any thread, and the executor goes on meanwhile."""
        codec = SERVICES[service]
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
                # Who asks may have given these managers up before this answer comes, and DDS tells of no change.
                self._give_sign()

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
        """Call a service."""
        codec = SERVICES[service]
        calls = self._calls.get(service) or self.calls(service, codec.kind)
        decoded: OnReply = lambda response, tries: on_reply(codec.decode(response), tries)  # noqa: E731
        calls.call(codec.kind.Request(**request), decoded, on_error, timeout_s=timeout_s, once=once)

    def prepare(self, service: str) -> None:
        """Have DDS discover a service early: the first answer of one that was just met may get lost."""
        self.calls(service, SERVICES[service].kind)

    def calls(self, relative: str, kind: Any) -> Calls:
        """Make a client of a service; the executor waits for it only while an answer is due."""
        client = self.node.create_client(kind, self.name(relative), qos_profile=SERVICE, callback_group=self._group)
        self._group.resting.add(client)
        made = Calls(client, self.later, functools.partial(self._await, client))
        self._calls[relative] = made
        return made

    def _await(self, entity: Any, awaited: bool) -> None:  # noqa: FBT001 - one of two
        """Have an entity rest or not; an executor that waits without one that is awaited now has to gather its entities again."""
        if not awaited:
            self._group.resting.add(entity)
        elif entity in self._group.resting:
            self._group.resting.discard(entity)
            executor = self.node.executor
            if executor is not None and not self._is_here():
                executor.wake()

    # --- actions -----------------------------------------------------------------------------------------------------

    def serve_action(self, skill: str, on_goal: Callable[[Goal], None], on_cancel: Callable[[str], None]) -> RclpyServer:
        """Serve a skill."""
        return RclpyServer(self, self._action(skill), skill, on_goal, on_cancel)

    def action(self, skill: str, listener: GoalListener) -> RclpyLink:
        """Connect to a skill."""
        return RclpyLink(self, self._action(skill), skill, listener)

    def _action(self, skill: str) -> type:
        if self._interfaces is None:
            self._interfaces = importlib.import_module(f"{self._skillset}_interfaces.action")
        return action_type(self._interfaces, skill)

    # --- life --------------------------------------------------------------------------------------------------------

    def announce(self, life: str, on_rival: OnError) -> None:
        """Tell of these managers, latched; DDS itself sends the signs of life. Those that were there first stay."""
        begun_ns = time.time_ns()
        sign = Header(frame_id=life)
        set_stamp(sign.stamp, begun_ns)
        told = f"managers of {self._skillset} are there already ({self.node.resolve_topic_name(self.name('alive'))}); end them first"

        def hear(other: Any) -> None:
            mine, others = (begun_ns, life), (stamp_ns_of(other.stamp), other.frame_id)
            if others[1] != life and others < mine:
                on_rival(told)
            elif others[1] != life:
                self.log(f"second managers of {self._skillset} were started; they have to end")

        self._listen(self.name("alive"), Header, hear, latched(1))
        publisher: Any = self.node.create_publisher(Header, self.name("alive"), ALIVE)
        self._give_sign = lambda: publisher.publish(sign)
        self._give_sign()

    def watch(self, on_sign: OnSign, on_doubt: Job) -> None:
        """Be told of the life of managers, by DDS."""
        last: list[str] = []

        def hear(sign: Any) -> None:
            last[:] = [sign.frame_id]
            on_sign(sign.frame_id, 0)

        def changed(info: Any) -> None:
            # By the changes: the counts are wrong where both sides are in one process (alive from 0 to -1).
            if info.alive_count_change < 0 or info.not_alive_count_change > 0:
                on_doubt()
            elif info.alive_count_change > 0 and last:
                # Those who were heard last, perhaps: it may be others that live, whose name comes in a moment.
                on_sign(last[0], 0)

        self.node.create_subscription(
            Header,
            self.name("alive"),
            self.on_loop(hear),
            ALIVE,
            callback_group=self._group,
            event_callbacks=SubscriptionEventCallbacks(liveliness=self.on_loop(changed), use_default_callbacks=False),
        )

    def close_hooks(self, timeout_s: float) -> bool:
        """Wait for all deferred jobs."""
        return self._workers.close(timeout_s)

    def close(self) -> None:
        """Ask nothing more; the node's owner destroys what is on it."""
        self._ended_ns = self.now_ns()
        self._closed = True
        for calls in list(self._calls.values()):
            calls.close()


class RclpyPublisher:
    """A topic's writing end."""

    def __init__(self, publisher: Any, encode: Callable[[Any], Any]) -> None:
        self._publisher = publisher
        self._encode = encode

    def publish(self, value: Any) -> None:
        """Send a value."""
        self._publisher.publish(self._encode(value))

    def flush(self, timeout_s: float) -> None:
        """Wait (wall clock) until all who listen have all messages."""
        self._publisher.wait_for_all_acked(Duration(seconds=timeout_s))


def _value(kind: Any, sample: Sample) -> Any:  # noqa: ARG001 - as where it is wrapped
    return sample.value


def _wrap(kind: Any, sample: Sample) -> Any:
    return kind(data=sample.value)
