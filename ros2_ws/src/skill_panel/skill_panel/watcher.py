"""The ROS side of the panel: finds skillsets in the graph, listens to them, and calls them; any of them, by ``describe``."""

from __future__ import annotations

import threading
from collections.abc import Callable, Mapping, Sequence
from functools import partial
from typing import Any, TypeVar

from rclpy.node import Node
from rclpy.qos import QoSProfile

from alula.console.view import SkillsetView
from alula.model.model import Skillset
from alula.runtime.core.events import EngineEvent
from alula.runtime.core.records import SkillRecord
from alula.runtime.core.why import Why
from alula.runtime.handle import SkillHandle
from alula.runtime.views import DataReading
from alula.runtime.waiting import Pending
from skillset_ros2.actions import execution_id
from skillset_ros2.client import SkillsetClient
from skillset_ros2.mission_clock import STEADY, NodeClock
from skillset_ros2.names import action_module, action_type
from skillset_ros2.session import Session

DESCRIBE = "skillset_interfaces/srv/Describe"
LOOK_S = 0.5
DATA_S = 0.5
QUIET_S = 1.0
"""So long (wall clock) after the last of several things was found, they are taken for all."""
FEEDBACK_DEPTH = 10
T = TypeVar("T")


def skillsets_in(node: Node, namespace: str = "", names: Sequence[str] = ()) -> list[tuple[str, str]]:
    """Return namespace and name of the skillsets in the graph: those of the namespace, if one is given, and of these names, if any."""
    found = []
    for service, kinds in node.get_service_names_and_types():
        if DESCRIBE in kinds and service.endswith("/describe"):
            space, _, name = service.removesuffix("/describe").rpartition("/")
            wanted = (not namespace or space == f"/{namespace.strip('/')}") and (not names or name in names)
            if wanted and node.count_services(service):
                found.append((space, name))
    return sorted(found)


class Watched:
    """One skillset: its client, and its view as soon as the managers have described themselves."""

    def __init__(self, node: Node, space: str, name: str) -> None:
        self.root = f"{space}/{name}"
        self.problem = ""
        self.client = SkillsetClient(node, name, namespace=space or "/")
        self.view: SkillsetView | None = None
        self._handles: dict[str, SkillHandle] = {}
        self._node, self._name = node, name
        self._heard: list[EngineEvent] = []
        self._asked: dict[str, Pending[DataReading]] = {}
        self.client.on_event(self._on_event)
        self.client.on_change(self._on_change)
        self.client.on_skills(self._on_skills)

    def look(self) -> None:
        """See whether the managers are there."""
        if self.view is not None:
            self.view.heard_heartbeat(alive=self.client.ready)
        elif self.client.ready and not self.problem:
            try:
                kinds = self._actions(self.client.model)
            except (AttributeError, ImportError):
                self.problem = f"{self.root} is there, but the interfaces of {self._name} that are built here are another robot's"
                return
            view = SkillsetView(self.root, self.client.model)
            view.heard_states(self.client.resources, self.client.reasons)
            view.heard_skills(self.client.skills)
            for event in self._heard:
                view.heard_event(event)
            self.view = view
            self._follow_progress(kinds)

    def _actions(self, model: Skillset) -> dict[str, Any]:
        """Return the actions of all skills; raise AttributeError or ImportError where one is not among the interfaces here."""
        actions = action_module(self._name)
        return {skill.name: action_type(actions, skill.name) for skill in model.skills}

    def _follow_progress(self, kinds: Mapping[str, Any]) -> None:
        """Listen to the feedback of all executions: a client by itself hears only that of the executions that it started."""
        for skill, kind in kinds.items():
            topic = f"{self.root}/skill/{skill}/_action/feedback"
            self._node.create_subscription(kind.Impl.FeedbackMessage, topic, self._on_feedback, QoSProfile(depth=FEEDBACK_DEPTH))

    def ask_for_data(self) -> None:
        """Ask for the value of each data that no answer is awaited of."""
        view = self.view
        if view is None or not self.client.ready:
            return
        for data in view.model.data:
            asked = self._asked.get(data.name)
            if asked is None or asked.done:
                self._asked[data.name] = self.client.read_data(data.name)
                self._asked[data.name].add_done_callback(partial(self._on_reading, data.name))

    def start(self, skill: str, inputs: dict[str, object]) -> SkillHandle:
        """Start a skill; raise ValueError."""
        handle = self.client.start(skill, **inputs)
        self._handles[handle.id] = handle
        handle.add_done_callback(self._on_end)
        return handle

    def interrupt(self, skill: str) -> None:
        """Ask for the end of all executions of a skill, also of those that other clients started."""
        self.client.interrupt_all(skill).add_done_callback(lambda answer: self._say_failure(f"interrupt {skill}", answer))

    def set_paused(self, skill: str) -> None:
        """Pause what runs of a skill, resume what is paused; a refusal is told in the log."""
        rows = [] if self.view is None else [row for row in self.view.skill_rows() if row.name == skill]
        for one in (one for row in rows for one in row.running):
            self._set_paused(skill, one.id, paused=one.state != "PAUSED")

    def _set_paused(self, skill: str, execution_id: str, *, paused: bool) -> None:
        what = f"{'pause' if paused else 'resume'} {skill}"

        def told(answer: Pending[str]) -> None:
            self._say_failure(what, answer)
            if not answer.failure and answer.value:
                self.say(f"{what} refused: {answer.value}")

        self.client.set_paused(execution_id, paused).add_done_callback(told)

    def ask_why(self, skill: str) -> None:
        """Have the managers say in the log whether a skill could start, and what its resources went through."""

        def told(answer: Pending[Why]) -> None:
            self._say_failure(f"why {skill}", answer)
            if not answer.failure:
                self.say(f"why {skill}: {'it could start now' if answer.value.ready else answer.value.reason}")
                for past in answer.value.history:
                    line = f"{past.resource} {past.from_state} -> {past.to_state} by {past.cause}"
                    self.say(f"    {past.stamp_ns / 1e9:.2f}  {line}")

        self.client.why(skill).add_done_callback(told)

    def transition(self, resource: str, to: str) -> None:
        """Take an extern transition; a refusal is told in the log."""

        def told(answer: Pending[Any]) -> None:
            self._say_failure(f"{resource} -> {to}", answer)
            if not answer.failure and not answer.value.accepted:
                self.say(f"{resource} -> {to} refused: {answer.value.reason}")

        self.client.transition(resource, to).add_done_callback(told)

    def say(self, line: str) -> None:
        """Add a line to the log."""
        if self.view is not None:
            self.view.say(line)

    def _say_failure(self, what: str, answer: Pending[Any]) -> None:
        if answer.failure:
            self.say(f"{what}: {answer.failure}")

    def _on_event(self, event: EngineEvent) -> None:
        if self.view is None:
            self._heard.append(event)
        else:
            self.view.heard_event(event)

    def _on_change(self, states: dict[str, str]) -> None:
        if self.view is not None:
            self.view.heard_states(states, self.client.reasons)

    def _on_skills(self, skills: dict[str, SkillRecord]) -> None:
        if self.view is not None:
            self.view.heard_skills(skills)

    def _on_reading(self, name: str, answer: Pending[DataReading]) -> None:
        if self.view is not None and not answer.failure and answer.value.received:
            reading = answer.value
            self.view.heard_data(name, value_json=reading.value_json, stamp_ns=reading.stamp_ns, stale=reading.stale)

    def _on_feedback(self, message: Any) -> None:
        if self.view is not None:
            self.view.heard_progress(execution_id(message.goal_id), message.feedback.progress)

    def _on_end(self, handle: SkillHandle) -> None:
        self._handles.pop(handle.id, None)
        if not handle.id or "managers" in handle.message:
            self.say(f"{handle.skill}: {handle.outcome} {handle.message}")


class Watcher:
    """All skillsets that are asked for, and those that come later; ``close`` ends it."""

    def __init__(self, *, domain: int | None, namespace: str = "", names: Sequence[str] = ()) -> None:
        self._session = Session("skill_panel", domain=domain, namespace=namespace)
        self.node = self._session.node
        self.domain: int = self.node.context.get_domain_id()
        self._namespace = namespace
        self._names = tuple(names)
        self._lock = threading.Lock()
        self._watched: dict[str, Watched] = {}
        self._problems: dict[str, str] = {}
        self._mission_clock = NodeClock(self.node)
        self._timers = [
            self.node.create_timer(period_s, job, clock=STEADY) for period_s, job in ((LOOK_S, self._look), (DATA_S, self._ask))
        ]

    @property
    def watched(self) -> list[Watched]:
        """The skillsets that have described themselves, by name."""
        with self._lock:
            return sorted((one for one in self._watched.values() if one.view is not None), key=lambda one: one.root)

    @property
    def problems(self) -> list[str]:
        """What keeps skillsets that are there from being shown."""
        with self._lock:
            return [*self._problems.values(), *(one.problem for one in self._watched.values() if one.problem)]

    @property
    def now_ns(self) -> int:
        """Mission clock, nanoseconds."""
        return self._mission_clock.now_ns()

    def close(self) -> None:
        """End listening; what runs goes on running."""
        for one in self.watched:
            one.client.close("the panel was closed")
        self._session.close()

    def _look(self) -> None:
        for space, name in skillsets_in(self.node, self._namespace, self._names):
            root = f"{space}/{name}"
            if root not in self._watched:
                self._meet(space, name, root)
        for one in list(self._watched.values()):
            one.look()
        if not self._mission_clock.simulated:  # the clock's publisher may be found later than the skillsets
            self._session.follow_clock()

    def _meet(self, space: str, name: str, root: str) -> None:
        try:
            action_module(name)
        except ModuleNotFoundError as error:
            with self._lock:
                self._problems[root] = (
                    f"{root} is there, but its interfaces are not built here ({error.name}): run ./alula setup with its model"
                )
            return
        with self._lock:
            self._problems.pop(root, None)
            self._watched[root] = Watched(self.node, space, name)

    def _ask(self) -> None:
        for one in list(self._watched.values()):
            one.ask_for_data()


def all_found(look: Callable[[], Sequence[T]], timeout_s: float) -> list[T]:
    """Return what is found once that is something and nothing is added any more; nothing when there is none within the time (wall clock).

    DDS tells of one process after another, and never that these are all.
    """
    found: list[T] = []

    def is_added() -> bool:
        added = [one for one in look() if one not in found]
        found.extend(added)
        return bool(added)

    wait_s = timeout_s
    while wait_for(is_added, wait_s):
        wait_s = QUIET_S
    return found


def wait_for(condition: Callable[[], bool], timeout_s: float) -> bool:
    """Wait (wall clock) until a condition holds; tell whether it does."""
    pause = threading.Event()
    tries = max(1, int(timeout_s / 0.05))
    return any(condition() or pause.wait(0.05) for _ in range(tries)) or condition()
