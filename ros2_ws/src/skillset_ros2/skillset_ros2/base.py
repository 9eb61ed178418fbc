"""What the middleware port over rclpy is built on: a node's executor as the loop, names, subscriptions and service clients."""

from __future__ import annotations

import functools
import queue
import threading
import uuid
from collections.abc import Callable
from typing import Any, TypeVar

from rclpy.callback_groups import MutuallyExclusiveCallbackGroup
from rclpy.event_handler import PublisherEventCallbacks, SubscriptionEventCallbacks
from rclpy.node import Node
from rclpy.qos import QoSProfile

from alula.runtime.middleware import OnValue
from alula.runtime.timers import Job, Timer
from alula.runtime.waiting import Waiter
from alula.runtime.workers import Workers
from skillset_ros2.calls import Calls
from skillset_ros2.empty_wakes import watch_empty_wakes
from skillset_ros2.mission_clock import NodeClock
from skillset_ros2.names import SERVICE
from skillset_ros2.spinning import NodeWaiter
from skillset_ros2.timers import MissionTimers

LOOK_S = 0.05
"""How often (wall clock) the graph is looked at for what it does not tell."""
AT_ONCE = 100
"""So many messages of a topic are taken in one turn of the executor, which by itself takes one."""
QUIET = SubscriptionEventCallbacks(use_default_callbacks=False)
"""For the skillset's own topics, whose both ends are made here: each of rclpy's warnings about the other end's QoS and type is one more
entity that the executor gathers at each of its turns, and more than half of them all. A node made elsewhere gets its own warning."""
QUIET_PUBLISHER = PublisherEventCallbacks(use_default_callbacks=False)
CallbackT = TypeVar("CallbackT", bound=Callable[..., Any])
ID_DIGITS = 12
"""So many hexadecimal digits of a goal's UUID are its execution's id."""


class RestingGroup(MutuallyExclusiveCallbackGroup):  # type: ignore[misc]  # rclpy has no types
    """Runs one callback at a time, and lets entities rest that nothing is awaited of.

    rclpy's executor gathers all entities of a node at each of its turns, so a client of a hundred skills would pay for all of them
    with each message, though it uses one or two. What ``can_execute`` denies is not gathered.
    """

    def __init__(self) -> None:
        super().__init__()
        self.resting: set[Any] = set()

    def can_execute(self, entity: Any) -> bool:
        """Return whether the executor should wait for an entity, and may call back. It is asked of each at each turn: no lock is taken."""
        return entity not in self.resting and self._active_entity is None


class RclpyBase:
    """The loop, names, subscriptions and service clients of one side of one skillset's interface, on a node.

    Callbacks come on the thread that spins the node, in a callback group of their own: with an executor of several threads, other
    callbacks may wait for a skill.

    Args:
        node: whose executor serves it.
        skillset: its name.
        root: what its names begin with, relative to the node's namespace or absolute.
    """

    def __init__(self, node: Node, skillset: str, *, root: str = "") -> None:
        self.node = node
        self.waiter: Waiter = NodeWaiter(node)
        watch_empty_wakes(node)
        self._skillset = skillset
        self._root = root or skillset
        self._group = RestingGroup()
        self._here = threading.local()
        self._clock = NodeClock(node)
        self._timers = MissionTimers(node, self._clock, self._group, self._is_here)
        self._jobs: queue.SimpleQueue[Job] = queue.SimpleQueue()
        self._wake: Any = node.create_guard_condition(self.on_loop(self._work), callback_group=self._group)
        self._workers = Workers(f"{skillset}_hooks", self.log)
        self._calls: dict[str, Calls] = {}
        self._closed = False
        self._ended_ns = 0
        """When this was closed, mission clock: the node may be destroyed afterwards."""

    def now_ns(self) -> int:
        """Return the mission clock, nanoseconds; after the end, the moment of the end."""
        return self._ended_ns or self._clock.now_ns()

    def at(self, when_ns: int, job: Job) -> Timer:
        """Run a job at a moment of the mission clock."""
        return self._timers.at(when_ns, self.on_loop(job))

    def later(self, delay_s: float, job: Job) -> Timer:
        """Run a job after a delay of wall clock."""
        return self._timers.later(delay_s, self.on_loop(job))

    def submit(self, job: Job) -> None:
        """Run a job on the executor."""
        self._jobs.put(job)
        self._wake.trigger()

    def defer(self, job: Job) -> None:
        """Run a job on a thread of its own."""
        self._workers.submit(job)

    def when(self, condition: Callable[[], bool], job: Job) -> None:
        """Run a job once a condition holds."""
        if self._closed:
            return
        if condition():
            self.submit(job)
        else:
            self.later(LOOK_S, lambda: self.when(condition, job))

    def log(self, error: str) -> None:
        """Write an error to the node's log, and so to ``/rosout``."""
        self.node.get_logger().error(error)

    def new_id(self) -> str:
        """Return a random id of ``ID_DIGITS`` hexadecimal digits."""
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

    def name(self, relative: str) -> str:
        """Return a name of the skillset's."""
        return f"{self._root}/{relative}"

    def listen(self, name: str, kind: Any, callback: OnValue, qos: QoSProfile, events: Any = QUIET, every_s: float = 0.0) -> Any:
        """Subscribe; all messages that are there are taken in one turn of the executor.

        With ``every_s`` the subscription rests after a message: those that come within so many seconds of mission clock do not wake the
        executor, and are left out.
        """
        made: list[Any] = []

        def hear(message: Any) -> None:
            callback(message)
            if every_s and made:
                self._group.resting.add(made[0])
                self.at(self.now_ns() + round(every_s * 1e9), go_on)
                return
            for _ in range(AT_ONCE if made else 0):
                with made[0].handle:
                    taken = made[0].handle.take_message(kind, False)
                if taken is None:
                    return
                callback(taken[0])

        def go_on() -> None:
            with made[0].handle:
                while made[0].handle.take_message(kind, True) is not None:
                    pass
            self._await(made[0], True)

        made.append(self.node.create_subscription(kind, name, self.on_loop(hear), qos, callback_group=self._group, event_callbacks=events))
        return made[0]

    def resting_subscription(self, relative: str, kind: Any, callback: OnValue) -> Callable[[bool], None]:
        """Subscribe to what is of interest only now and then; the returned function has the executor wait for it, or not."""
        subscription = self.listen(self.name(relative), kind, callback, QoSProfile(depth=AT_ONCE))
        self._group.resting.add(subscription)
        return functools.partial(self._await, subscription)

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

    def close_hooks(self, timeout_s: float) -> bool:
        """Wait for all deferred jobs."""
        return self._workers.close(timeout_s)

    def close(self) -> None:
        """Ask nothing more; the node's owner destroys what is on it."""
        self._ended_ns = self.now_ns()
        self._closed = True
        for calls in list(self._calls.values()):
            calls.close()
