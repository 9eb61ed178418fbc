"""All managers of one skillset in one rclpy node (paper, section 4.2 and Figure 2)."""

from __future__ import annotations

import importlib
from collections.abc import Callable, Mapping, Sequence
from concurrent.futures import Future, ThreadPoolExecutor
from types import ModuleType
from typing import Any

from rclpy.node import Node
from skillset_interfaces.srv import Describe

from skill_language.json_form import to_json
from skill_language.model import Skillset
from skill_runtime.core.engine import SkillsetEngine
from skill_runtime.core.events import EngineEvent, ExecutionEvent
from skill_runtime.hooks import SkillHooks
from skill_runtime.ros2.data_manager import DataBindings, DataManager
from skill_runtime.ros2.due import DueTimer
from skill_runtime.ros2.names import action_type
from skill_runtime.ros2.resource_manager import EventPublisher, ResourceManager
from skill_runtime.ros2.skill_manager import SkillManager

HooksFactory = Callable[[Node], Mapping[str, SkillHooks]]
FLUSH_S = 1.0
WORKERS = 8
"""Threads for hooks that may wait a bounded time; none is held while a skill runs."""


class SkillsetNode(Node):  # type: ignore[misc]  # rclpy has no types
    """The data manager, the resource manager and the skill managers of a skillset; the node has the skillset's name.

    Hooks are called on worker threads, ``progress`` on the executor's; the executor itself never waits for a hook.

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
        super().__init__(skillset.name, **node_options)
        self._workers = ThreadPoolExecutor(WORKERS, thread_name_prefix=f"{skillset.name}_hooks")
        hooks = hooks_factory(self)
        self.engine = SkillsetEngine(
            skillset,
            lambda: int(self.get_clock().now().nanoseconds),
            hooks,
            self._on_events,
            defer=self._submit,
            on_error=self.get_logger().error,
        )
        self._due = DueTimer(self, self.engine)
        DataManager(self, skillset, _generated_bindings(skillset) if data_bindings is None else data_bindings, self._update_data)
        self._events = EventPublisher(self, skillset.name)
        self._resources = ResourceManager(self, self.engine)
        self._managers = {
            skill.name: SkillManager(self, self.engine, skill, action_type(interfaces, skill.name), hooks[skill.name], self._submit)
            for skill in skillset.skills
        }
        self._model_json = to_json(skillset)
        self.create_service(Describe, f"{skillset.name}/describe", self._describe)

    def close(self, reason: str) -> None:
        """Fail whatever runs for this reason, so that functions are stopped, and take no more requests."""
        self.engine.close(reason)
        self._workers.shutdown(wait=True)
        self._events.flush(FLUSH_S)

    def _update_data(self, name: str, value: object | None) -> None:
        self.engine.update_data(name, value)
        self._due.look()

    def _on_events(self, events: Sequence[EngineEvent]) -> None:
        """Pass on one step: resources before events before results, so that who sees a result sees its effects."""
        self._resources.on_events(events)
        self._events.publish(events)
        for event in events:
            if isinstance(event, ExecutionEvent):
                self._managers[event.skill].on_event(event)
        self._due.look()

    def _submit(self, job: Callable[[], object]) -> None:
        self._workers.submit(job).add_done_callback(self._check)

    def _check(self, future: Future[object]) -> None:
        error = future.exception()
        if error is not None:
            self.get_logger().error(f"{type(error).__name__}: {error}")

    def _describe(self, _: Any, response: Any) -> Any:
        response.model_json = self._model_json
        return response


def _generated_bindings(skillset: Skillset) -> DataBindings:
    if not skillset.data:
        return {}
    bindings: DataBindings = importlib.import_module(f"{skillset.name}_managers.model").DATA_TOPICS
    return bindings
