"""All managers of one skillset in one rospy node (paper, section 4.2 and Figure 2)."""

from __future__ import annotations

import importlib
import uuid
from collections.abc import Callable, Mapping, Sequence
from concurrent.futures import Future, ThreadPoolExecutor
from types import ModuleType
from typing import Any

import rospy
from skillset_interfaces.srv import Describe, DescribeResponse

from skill_language.json_form import to_json
from skill_language.model import Skillset
from skill_runtime.core.engine import SkillsetEngine
from skill_runtime.core.events import EngineEvent, ExecutionEvent
from skill_runtime.hooks import SkillHooks
from skillset_ros1.alarms import Alarms
from skillset_ros1.data_manager import DataBindings, DataManager
from skillset_ros1.due import DueAlarm
from skillset_ros1.events import EventPublisher
from skillset_ros1.heartbeat import Heartbeat
from skillset_ros1.names import action_types, now_ns, place
from skillset_ros1.resource_manager import ResourceManager
from skillset_ros1.skill_manager import SkillManager

FLUSH_S = 1.0
WORKERS = 8
"""Threads for hooks that may wait a bounded time; none is held while a skill runs."""


class SkillsetManagers:
    """The data manager, the resource manager and the skill managers of a skillset, in this process's rospy node.

    Hooks are called on worker threads; nothing of the node waits for one.

    Args:
        skillset: the model.
        interfaces: the generated package ``<skillset>_interfaces``, or its module ``msg``.
        hooks_factory: makes the hooks, one a skill, with these managers at hand.
        data_bindings: where each data of the model comes from; by default the generated ``<skillset>_managers.model.DATA_TOPICS``.
        namespace: before the skillset's name; by default the node's.

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
        namespace: str = "",
    ) -> None:
        self.place = place(namespace, skillset.name)
        life = uuid.uuid4().hex[:12]
        self._workers = ThreadPoolExecutor(WORKERS, thread_name_prefix=f"{skillset.name}_hooks")
        hooks = hooks_factory(self)
        self._alarms = Alarms(skillset.name, _log)
        self.engine = SkillsetEngine(
            skillset, now_ns, hooks, self._on_events, defer=self._submit, on_error=lambda text: rospy.logerr("%s", text)
        )
        self._due = DueAlarm(self.engine, self._alarms)
        bindings = _generated_bindings(skillset) if data_bindings is None else data_bindings
        self._data = DataManager(self.place, skillset, bindings, self._update_data, self._alarms)
        self._events = EventPublisher(self.place, skillset.name, life)
        self._resources = ResourceManager(self.place, self.engine, life)
        self._skills = {
            skill.name: SkillManager(
                self.place, self.engine, skill, action_types(interfaces, skill.name), hooks[skill.name], self._submit, self._alarms
            )
            for skill in skillset.skills
        }
        self._model_json = to_json(skillset)
        for manager in self._skills.values():
            manager.start()
        self._describe = rospy.Service(f"{self.place}/describe", Describe, self._answer_describe)
        self._heartbeat = Heartbeat(self.place, life)

    def close(self, reason: str) -> None:
        """Fail whatever runs for this reason, so that functions are stopped, and take no more requests."""
        self.engine.close(reason)
        self._workers.shutdown(wait=True)
        self._events.flush(FLUSH_S)
        self._alarms.close()

    def destroy(self) -> None:
        """Take all topics and services away; to be called after ``close``, by a process that lives on."""
        self._heartbeat.close()
        self._describe.shutdown()
        for manager in self._skills.values():
            manager.close()
        self._resources.close()
        self._data.close()
        self._events.close()

    def _on_events(self, events: Sequence[EngineEvent]) -> None:
        """Pass on one step: resources before events before results."""
        self._resources.on_events(events)
        self._events.publish(events)
        for event in events:
            if isinstance(event, ExecutionEvent):
                self._skills[event.skill].on_event(event)
        self._due.look()

    def _update_data(self, name: str, value: object | None) -> None:
        self.engine.update_data(name, value)
        self._due.look()

    def _submit(self, job: Callable[[], object]) -> None:
        try:
            self._workers.submit(job).add_done_callback(_check)
        except RuntimeError:
            # The managers are closing: whatever it was about has been failed.
            rospy.logdebug("%s is closing", self.place)

    def _answer_describe(self, _: Any) -> Any:
        return DescribeResponse(model_json=self._model_json)


HooksFactory = Callable[[SkillsetManagers], Mapping[str, SkillHooks]]


def _check(future: Future[object]) -> None:
    error = future.exception()
    if error is not None:
        _log(error)


def _log(error: BaseException) -> None:
    rospy.logerr("%s: %s", type(error).__name__, error)


def _generated_bindings(skillset: Skillset) -> DataBindings:
    if not skillset.data:
        return {}
    bindings: DataBindings = importlib.import_module(f"{skillset.name}_managers.model").DATA_TOPICS
    return bindings
