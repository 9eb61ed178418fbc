"""What one node of a skillset always has: data manager, resource manager, events, and the answers to questions.

How the hooks of the skills are reached is for the subclasses: in this process (``manager_node``) or in others (``separate``).
"""

from __future__ import annotations

import importlib
from abc import abstractmethod
from collections.abc import Mapping, Sequence
from typing import Any

from rclpy.node import Node
from skillset_interfaces.srv import Describe

from skill_model.json_form import to_json
from skill_model.model import Skillset
from skill_runtime.core.engine import DEFAULT_TIMEOUT_S, SkillsetEngine
from skill_runtime.core.errors import SkillRuntimeError
from skill_runtime.core.events import EngineEvent
from skill_runtime.core.hook_calls import HookCaller
from skill_runtime.hooks import SkillHooks
from skill_runtime.ros2.answers import Answers
from skill_runtime.ros2.data_manager import DataBindings, DataManager
from skill_runtime.ros2.due import DueTimer
from skill_runtime.ros2.resource_manager import EventPublisher, ResourceManager
from skill_runtime.ros2.skill_states import SkillStatesPublisher
from skill_runtime.workers import Workers

FLUSH_S = 1.0
HOOKS_RETURN_S = 5.0
"""How long (wall clock) the end of the managers waits for hooks that have not returned."""


class ResourceNode(Node):  # type: ignore[misc]  # rclpy has no types
    """The node of a skillset's resource manager; its name is the skillset's. Parameter: ``interrupt_timeout_s``."""

    engine: SkillsetEngine

    def __init__(self, skillset: Skillset, **node_options: Any) -> None:
        super().__init__(skillset.name, **node_options)
        self.skillset = skillset
        self.workers = Workers(f"{skillset.name}_hooks", self.get_logger().error)

    def serve(self, hooks: Mapping[str, SkillHooks] | HookCaller, data_bindings: DataBindings | None) -> None:
        """Make the engine and all that is served of it; called once, at the end of a subclass's construction."""
        timeout_s = float(self.declare_parameter("interrupt_timeout_s", DEFAULT_TIMEOUT_S).value)
        if not timeout_s > 0:
            raise SkillRuntimeError(f"parameter interrupt_timeout_s is {timeout_s:g}; a stop needs a positive time")
        skillset = self.skillset
        self.engine = SkillsetEngine(
            skillset,
            lambda: int(self.get_clock().now().nanoseconds),
            hooks,
            self._on_events,
            defer=self.workers.submit,
            on_error=self.get_logger().error,
            interrupt_timeout_s=timeout_s,
        )
        self._due = DueTimer(self, self.engine)
        DataManager(self, skillset, _generated_bindings(skillset) if data_bindings is None else data_bindings, self._update_data)
        self._events = EventPublisher(self, skillset.name)
        self._resources = ResourceManager(self, self.engine)
        self._skill_states = SkillStatesPublisher(self, skillset)
        Answers(self, self.engine, self.workers, self.make_inputs)
        self._model_json = to_json(skillset)
        self.create_service(Describe, f"{skillset.name}/describe", self._describe)

    @abstractmethod
    def make_inputs(self, skill: str, inputs_json: str) -> object:
        """Make what ``validate`` of a skill gets; raise ValueError where the JSON does not fit."""

    @abstractmethod
    def on_step(self, events: Sequence[EngineEvent]) -> None:
        """Pass one step on to the skill managers."""

    def close(self, reason: str) -> None:
        """Fail whatever runs for this reason, so that functions are stopped, and take no more requests."""
        self.engine.close(reason)
        if not self.workers.close(HOOKS_RETURN_S):
            self.get_logger().error(f"a hook has not returned within {HOOKS_RETURN_S:g} s; it is left behind")
        self._skill_states.publish()
        self._events.flush(FLUSH_S)

    def _on_events(self, events: Sequence[EngineEvent]) -> None:
        """Pass on one step: resources before events before results, so that who sees a result sees its effects."""
        self._resources.on_events(events)
        self._events.publish(events)
        self.on_step(events)
        self._skill_states.on_events(events)
        self._due.look()

    def _update_data(self, name: str, value: object | None) -> None:
        self.engine.update_data(name, value)
        self._due.look()

    def _describe(self, _: Any, response: Any) -> Any:
        response.model_json = self._model_json
        return response


def _generated_bindings(skillset: Skillset) -> DataBindings:
    if not skillset.data:
        return {}
    bindings: DataBindings = importlib.import_module(f"{skillset.name}_managers.model").DATA_TOPICS
    return bindings
