"""What a client hears of the managers of one skillset over rclpy, and the executions that it follows to their ends."""

from __future__ import annotations

import threading
from collections.abc import Callable
from typing import Any
from weakref import WeakSet

from rclpy.clock import Clock, ClockType
from rclpy.node import Node
from skillset_interfaces.msg import Event, SkillStates

from skill_model.model import Data
from skill_runtime.callbacks import Callbacks
from skill_runtime.handle import SkillHandle
from skill_runtime.ros2.feed import TopicFeed
from skill_runtime.ros2.names import EVENTS, LATCHED, LIVELINESS_LEASE_S
from skill_runtime.ros2.presence import Presence
from skill_runtime.ros2.pursuit import Pursuit
from skill_runtime.ros2.questions import Questions
from skill_runtime.ros2.resting_action import RestingGroup
from skill_runtime.ros2.spinning import SpunHost
from skill_runtime.waiting import Pending

TICK_S = 0.05
OnChange = Callable[[dict[str, str]], None]
OnEvent = Callable[[Any], None]
OnSkills = Callable[[dict[str, Any]], None]


class Tracker:
    """Follows one skillset; all callbacks come on the thread that spins ``node``, in a group of their own.

    Args:
        node: whose executor serves it.
        skillset: its name.
        root: what its topics and services begin with.
    """

    def __init__(self, node: Node, skillset: str, root: str) -> None:
        self.skillset = skillset
        self.host = SpunHost(node)
        self.on_changes: Callbacks[OnChange] = Callbacks()
        self.on_events: Callbacks[OnEvent] = Callbacks()
        self.on_skills: Callbacks[OnSkills] = Callbacks()
        self.resources: dict[str, str] = {}
        self.skills: dict[str, Any] = {}
        self._node = node
        self._root = root
        self._lock = threading.Lock()
        self._open: dict[str, Pursuit] = {}
        self._feeds: dict[str, TopicFeed] = {}
        self._moments: WeakSet[Pending[Any]] = WeakSet()
        group = RestingGroup()
        self._group = group
        self.questions = Questions(node, group, self.host, self._wake)
        self.presence = Presence(
            node,
            skillset,
            on_resources=self._on_resources,
            on_doubt=self._wake,
            on_answer=self._ask_again,
            on_gone=self._on_gone,
            root=root,
            group=group,
        )
        node.create_subscription(Event, f"{root}/events", self._on_event, EVENTS, callback_group=group)
        node.create_subscription(SkillStates, f"{root}/skill_states", self._on_skill_states, LATCHED, callback_group=group)
        # Runs only while there is something to wait for.
        self._timer = node.create_timer(TICK_S, self._tick, callback_group=group, clock=Clock(clock_type=ClockType.STEADY_TIME))

    # --- for the client, from any thread -----------------------------------------------------------------------------

    def pursue(self, pursuit: Pursuit, goal: Any) -> None:
        """Send a goal and follow it to its end."""
        with self._lock:
            self._open[pursuit.handle.id] = pursuit
        pursuit.handle.add_done_callback(self._forget)
        pursuit.send(goal)
        self._wake()

    def feed(self, data: Data) -> TopicFeed:
        """Return the values of a data; it is subscribed to when it is first asked for."""
        with self._lock:
            feed = self._feeds.get(data.name)
            if feed is None:
                feed = self._feeds[data.name] = TopicFeed(self._node, self._root, data, self._group, self.questions)
        if feed.restless:
            feed.tick()
            self._wake()
        return feed

    def moment(self) -> Pending[Any]:
        """Return an answer that nobody has given yet; it fails when the managers go."""
        pending: Pending[Any] = Pending(self.host)
        self._moments.add(pending)
        return pending

    def give_up(self, reason: str) -> None:
        """End every wait for this reason; what runs goes on running."""
        for pursuit in self._pursuits():
            pursuit.abandon(reason)
        self.questions.give_up(reason)
        for moment in list(self._moments):
            moment.fail(reason)

    # --- what is heard -----------------------------------------------------------------------------------------------

    def _on_resources(self, message: Any) -> None:
        self.resources = states = {resource.name: resource.state for resource in message.resources}
        for callback in self.on_changes:
            callback(dict(states))

    def _on_event(self, event: Any) -> None:
        if event.kind == Event.EXECUTION:
            pursuit = self._open.get(event.id)
            if pursuit is not None:
                pursuit.on_event(event)
                if pursuit.restless:
                    self._wake()
        for callback in self.on_events:
            callback(event)

    def _on_skill_states(self, message: Any) -> None:
        self.skills = skills = {skill.name: skill for skill in message.skills}
        for callback in self.on_skills:
            callback(dict(skills))

    def _ask_again(self) -> None:
        """Have each execution's result asked for anew: managers that were started anew answer that they do not know it."""
        for pursuit in self._pursuits():
            pursuit.ask_again()

    def _on_gone(self) -> None:
        self.give_up(f"the managers of {self.skillset} have gone: they ended, or gave no sign of life for {LIVELINESS_LEASE_S:g} s")

    # --- inside ------------------------------------------------------------------------------------------------------

    def _forget(self, handle: SkillHandle) -> None:
        with self._lock:
            self._open.pop(handle.id, None)

    def _pursuits(self) -> list[Pursuit]:
        with self._lock:
            return list(self._open.values())

    def _wake(self) -> None:
        self._timer.reset()

    def _tick(self) -> None:
        if self.presence.restless:
            self.presence.tick()
        workers: list[Any] = [*self._pursuits(), self.questions, *list(self._feeds.values())]
        for worker in workers:
            if worker.restless:
                worker.tick()
        if not self.presence.restless and not any(worker.restless for worker in workers):
            self._timer.cancel()
