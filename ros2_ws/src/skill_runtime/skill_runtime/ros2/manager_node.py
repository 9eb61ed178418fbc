"""All managers of one skillset in one rclpy node (paper, section 4.2 and Figure 2)."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from types import ModuleType
from typing import Any

from rclpy.node import Node

from skill_model.model import Skillset
from skill_runtime.core.events import EngineEvent, ExecutionEvent
from skill_runtime.hooks import SkillHooks
from skill_runtime.ros2.convert import inputs_from_values, values_from_json
from skill_runtime.ros2.data_manager import DataBindings
from skill_runtime.ros2.names import action_type
from skill_runtime.ros2.resource_node import ResourceNode
from skill_runtime.ros2.skill_manager import SkillManager

HooksFactory = Callable[[Node], Mapping[str, SkillHooks]]


class SkillsetNode(ResourceNode):
    """The data manager, the resource manager and the skill managers of a skillset; the node has the skillset's name.

    Hooks are called on threads of their own, ``progress`` on the executor's; the executor itself never waits for a hook.

    Args:
        skillset: the model.
        interfaces: the generated package ``<skillset>_interfaces``, or its module ``action``.
        hooks_factory: makes the hooks, one a skill, with this node at hand.
        data_bindings: where each data of the model comes from; by default the generated ``<skillset>_managers.model.DATA_TOPICS``.
        node_options: passed on to ``rclpy.node.Node`` (``namespace``, ``parameter_overrides``, ``context``).

    Raises:
        SkillRuntimeError: a skill has no hooks, or a data no binding.
        AttributeError: the interfaces have no action for a skill.
    """

    def __init__(
        self,
        skillset: Skillset,
        interfaces: ModuleType,
        hooks_factory: HooksFactory,
        *,
        data_bindings: DataBindings | None = None,
        **node_options: Any,
    ) -> None:
        super().__init__(skillset, **node_options)
        self.served_skills = tuple(skill.name for skill in skillset.skills)
        self._hooks = hooks_factory(self)
        self._actions = {name: action_type(interfaces, name) for name in self.served_skills}
        self._managers: dict[str, SkillManager] = {}
        self.serve(self._hooks, data_bindings)
        for skill in skillset.skills:
            hooks = self._hooks[skill.name]
            self._managers[skill.name] = SkillManager(self, self.engine, skill, self._actions[skill.name], hooks, self.workers.submit)

    def make_inputs(self, skill: str, inputs_json: str) -> object:
        """Make what ``validate`` of a skill gets."""
        action = self._actions[skill]
        return inputs_from_values(self._hooks[skill], action, skill, values_from_json(action, skill, inputs_json))

    def on_step(self, events: Sequence[EngineEvent]) -> None:
        """Have the skill managers follow their executions."""
        for event in events:
            if isinstance(event, ExecutionEvent):
                self._managers[event.skill].on_event(event)
