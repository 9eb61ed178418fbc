"""The skillset interface library (paper, section 4.2), generic: all it needs it gets from ``describe`` and the generated actions."""

from __future__ import annotations

import threading
import time
import uuid
from collections.abc import Callable
from typing import Any

from rclpy.action import ActionClient
from rclpy.clock import Clock, ClockType
from rclpy.event_handler import SubscriptionEventCallbacks
from rclpy.executors import SingleThreadedExecutor
from rclpy.node import Node
from skillset_interfaces.msg import ResourceStates
from skillset_interfaces.srv import Describe
from unique_identifier_msgs.msg import UUID

from skill_language.json_form import from_json
from skill_language.model import Skillset
from skill_runtime.ros2.convert import fields_of, fill
from skill_runtime.ros2.handle import SkillHandle
from skill_runtime.ros2.names import ALIVE, LIVELINESS_LEASE_S, action_module, action_type
from skill_runtime.ros2.skill_manager import execution_id

__all__ = ["SkillHandle", "SkillsetClient"]

TICK_S = 0.05
ACCEPT_TIMEOUT_S = 5.0
"""The managers accept any goal at once; no answer for so long (wall clock) means that there will be none."""


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
        self._ready = threading.Event()
        self._model: Skillset | None = None
        self._actions: dict[str, Any] = {}
        self._clients: dict[str, Any] = {}
        self._resources: dict[str, str] = {}
        self._callbacks: list[Callable[[dict[str, str]], None]] = []
        self._open: dict[SkillHandle, float] = {}
        self._alive = 0
        self._described: Any = None
        self._describe = node.create_client(Describe, f"{name}/describe")
        node.create_subscription(
            ResourceStates,
            f"{name}/resource_states",
            self._on_resources,
            ALIVE,
            event_callbacks=SubscriptionEventCallbacks(liveliness=self._on_liveliness),
        )
        self._timer = node.create_timer(TICK_S, self._tick, clock=Clock(clock_type=ClockType.STEADY_TIME))

    # --- what a mission uses -----------------------------------------------------------------------------------------

    def wait_ready(self, timeout_s: float) -> bool:
        """Wait (wall clock) until the managers can be called; False when they can't within the time.

        Spins the node when it has no executor; otherwise another thread must spin it.
        """
        if self._node.executor is not None:
            return self._ready.wait(timeout_s)
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
        return self._ready.is_set()

    @property
    def model(self) -> Skillset:
        """Return the model that the managers execute; raise RuntimeError before ``wait_ready``."""
        if self._model is None:
            raise RuntimeError(f"the managers of {self.skillset} have not described themselves yet; call wait_ready first")
        return self._model

    @property
    def resources(self) -> dict[str, str]:
        """Return the state of every resource by name; empty until the managers were heard."""
        with self._lock:
            return dict(self._resources)

    def on_change(self, callback: Callable[[dict[str, str]], None]) -> None:
        """Have ``callback(resources)`` called after each step that changed a resource."""
        self._callbacks.append(callback)

    def start(self, skill: str, **inputs: object) -> SkillHandle:
        """Ask for an execution; returns at once. When the managers can't be called, the handle has already FAILED.

        A ``geometry_msgs/Point`` may be given as three numbers.

        Raises:
            ValueError: there is no such skill, or the inputs do not fit; nothing was sent.
        """
        identifier = UUID(uuid=list(uuid.uuid4().bytes))
        handle = SkillHandle(skill, execution_id(identifier))
        if self._model is None:
            handle.fail(f"the managers of {self.skillset} were not found")
            return handle
        goal = self._goal(skill, inputs)
        if not self.ready:
            handle.fail(f"the managers of {self.skillset} are not there")
            return handle
        with self._lock:
            self._open[handle] = time.monotonic()
        handle.add_done_callback(self._forget)
        sent = self._clients[skill].send_goal_async(goal, handle._on_feedback, identifier)  # noqa: SLF001
        sent.add_done_callback(lambda future: self._on_answer(handle, future))
        self._timer.reset()
        return handle

    # --- starting ----------------------------------------------------------------------------------------------------

    def _goal(self, skill: str, inputs: dict[str, object]) -> Any:
        """Make the goal message; raise ValueError when skill or inputs are wrong."""
        if skill not in self._actions:
            raise ValueError(f"skillset {self.skillset} has no skill {skill!r}; it has {', '.join(self._actions)}")
        goal = self._actions[skill].Goal()
        missing = [name for name in fields_of(goal) if name not in inputs]
        if missing:
            raise ValueError(f"inputs of {self.skillset}.{skill}: {', '.join(missing)} missing")
        return fill(goal, inputs, f"inputs of {self.skillset}.{skill}")

    def _on_answer(self, handle: SkillHandle, future: Any) -> None:
        goal = future.result()
        if goal is None or not goal.accepted:
            handle.fail(f"the managers of {self.skillset} did not take the goal")
            return
        handle._accept(goal)  # noqa: SLF001
        goal.get_result_async().add_done_callback(lambda result: handle._on_result(result.result().result))  # noqa: SLF001

    def _forget(self, handle: SkillHandle) -> None:
        with self._lock:
            self._open.pop(handle, None)

    # --- what the managers tell --------------------------------------------------------------------------------------

    def _on_resources(self, message: Any) -> None:
        states = {resource.name: resource.state for resource in message.resources}
        with self._lock:
            self._resources = states
        for callback in self._callbacks:
            callback(dict(states))

    def _on_liveliness(self, info: Any) -> None:
        """Fail what is open when a manager process has gone: cleanly, or without a sign of life for its lease."""
        gone = info.alive_count < self._alive
        self._alive = info.alive_count
        if gone:
            self._ready.clear()
            self._timer.reset()
            for handle in self._opened():
                handle.fail(f"the managers of {self.skillset} have gone: they ended, or gave no sign of life for {LIVELINESS_LEASE_S:g} s")

    def _opened(self) -> dict[SkillHandle, float]:
        with self._lock:
            return dict(self._open)

    def _tick(self) -> None:
        """Get ready; fail handles whose goal was never answered; rest when there is nothing to do."""
        if not self.ready:
            self._get_ready()
        unanswered = {handle: since for handle, since in self._opened().items() if not handle.accepted}
        for handle, since in unanswered.items():
            if time.monotonic() - since > ACCEPT_TIMEOUT_S:
                handle.fail(f"the managers of {self.skillset} did not answer within {ACCEPT_TIMEOUT_S:g} s")
        if self.ready and not unanswered:
            self._timer.cancel()

    def _get_ready(self) -> None:
        if self._described is None and self._describe.service_is_ready():
            self._described = self._describe.call_async(Describe.Request())
            self._described.add_done_callback(self._on_description)
        known = self._model is not None and self._alive > 0 and self._resources
        if known and all(client.server_is_ready() for client in self._clients.values()):
            self._ready.set()

    def _on_description(self, future: Any) -> None:
        model = from_json(future.result().model_json)
        actions = action_module(self.skillset)
        for skill in model.skills:
            self._actions[skill.name] = action_type(actions, skill.name)
            self._clients[skill.name] = ActionClient(self._node, self._actions[skill.name], f"{self.skillset}/skill/{skill.name}")
        self._model = model
