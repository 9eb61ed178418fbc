"""The functional layer from its bag: what it said, and its answers to what it was told, under the robot's real hooks.

The robot's part ``hooks`` is a package with a module a skillset, which has ``make_hooks(node)``.
"""

from __future__ import annotations

import functools
import importlib
import json
from collections import deque
from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from types import SimpleNamespace
from typing import Any

from alula.common.plain import to_plain
from alula.common.record import Entry
from alula.common.robots import FILE, find_robot
from alula.mock import NEVER, Behaviour, Choice, MockSkill, follow
from alula.model.execution_state import ExecutionState
from alula.model.model import Skillset
from alula.records.replay.comparison import alike
from alula.records.replay.deciding import MakeRobot, RecordedMission, RobotAndInputs
from alula.records.replay.recorded import RecordedDecision, ReplayError
from alula.records.replay.robot import ReplayedRobot
from alula.runtime.core.events import EngineEvent, ExecutionEvent
from alula.runtime.core.execution import Execution
from alula.runtime.hooks import SkillHooks
from alula.runtime.local import LocalManagers
from alula.runtime.middleware import REPORTED
from skillset_ros2.convert import fill, values_of
from skillset_ros2.replay.actions import RecordedActionClient
from skillset_ros2.replay.bag import CALLS, MESSAGE, Call, begin_of, entries_of, read_bag, read_calls
from skillset_ros2.replay.node import BagNode, RecordedFuture, Subscribers


def from_bag(bag: Path) -> MakeRobot:
    """Return what has a bag of the functional layer answer a replay; raises ReplayError, also when it is called."""

    def make(mission: RecordedMission) -> RobotAndInputs:
        begun_s = begin_of(mission.recorded, bag)
        functions = RecordedFunctions(mission.skillsets, bag, mission.behaviour, start_s=begun_s)
        return functions, entries_of(mission.recorded, bag, functions.topics)

    return make


# --- hooks that are real as long as the record knows what comes of them -----------------------------------------------------


class ShadowSkill(MockSkill):
    """A mock that can follow an execution of the real hooks: it moves what that moves, so that it can take over from there."""

    shadow = False

    def choose(self, inputs: object) -> Choice:
        """Choose what is done in the next call; a shadow neither ends nor changes anything."""
        choice = super().choose(inputs)
        return Choice(replace(choice.script, ending=NEVER, changes=()), "") if self.shadow else choice

    def follow(self, execution: Execution) -> None:
        """Begin to follow an execution."""
        self.shadow = True
        self.validate(execution.inputs)
        self.on_dispatch(execution)
        self.shadow = False


class SwitchedSkill(SkillHooks):
    """Passes on to the real hooks; requests that were not recorded go to a mock, as the bag does not know what would have come of them."""

    def __init__(self, functions: RecordedFunctions, name: str, real: SkillHooks, mock: ShadowSkill, goal: Callable[[], Any]) -> None:
        self._functions = functions
        self._name = name
        self._real = real
        self._mock = mock
        self._goal = goal
        self._mocked: dict[int, object] = {}
        """Inputs of calls that a mock answers, by identity."""
        self._open: dict[str, Execution] = {}

    def make_inputs(self, values: Mapping[str, object]) -> object:
        """Make what the real hooks get, messages included."""
        return self._real.make_inputs(values_of(fill(self._goal(), to_plain(values), f"inputs of {self._name}")))

    def validate(self, inputs: object) -> str:
        """Let the one that will execute decide."""
        if self._functions.next_is_recorded(self._name):
            return self._real.validate(inputs)
        self._mocked[id(inputs)] = inputs
        return self._mock.validate(inputs)

    def on_dispatch(self, execution: Execution) -> None:
        """Dispatch to the real hooks, which the mock follows, or to the mock."""
        self._open[execution.id] = execution
        hooks = self._of(execution)
        if hooks is self._real:
            self._mock.follow(execution)
        hooks.on_dispatch(execution)

    def progress(self, execution: Execution) -> float:
        """Return how far it is, 0 to 1."""
        return self._of(execution).progress(execution)

    def on_interrupt(self, execution: Execution) -> bool | None:
        """Interrupt by the hooks that the execution was dispatched to."""
        return self._of(execution).on_interrupt(execution)

    def on_emergency(self, execution: Execution) -> None:
        """Stop by the strongest means."""
        self._of(execution).on_emergency(execution)

    def on_violation(self, execution: Execution) -> None:
        """Tell the hooks that the execution was dispatched to."""
        self._of(execution).on_violation(execution)

    def on_failure(self, execution: Execution) -> None:
        """Tell the hooks that the execution was dispatched to."""
        self._of(execution).on_failure(execution)

    def hand_over(self) -> None:
        """Have the mock do what the real hooks began: the bag tells of another course of things from now on."""
        for execution in self._open.values():
            if self._of(execution) is self._real:
                self._mock.on_interrupt(execution)
                self._mocked[id(execution.inputs)] = execution.inputs
                self._mock.validate(execution.inputs)
                self._mock.on_dispatch(execution)

    def ended(self, event: ExecutionEvent) -> None:
        """Take note of an end: a skill that terminated has moved the vehicle all the way."""
        execution = self._open.pop(event.id, None)
        if execution is not None and event.state is ExecutionState.TERMINATED:
            self._mock.forget(execution.id)
        elif execution is not None:
            self._mock.on_interrupt(execution)

    def _of(self, execution: Execution) -> SkillHooks:
        return self._mock if id(execution.inputs) in self._mocked else self._real


class RecordedFunctions(ReplayedRobot):
    """The functional layer says what it said; the real hooks decide what that means for their skills.

    Args:
        skillsets: the models that the managers execute.
        bag: what the functional layer said and was told.
        behaviour: of the mocks, once the decisions differ.
        start_s: mission clock at the beginning.
    """

    def __init__(self, skillsets: Sequence[Skillset], bag: Path, behaviour: Behaviour, *, start_s: float) -> None:
        super().__init__(behaviour, start_s=start_s)
        self._robot = find_robot()
        self._hooks = self._robot.parts.get("hooks")
        if self._hooks is None:
            raise ReplayError(
                f"{self._robot.root / FILE}: names no hooks; add `parts: {{hooks: PACKAGE}}` to replay from the functional layer"
            )
        self._subscribers: Subscribers = {}
        self._bag = bag
        self._silent = False
        """What the bag tells is not, or no more, what happens: the real hooks look at it no longer."""
        self._diverged = False
        self._skills: list[SwitchedSkill] = []
        self._recorded_next: dict[str, deque[bool]] = {}
        self._calls: dict[str, deque[Call]] = {}
        for call in read_calls(bag):
            if not call.service.endswith("/transition"):
                self._calls.setdefault(call.service, deque()).append(call)
        self._reporters = {f"/{one.name}/{REPORTED.name}": one.name for one in skillsets}
        """The skillset that each topic of reporters' heartbeats is about."""
        for skillset in skillsets:
            for resource in skillset.resources:
                self.mocks.on_state(skillset.name, resource.name, resource.initial)
            self._serve(skillset)
        self.world.clock.soon(self.mocks.begin)

    @property
    def topics(self) -> set[str]:
        """What of the bag is to be read."""
        return {CALLS, *self._reporters, *self._subscribers}

    def _serve(self, skillset: Skillset) -> None:
        name = skillset.name
        node = BagNode(self.world.clock, self._called, self._subscribers, lambda: self._silent, self._action)
        real = self._robot.load(f"{self._hooks}.{name}").make_hooks(node)
        actions = importlib.import_module(f"{name}_interfaces.action")
        mocks = self.mocks.hooks_of(skillset, ShadowSkill)
        hooks = {
            skill: SwitchedSkill(self, f"{name}.{skill}", real[skill], mock, getattr(actions, _camel(skill)).Goal)
            for skill, mock in mocks.items()
            if isinstance(mock, ShadowSkill)
        }
        self._skills += hooks.values()
        managers = self.world.serve(skillset, hooks)
        managers.on_step(functools.partial(_tell_ends, hooks))
        managers.on_step(functools.partial(follow, self.mocks, name))
        for data, (topic, _) in importlib.import_module(f"{name}_managers.model").DATA_TOPICS.items():
            self._subscribers.setdefault(topic, []).append(functools.partial(self._on_data, managers, data))

    # --- requests ----------------------------------------------------------------------------------------------------

    def requested(self, skillset: str, skill: str, execution_id: str, then: RecordedDecision | None) -> None:
        """Take note of a request."""
        if then is not None:
            self._recorded[execution_id] = then.id
        self._recorded_next.setdefault(f"{skillset}.{skill}", deque()).append(then is not None)

    def next_is_recorded(self, name: str) -> bool:
        """Return whether the next call of a skill was made then, too."""
        waiting = self._recorded_next.get(name)
        return bool(waiting) and waiting.popleft() if waiting is not None else False

    def _action(self, name: str) -> RecordedActionClient:
        goals = [entry.value[MESSAGE] for entry in read_bag(self._bag, [f"{name}/goal"])]
        return RecordedActionClient(name, goals, self._subscribers, lambda told: None if self._diverged else self.differs(told))

    def _called(self, service: str, request: Mapping[str, Any]) -> RecordedFuture:
        """Answer a call as it was answered then, not earlier; what was not called then is a difference."""
        future, waiting, clock = RecordedFuture(), self._calls.get(service), self.world.clock
        call = waiting[0] if waiting else None
        if call is None or not alike(call.request, request):
            if not self._diverged:
                then = "nothing" if call is None else json.dumps(dict(call.request))
                self.differs(f"call of {service}: then {then}, now {json.dumps(dict(request))}")
            clock.soon(lambda: future.resolve(SimpleNamespace(accepted=True, reason="", reference_id=0)))
            return future
        self._calls[service].popleft()
        response = call.response
        if response is not None:
            clock.at(round(call.end_s * 1e9), lambda: future.resolve(SimpleNamespace(**response)))
        return future

    def over(self) -> None:
        """Take that the bag has ended."""
        super().over()
        self._silent = True
        for managers in self.world.managers.values():
            managers.expect_nothing()

    # --- what the bag tells ------------------------------------------------------------------------------------------

    def take(self, entry: Entry, *, diverged: bool) -> None:
        """Have the functional layer say what it said."""
        if diverged and not self._diverged:
            self._diverged = self._silent = True
            for skill in self._skills:
                skill.hand_over()
        message = entry.value[MESSAGE]
        if entry.topic == CALLS:
            self._take_transition(json.loads(message.data))
        elif entry.topic in self._reporters:
            self.world.managers[self._reporters[entry.topic]].on_report([one.name for one in message.resources])
        for callback in self._subscribers.get(entry.topic, ()) if not self._silent else ():
            callback(message)

    def _take_transition(self, call: Mapping[str, Any]) -> None:
        """Have the functional layer ask for an extern transition, as it did; records of before reasons were told have none."""
        _, skillset, *service = str(call["service"]).split("/")
        if service == ["transition"] and skillset in self.world.managers and (call["response"] or {}).get("accepted"):
            place = (skillset, str(call["request"]["resource"]))
            if not self._diverged or place not in self.caused:
                self.mocks.take({place: str(call["request"]["to"])}, str(call["request"].get("reason", "")))

    def _on_data(self, managers: LocalManagers, data: str, message: object) -> None:
        if self.mocks.holds(managers.skillset.name):
            self.host.mocked.add(managers.skillset.name)
        if managers.alive and managers.skillset.name not in self.host.mocked:
            managers.publish(data, message)


def _tell_ends(hooks: Mapping[str, SwitchedSkill], events: Sequence[EngineEvent]) -> None:
    for event in events:
        if isinstance(event, ExecutionEvent) and event.state.terminal:
            hooks[event.skill].ended(event)


def _camel(name: str) -> str:
    return "".join(word.capitalize() for word in name.split("_"))
