"""The managers of one skillset in processes of their own: the resource manager's node, and a node a skill manager.

Same interface, same behaviour as ``SkillsetNode``: the engine is whole and in the resource manager's process, so each step is
atomic as ever; only the hooks, and the actions that stand before them, are elsewhere (see ``link``). When a skill manager is gone
its executions end as FAILED with their interrupt effect; when the resource manager is gone, the skill managers stop their
functions and end their goals as FAILED; each finds the other again when it is started anew.
"""

from __future__ import annotations

import threading
from collections.abc import Mapping, Sequence
from types import ModuleType
from typing import Any

from rclpy.executors import ExternalShutdownException, ShutdownException, SingleThreadedExecutor
from rclpy.node import Node

from skill_model.model import Skillset
from skill_runtime.core.events import EngineEvent, ExecutionEvent
from skill_runtime.ros2.convert import inputs_from_values, values_from_json
from skill_runtime.ros2.data_manager import DataBindings
from skill_runtime.ros2.manager_node import HooksFactory
from skill_runtime.ros2.names import action_type
from skill_runtime.ros2.remote_engine import RemoteEngine
from skill_runtime.ros2.resource_link import ResourceLink
from skill_runtime.ros2.resource_node import HOOKS_RETURN_S, ResourceNode
from skill_runtime.ros2.skill_link import LinkedHooks, SkillLink
from skill_runtime.ros2.skill_manager import SkillManager
from skill_runtime.workers import Workers


class SeparateResourceNode(ResourceNode):
    """Data manager and resource manager of a skillset whose skill managers are in other processes. Arguments as ``SkillsetNode``."""

    def __init__(
        self, skillset: Skillset, interfaces: ModuleType, *, data_bindings: DataBindings | None = None, **node_options: Any
    ) -> None:
        super().__init__(skillset, **node_options)
        self._actions = {skill.name: action_type(interfaces, skill.name) for skill in skillset.skills}
        self._hooks = LinkedHooks()
        self.serve(self._hooks, data_bindings)
        self._hooks.links = {skill.name: SkillLink(self, self.engine, skill.name) for skill in skillset.skills}

    def make_inputs(self, skill: str, inputs_json: str) -> object:
        """Return the plain values; the skill manager makes its inputs of them."""
        return values_from_json(self._actions[skill], skill, inputs_json)

    def on_step(self, events: Sequence[EngineEvent]) -> None:
        """Tell the skill managers of their executions."""
        for event in events:
            if isinstance(event, ExecutionEvent):
                self._hooks.links[event.skill].tell(event)


class SkillNode(Node):  # type: ignore[misc]  # rclpy has no types
    """One skill manager in a process of its own, node ``<skillset>_<skill>``. Arguments as ``SkillsetNode``."""

    def __init__(self, skillset: Skillset, skill: str, interfaces: ModuleType, hooks_factory: HooksFactory, **node_options: Any) -> None:
        super().__init__(f"{skillset.name}_{skill}", **node_options)
        self._model = skillset.skill(skill)
        self.served_skills = (skill,)
        self.workers = Workers(f"{skillset.name}_{skill}_hooks", self.get_logger().error)
        self._hooks = hooks_factory(self)[skill]
        self._action = action_type(interfaces, skill)
        self.engine = RemoteEngine(
            skillset,
            skill,
            self._hooks,
            self.workers,
            listener=self._on_event,
            inputs_from=self._inputs_from,
            on_error=self.get_logger().error,
        )
        # On a thread of its own, so that whoever waits for a reply, also on this node's executor, gets it.
        options = {name: value for name, value in node_options.items() if name in {"namespace", "context"}}
        self._link_node = Node(f"{skillset.name}_{skill}_link", enable_rosout=False, start_parameter_services=False, **options)
        self._manager: SkillManager | None = None
        self._welcome = self.create_guard_condition(self._serve)
        self.engine.link = ResourceLink(self._link_node, skillset.name, skill, self.engine, self._welcome.trigger)
        self._link_executor = SingleThreadedExecutor(context=self.context)
        self._link_executor.add_node(self._link_node)
        self._link_thread = threading.Thread(target=self._spin_link, name="link", daemon=True)
        self._link_thread.start()

    @property
    def connected(self) -> bool:
        """Tell whether the resource manager is there."""
        return self.engine.link.connected

    def _serve(self) -> None:
        """Serve the action from the first welcome on: who finds it there can call the skill."""
        if self._manager is None:
            self._manager = SkillManager(self, self.engine, self._model, self._action, self._hooks, self.workers.submit)

    def _on_event(self, event: ExecutionEvent) -> None:
        if self._manager is not None:
            self._manager.on_event(event)

    def _inputs_from(self, values: Mapping[str, object]) -> object:
        return inputs_from_values(self._hooks, self._action, self._model.name, values)

    def close(self, reason: str) -> None:
        """Fail whatever runs here for this reason, so that functions are stopped."""
        self.engine.fail_all(reason)
        if not self.workers.close(HOOKS_RETURN_S):
            self.get_logger().error(f"a hook has not returned within {HOOKS_RETURN_S:g} s; it is left behind")

    def destroy_node(self) -> None:
        """End the link, too."""
        self._link_executor.shutdown(timeout_sec=1.0)
        self._link_thread.join(1.0)
        self._link_node.destroy_node()
        super().destroy_node()

    def _spin_link(self) -> None:
        try:
            self._link_executor.spin()
        except (ExternalShutdownException, ShutdownException):
            return
