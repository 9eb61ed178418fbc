"""The functional layer from its bag: what it said, and its answers to what it was told, under the drone's real hooks."""

from __future__ import annotations

import functools
import heapq
import importlib
import json
from collections import deque
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from types import SimpleNamespace
from typing import Any

from rosbags.highlevel import AnyReader, AnyReaderError
from rosbags.interfaces import ConnectionExtRosbag1
from rosbags.rosbag1 import ReaderError
from rosbags.typesys import Stores, get_typestore

from alula_common.record import OPERATOR, TICKS, Entry
from mission_replay.comparison import alike
from mission_replay.recorded import Decision, Recorded, ReplayError
from mission_replay.vehicle import Vehicle
from skill_model.execution_state import ExecutionState
from skill_model.model import Skillset
from skill_runtime.core.events import EngineEvent, ExecutionEvent
from skill_runtime.core.execution import Execution
from skill_runtime.hooks import SkillHooks
from skill_runtime.local import LocalManagers, Timer, VirtualClock
from skill_runtime.mock import NEVER, Behaviour, Choice, MockSkill, follow
from skill_runtime.plain import to_plain
from skill_runtime.ros2.convert import fill, values_of

CALLS = "/calls"
MESSAGE = "message"


@dataclass(frozen=True)
class Call:
    """A call of a service; ``response`` None: there was none. Seconds of mission clock."""

    service: str
    request: Mapping[str, Any]
    response: Mapping[str, Any] | None
    end_s: float


def read_bag(path: Path, topics: Iterable[str]) -> Iterator[Entry]:
    """Yield messages of a ROS 1 bag in the order in which they were recorded, ``{"message": object with the fields}``.

    Raises:
        ReplayError: it is no bag, or damaged.
    """
    wanted = set(topics)
    try:
        with AnyReader([path], default_typestore=get_typestore(Stores.ROS1_NOETIC)) as reader:
            found = [c for c in reader.connections if c.topic in wanted and isinstance(c.ext, ConnectionExtRosbag1)]
            # No connections would mean all of them.
            for connection, stamp_ns, raw in reader.messages(connections=found) if found else ():
                yield Entry(connection.topic, stamp_ns, {MESSAGE: reader.deserialize(raw, connection.msgtype)})
    except (AnyReaderError, ReaderError, OSError, ValueError, KeyError, AssertionError) as error:
        raise ReplayError(f"{path}: {str(error) or type(error).__name__}") from error


def read_calls(path: Path) -> list[Call]:
    """Return the calls of services that a bag tells of; raises ReplayError where it tells of none, as older ones do not."""
    calls = []
    try:
        for entry in read_bag(path, [CALLS]):
            value = json.loads(entry.value[MESSAGE].data)
            calls.append(Call(str(value["service"]), dict(value["request"]), value["response"], float(value["end_s"])))
    except (KeyError, TypeError, ValueError, AttributeError) as error:
        raise ReplayError(f"{path}: holds what is no call of a service on {CALLS}: {type(error).__name__} {error}") from error
    if not calls:
        raise ReplayError(f"{path}: holds no calls of services ({CALLS}), so nobody knows what the functional layer answered")
    return calls


# --- what hooks need of a node ----------------------------------------------------------------------------------------------


class RecordedFuture:
    """An answer that comes, or does not."""

    def __init__(self) -> None:
        self._result: Any = None
        self._callbacks: list[Callable[[RecordedFuture], None]] = []

    def add_done_callback(self, callback: Callable[[RecordedFuture], None]) -> None:
        """Have a callback called when the answer comes."""
        self._callbacks.append(callback)

    def result(self) -> Any:
        """Return the answer."""
        return self._result

    def resolve(self, result: Any) -> None:
        """Let the answer come."""
        self._result = result
        for callback in self._callbacks:
            callback(self)


class RecordedService:
    """A client of a service whose answers are recorded."""

    def __init__(self, answers: RecordedFunctions, name: str) -> None:
        self.srv_name = name
        self._answers = answers

    def service_is_ready(self) -> bool:
        """Tell that it is there."""
        return True

    def call_async(self, request: Any) -> RecordedFuture:
        """Call it."""
        return self._answers.called(self.srv_name, to_plain(request))

    def remove_pending_request(self, future: RecordedFuture) -> None:
        """Nothing waits here."""


class BagNode:
    """What the drone's hooks use of an rclpy node, in virtual time, over a bag."""

    def __init__(self, functions: RecordedFunctions) -> None:
        self._functions = functions
        self._clock: VirtualClock = functions.world.clock

    def get_clock(self) -> BagNode:
        """Return what tells the time."""
        return self

    def now(self) -> SimpleNamespace:
        """Return the mission clock."""
        return SimpleNamespace(nanoseconds=self._clock.now_ns)

    def create_timer(self, period_s: float, callback: Callable[[], None], **_: object) -> Timer:
        """Have a callback called again and again."""

        def again() -> None:
            if not self._functions.silent:
                self._clock.after(period_s, again)
                callback()

        return self._clock.after(period_s, again)

    def create_client(self, _kind: object, name: str, **_: object) -> RecordedService:
        """Connect to a service."""
        return RecordedService(self._functions, name)

    def create_subscription(self, _kind: object, topic: str, callback: Callable[[Any], None], *_: object, **__: object) -> None:
        """Follow a topic."""
        self._functions.subscribers.setdefault(topic, []).append(callback)

    def declare_parameter(self, _name: str, value: object) -> SimpleNamespace:
        """Return the parameter's default."""
        return SimpleNamespace(value=value)


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
        """Start."""
        self._open[execution.id] = execution
        hooks = self._of(execution)
        if hooks is self._real:
            self._mock.follow(execution)
        hooks.on_dispatch(execution)

    def progress(self, execution: Execution) -> float:
        """Tell how far it is."""
        return self._of(execution).progress(execution)

    def on_interrupt(self, execution: Execution) -> bool | None:
        """Stop."""
        return self._of(execution).on_interrupt(execution)

    def on_emergency(self, execution: Execution) -> None:
        """Stop by the strongest means."""
        self._of(execution).on_emergency(execution)

    def on_violation(self, execution: Execution) -> None:
        """Stop after a violation."""
        self._of(execution).on_violation(execution)

    def on_failure(self, execution: Execution) -> None:
        """Stop after a failure."""
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
        """Take note of an end: who got there has moved all the way."""
        execution = self._open.pop(event.id, None)
        if execution is not None and event.state is ExecutionState.TERMINATED:
            self._mock.forget(execution.id)
        elif execution is not None:
            self._mock.on_interrupt(execution)

    def _of(self, execution: Execution) -> SkillHooks:
        return self._mock if id(execution.inputs) in self._mocked else self._real


class RecordedFunctions(Vehicle):
    """The functional layer says what it said; the real hooks decide what that means for their skills.

    Args:
        skillsets: the models that the managers execute.
        bag: what the functional layer said and was told.
        behaviour: of the mocks, once the decisions differ.
        start_s: mission clock at the beginning.
    """

    def __init__(self, skillsets: Sequence[Skillset], bag: Path, behaviour: Behaviour, *, start_s: float) -> None:
        super().__init__(behaviour, start_s=start_s)
        self.subscribers: dict[str, list[Callable[[Any], None]]] = {}
        self.silent = False
        """What the bag tells is not, or no more, what happens: the real hooks look at it no longer."""
        self._diverged = False
        self._skills: list[SwitchedSkill] = []
        self._recorded_next: dict[str, deque[bool]] = {}
        self._calls: dict[str, deque[Call]] = {}
        for call in read_calls(bag):
            if not call.service.endswith("/transition"):
                self._calls.setdefault(call.service, deque()).append(call)
        for skillset in skillsets:
            for resource in skillset.resources:
                self.play.on_state(skillset.name, resource.name, resource.initial)
            self._serve(skillset)
        self.world.clock.soon(self.play.begin)

    @property
    def topics(self) -> set[str]:
        """What of the bag is to be read."""
        return {CALLS, *self.subscribers}

    def _serve(self, skillset: Skillset) -> None:
        name = skillset.name
        real = importlib.import_module(f"uav_skills.{name}").make_hooks(BagNode(self))
        actions = importlib.import_module(f"{name}_interfaces.action")
        mocks = self.play.hooks_of(skillset, ShadowSkill)
        hooks = {
            skill: SwitchedSkill(self, f"{name}.{skill}", real[skill], mock, getattr(actions, _camel(skill)).Goal)
            for skill, mock in mocks.items()
            if isinstance(mock, ShadowSkill)
        }
        self._skills += hooks.values()
        managers = self.world.serve(skillset, hooks)
        managers.on_step(functools.partial(_tell_ends, hooks))
        managers.on_step(functools.partial(follow, self.play, name))
        for data, (topic, _) in importlib.import_module(f"{name}_managers.model").DATA_TOPICS.items():
            self.subscribers.setdefault(topic, []).append(functools.partial(self._on_data, managers, data))

    # --- requests ----------------------------------------------------------------------------------------------------

    def requested(self, skillset: str, skill: str, execution_id: str, then: Decision | None) -> None:
        """Take note of a request."""
        if then is not None:
            self._recorded[execution_id] = then.id
        self._recorded_next.setdefault(f"{skillset}.{skill}", deque()).append(then is not None)

    def next_is_recorded(self, name: str) -> bool:
        """Tell whether the next call of a skill was made then, too."""
        waiting = self._recorded_next.get(name)
        return bool(waiting) and waiting.popleft() if waiting is not None else False

    def called(self, service: str, request: Mapping[str, Any]) -> RecordedFuture:
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
        """Take note that the bag has no more to say."""
        super().over()
        self.silent = True

    # --- what the bag tells ------------------------------------------------------------------------------------------

    def take(self, entry: Entry, *, diverged: bool) -> None:
        """Have the functional layer say what it said."""
        if diverged and not self._diverged:
            self._diverged = self.silent = True
            for skill in self._skills:
                skill.hand_over()
        message = entry.value[MESSAGE]
        if entry.topic == CALLS:
            self._take_transition(json.loads(message.data))
        for callback in self.subscribers.get(entry.topic, ()) if not self.silent else ():
            callback(message)

    def _take_transition(self, call: Mapping[str, Any]) -> None:
        """Have the functional layer ask for an extern transition, as it did."""
        _, skillset, *service = str(call["service"]).split("/")
        if service == ["transition"] and skillset in self.world.managers and (call["response"] or {}).get("accepted"):
            place = (skillset, str(call["request"]["resource"]))
            if not self._diverged or place not in self.caused:
                self.play.take({place: str(call["request"]["to"])})

    def _on_data(self, managers: LocalManagers, data: str, message: object) -> None:
        if self.play.holds(managers.skillset.name):
            self.stage.mocked.add(managers.skillset.name)
        if managers.alive and managers.skillset.name not in self.stage.mocked:
            managers.publish(data, message)


def begin_of(recorded: Recorded, bag: Path) -> float:
    """Return when the first of both begins, seconds of mission clock."""
    first = next(read_bag(bag, [CALLS]), None)
    stamps = [entry.stamp_ns for entry in (*recorded.entries[:1], first) if entry is not None]
    return min(stamps, default=0) / 1e9


def entries_of(recorded: Recorded, bag: Path, topics: Iterable[str]) -> Iterator[Entry]:
    """Yield the bag's messages, and when the tree was ticked and told to stop, in the order of time."""
    asked = (entry for entry in recorded.entries if entry.topic in {TICKS, OPERATOR})
    return heapq.merge(read_bag(bag, topics), asked, key=lambda entry: entry.stamp_ns)


def _tell_ends(hooks: Mapping[str, SwitchedSkill], events: Sequence[EngineEvent]) -> None:
    for event in events:
        if isinstance(event, ExecutionEvent) and event.state.terminal:
            hooks[event.skill].ended(event)


def _camel(name: str) -> str:
    return "".join(word.capitalize() for word in name.split("_"))
