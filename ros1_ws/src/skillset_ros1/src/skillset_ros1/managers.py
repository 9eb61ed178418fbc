"""All managers of one skillset in one rospy node (paper, section 4.2 and Figure 2)."""

from __future__ import annotations

import importlib
import uuid
from collections.abc import Callable, Mapping, Sequence
from types import ModuleType
from typing import Protocol

import rospy

from skill_model.model import Skillset
from skill_runtime.core.engine import DEFAULT_TIMEOUT_S, SkillsetEngine
from skill_runtime.core.errors import SkillRuntimeError
from skill_runtime.core.events import EngineEvent, ExecutionEvent
from skill_runtime.hooks import SkillHooks
from skill_runtime.workers import Workers
from skillset_ros1.alarms import Alarms
from skillset_ros1.answers import Answers
from skillset_ros1.data_manager import DataBindings, DataManager
from skillset_ros1.due import DueAlarm
from skillset_ros1.events import EventPublisher
from skillset_ros1.heartbeat import Heartbeat
from skillset_ros1.names import action_types, now_ns, place
from skillset_ros1.resource_manager import ResourceManager
from skillset_ros1.skill_manager import SkillManager
from skillset_ros1.skill_states import SkillStatesPublisher

FLUSH_S = 1.0
HOOKS_RETURN_S = 5.0
"""How long (wall clock) the end of the managers waits for hooks that have not returned."""


class SkillsetManagers:
    """The data manager, the resource manager and the skill managers of a skillset, in this process's rospy node.

    Hooks are called on threads of their own; nothing of the node waits for one. Parameter of the node: ``~interrupt_timeout_s``.

    Args:
        skillset: the model.
        interfaces: the generated package ``<skillset>_interfaces``, or its module ``msg``.
        hooks_factory: makes the hooks, one a skill, with these managers at hand.
        data_bindings: where each data of the model comes from; by default the generated ``<skillset>_managers.model.DATA_TOPICS``.
        namespace: before the skillset's name; by default the node's.

    Raises:
        SkillRuntimeError: a skill has no hooks, a data no binding, or the parameter is no time.
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
        self.skillset = skillset
        self.place = place(namespace, skillset.name)
        life = uuid.uuid4().hex[:12]
        timeout_s = _interrupt_timeout_s()
        self._workers = Workers(f"{skillset.name}_hooks", _log)
        hooks = hooks_factory(self)
        self._alarms = Alarms(skillset.name, _log)
        self.engine = SkillsetEngine(
            skillset, now_ns, hooks, self._on_events, defer=self._workers.submit, on_error=_log, interrupt_timeout_s=timeout_s
        )
        self._due = DueAlarm(self.engine, self._alarms)
        bindings = _generated_bindings(skillset) if data_bindings is None else data_bindings
        data = DataManager(self.place, skillset, bindings, self._update_data, self._alarms)
        self._events = EventPublisher(self.place, skillset.name, life)
        self._resources = ResourceManager(self.place, self.engine, life)
        types = {skill.name: action_types(interfaces, skill.name) for skill in skillset.skills}
        submit = self._workers.submit
        self._skills = {
            skill.name: SkillManager(self.place, self.engine, skill, types[skill.name], hooks[skill.name], submit, self._alarms)
            for skill in skillset.skills
        }
        self._skill_states = SkillStatesPublisher(self.place, skillset, life)
        answers = Answers(self.place, self.engine, self._workers, types, hooks)
        for manager in self._skills.values():
            manager.start()
        # The sign of life comes last: who hears it finds everything there.
        self._parts: list[_Part] = [Heartbeat(self.place, life), answers, *self._skills.values(), self._resources, self._skill_states, data]

    def close(self, reason: str) -> None:
        """Fail whatever runs for this reason, so that functions are stopped, and take no more requests."""
        self.engine.close(reason)
        if not self._workers.close(HOOKS_RETURN_S):
            rospy.logerr("a hook has not returned within %g s; it is left behind", HOOKS_RETURN_S)
        self._skill_states.publish()
        self._events.flush(FLUSH_S)
        self._alarms.close()

    def destroy(self) -> None:
        """Take all topics and services away; to be called after ``close``, by a process that lives on."""
        for part in (*self._parts, self._events):
            part.close()

    def _on_events(self, events: Sequence[EngineEvent]) -> None:
        """Pass on one step: resources before events before results."""
        self._resources.on_events(events)
        self._events.publish(events)
        for event in events:
            if isinstance(event, ExecutionEvent):
                self._skills[event.skill].on_event(event)
        self._skill_states.on_events(events)
        self._due.look()

    def _update_data(self, name: str, value: object | None) -> None:
        self.engine.update_data(name, value)
        self._due.look()


HooksFactory = Callable[[SkillsetManagers], Mapping[str, SkillHooks]]


class _Part(Protocol):
    """What has topics or services."""

    def close(self) -> None:
        """Take them away."""
        ...


def _log(error: object) -> None:
    rospy.logerr("%s", error)


def _interrupt_timeout_s() -> float:
    timeout_s = float(rospy.get_param("~interrupt_timeout_s", DEFAULT_TIMEOUT_S))
    if not timeout_s > 0:
        raise SkillRuntimeError(f"parameter ~interrupt_timeout_s is {timeout_s:g}; a stop needs a positive time")
    return timeout_s


def _generated_bindings(skillset: Skillset) -> DataBindings:
    if not skillset.data:
        return {}
    bindings: DataBindings = importlib.import_module(f"{skillset.name}_managers.model").DATA_TOPICS
    return bindings
