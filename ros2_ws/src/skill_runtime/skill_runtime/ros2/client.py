"""The skillset interface library (paper, section 4.2), generic: all it needs it gets from ``describe`` and the generated actions."""

from __future__ import annotations

import threading
import time
from collections.abc import Callable
from typing import Any

from rclpy.clock import Clock, ClockType
from rclpy.executors import SingleThreadedExecutor
from rclpy.node import Node
from skillset_interfaces.msg import Event

from skill_language.model import Skillset
from skill_runtime.handle import SkillHandle
from skill_runtime.ros2.convert import fields_of, fill
from skill_runtime.ros2.names import EVENTS, LIVELINESS_LEASE_S
from skill_runtime.ros2.presence import Presence
from skill_runtime.ros2.pursuit import Pursuit

__all__ = ["SkillHandle", "SkillsetClient"]

TICK_S = 0.05
OnChange = Callable[[dict[str, str]], None]


class SkillsetClient:
    """Starts, watches and interrupts the skills of one skillset, and follows its resources.

    Nothing here waits but ``wait_ready``. Callbacks come on the thread that spins ``node``.

    Args:
        node: whose executor serves the client.
        name: the skillset; relative to the node's namespace.
    """

    def __init__(self, node: Node, name: str) -> None:
        self.skillset = name
        self._node = node
        self._lock = threading.Lock()
        self._resources: dict[str, str] = {}
        self._callbacks: list[OnChange] = []
        self._open: dict[str, Pursuit] = {}
        self._presence = Presence(
            node, name, on_resources=self._on_resources, on_doubt=self._wake, on_answer=self._ask_again, on_gone=self._on_gone
        )
        node.create_subscription(Event, f"{name}/events", self._on_event, EVENTS)
        # Runs only while there is something to wait for.
        self._timer = node.create_timer(TICK_S, self._tick, clock=Clock(clock_type=ClockType.STEADY_TIME))

    def wait_ready(self, timeout_s: float) -> bool:
        """Wait (wall clock) until the managers can be called; False when they can't within the time.

        Spins the node when it has no executor; otherwise another thread must be spinning it.
        """
        if self._node.executor is not None:
            return self._presence.ready.wait(timeout_s)
        executor = SingleThreadedExecutor(context=self._node.context)
        executor.add_node(self._node)
        try:
            end = time.monotonic() + timeout_s
            while not self.ready and (left := end - time.monotonic()) > 0:
                executor.spin_once(timeout_sec=left)
        finally:
            executor.remove_node(self._node)
            executor.shutdown()
            self._node.executor = None
        return self.ready

    @property
    def ready(self) -> bool:
        """Tell whether the managers are alive, known and can be called."""
        return self._presence.ready.is_set()

    @property
    def model(self) -> Skillset:
        """Return the model that the managers execute; raise RuntimeError before ``wait_ready``."""
        if self._presence.model is None:
            raise RuntimeError(f"the managers of {self.skillset} have not described themselves yet; call wait_ready first")
        return self._presence.model

    @property
    def resources(self) -> dict[str, str]:
        """Return the state of every resource by name; empty until the managers were heard."""
        with self._lock:
            return dict(self._resources)

    def on_change(self, callback: OnChange) -> None:
        """Have ``callback(resources)`` called after each step that changed a resource."""
        self._callbacks.append(callback)

    def start(self, skill: str, **inputs: object) -> SkillHandle:
        """Ask for an execution; returns at once. When the managers can't be called, the handle has already FAILED.

        A ``geometry_msgs/Point`` may be given as three numbers.

        Raises:
            ValueError: there is no such skill, or the inputs do not fit; nothing was sent.
        """
        if self._presence.model is None:
            return self._stillborn(skill)
        goal = self._goal(skill, inputs)
        if not self.ready:
            return self._stillborn(skill)
        pursuit = Pursuit(self.skillset, skill, self._presence.actions[skill], self._presence.clients[skill])
        with self._lock:
            self._open[pursuit.handle.id] = pursuit
        pursuit.handle.add_done_callback(self._forget)
        pursuit.send(goal)
        self._timer.reset()
        return pursuit.handle

    def _goal(self, skill: str, inputs: dict[str, object]) -> Any:
        """Make the goal message; raise ValueError when skill or inputs are wrong."""
        actions = self._presence.actions
        if skill not in actions:
            raise ValueError(f"skillset {self.skillset} has no skill {skill!r}; it has {', '.join(actions)}")
        goal = actions[skill].Goal()
        place = f"inputs of {self.skillset}.{skill}"
        fill(goal, inputs, place)
        missing = [name for name in fields_of(goal) if name not in inputs]
        if missing:
            raise ValueError(f"{place}: {', '.join(missing)} missing")
        return goal

    def _stillborn(self, skill: str) -> SkillHandle:
        handle = SkillHandle(skill, "")
        handle.fail(f"the managers of {self.skillset} are not there")
        return handle

    def _forget(self, handle: SkillHandle) -> None:
        with self._lock:
            self._open.pop(handle.id, None)

    def _pursuits(self) -> list[Pursuit]:
        with self._lock:
            return list(self._open.values())

    def _on_resources(self, message: Any) -> None:
        states = {resource.name: resource.state for resource in message.resources}
        with self._lock:
            self._resources = states
        for callback in self._callbacks:
            callback(dict(states))

    def _on_event(self, event: Any) -> None:
        pursuit = self._open.get(event.id) if event.kind == Event.EXECUTION else None
        if pursuit is not None:
            pursuit.on_event(event)
            if pursuit.restless:
                self._timer.reset()

    def _wake(self) -> None:
        self._timer.reset()

    def _ask_again(self) -> None:
        """Have each execution's result asked for anew: managers that were started anew answer that they do not know it."""
        for pursuit in self._pursuits():
            pursuit.ask_again()

    def _on_gone(self) -> None:
        reason = f"the managers of {self.skillset} have gone: they ended, or gave no sign of life for {LIVELINESS_LEASE_S:g} s"
        for pursuit in self._pursuits():
            pursuit.abandon(reason)

    def _tick(self) -> None:
        if self._presence.restless:
            self._presence.tick()
        for pursuit in self._pursuits():
            pursuit.tick()
        if not self._presence.restless and not any(pursuit.restless for pursuit in self._pursuits()):
            self._timer.cancel()
