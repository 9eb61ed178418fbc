"""What the panel shows of one skillset, from what was received of it; no ROS, no screen."""

from __future__ import annotations

import json
import threading
from collections import deque
from collections.abc import Iterable, Mapping
from dataclasses import dataclass, replace
from types import SimpleNamespace
from typing import Any

from alula.model.model import Resource, Skillset
from alula.model.situation import Situation
from alula.runtime.core.events import EngineEvent, ExecutionEvent
from alula.runtime.core.records import SkillRecord
from alula.runtime.core.why import unmet

NANOSECONDS = 1e9
LOG_LINES = 1000
VALUE_WIDTH = 60


@dataclass(frozen=True)
class ResourceRow:
    """A resource; ``targets`` are the states that an extern transition leads to from here, ``every_target`` those from anywhere.

    ``reason``: why it is in its state, as the functional layer or the managers reported it; empty where they reported nothing.
    """

    name: str
    state: str
    targets: tuple[str, ...]
    every_target: tuple[str, ...]
    reason: str = ""


@dataclass(frozen=True)
class DataRow:
    """A data: its value as one line, its age in seconds of mission clock (None: nothing was received)."""

    name: str
    value: str
    age_s: float | None
    stale: bool


@dataclass(frozen=True)
class Running:
    """An execution that has not ended; ``progress`` (0 to 1) is None until its manager has reported one."""

    id: str
    skill: str
    state: str
    progress: float | None = None


@dataclass(frozen=True)
class SkillRow:
    """A skill: what runs of it, how it last ended, and why it could not start now (empty: it could)."""

    name: str
    running: tuple[Running, ...]
    last: str
    unmet: tuple[str, ...]

    @property
    def status(self) -> str:
        """The state of what runs, or whether it is ready."""
        if self.running:
            return " ".join(one.state for one in self.running)
        return "not ready" if self.unmet else "ready"


@dataclass(frozen=True)
class _Reading:
    value_json: str
    stamp_ns: int
    stale: bool


class SkillsetView:
    """One skillset, as it is known so far. Written by the thread that listens, read by the screen's."""

    def __init__(self, root: str, model: Skillset) -> None:
        self.root = root
        self.model = model
        self.alive = True
        self.version = 0
        self.log: deque[str] = deque(maxlen=LOG_LINES)
        self.logged = 0
        self._lock = threading.RLock()
        self._states: dict[str, str] = {}
        self._reasons: dict[str, str] = {}
        self._readings: dict[str, _Reading] = {}
        self._running: dict[str, Running] = {}
        self._last: dict[str, str] = {}

    # --- what was heard ----------------------------------------------------------------------------------------------

    def heard_states(self, states: Mapping[str, str], reasons: Mapping[str, str]) -> None:
        """Store the states of all resources, and the reasons for them, by name."""
        with self._lock:
            self._states, self._reasons = dict(states), dict(reasons)
            self.version += 1

    def heard_event(self, event: EngineEvent) -> None:
        """Add a line to the log for an event of the managers."""
        self.say(f"{event.stamp_ns / NANOSECONDS:.2f}  {_told(event)}")

    def heard_skills(self, skills: Mapping[str, SkillRecord]) -> None:
        """Store the records of the skills, by name."""
        with self._lock:
            open_ones = [(name, one) for name, skill in skills.items() for one in skill.open]
            progress = {identifier: one.progress for identifier, one in self._running.items()}
            self._running = {one.id: Running(one.id, name, one.state.value, progress.get(one.id)) for name, one in open_ones}
            ends = {name: skill.last for name, skill in skills.items() if skill.last is not None}
            self._last = {name: " ".join(word for word in (last.state.value, last.result) if word) for name, last in ends.items()}
            self.version += 1

    def heard_progress(self, execution_id: str, progress: float) -> None:
        """Store the progress (0 to 1) of an execution; ignore that of an execution that is not known to run."""
        with self._lock:
            if execution_id in self._running:
                self._running[execution_id] = replace(self._running[execution_id], progress=progress)
                self.version += 1

    def heard_data(self, name: str, *, value_json: str, stamp_ns: int, stale: bool) -> None:
        """Store the managers' answer on a data of which something was received."""
        with self._lock:
            self._readings[name] = _Reading(value_json, stamp_ns, stale)
            self.version += 1

    def heard_heartbeat(self, *, alive: bool) -> None:
        """Store whether the managers can be called."""
        with self._lock:
            if alive == self.alive:
                return
            self.alive = alive
            if not alive:
                self._running.clear()
            self.say(f"{self.root}: the managers {'are back' if alive else 'have gone'}")

    def say(self, line: str) -> None:
        """Add a line to the log."""
        with self._lock:
            self.log.append(line)
            self.logged += 1
            self.version += 1

    # --- what is shown -----------------------------------------------------------------------------------------------

    def resource_rows(self) -> list[ResourceRow]:
        """Return the resources in the model's order."""
        with self._lock:
            return [self._resource_row(resource) for resource in self.model.resources]

    def _resource_row(self, resource: Resource) -> ResourceRow:
        state = self._states.get(resource.name, "?")
        transitions = [transition for transition in resource.transitions if transition.extern]
        here = tuple(transition.target for transition in transitions if transition.source == state)
        return ResourceRow(
            resource.name,
            state,
            here,
            tuple(dict.fromkeys(transition.target for transition in transitions)),
            self._reasons.get(resource.name, ""),
        )

    def data_rows(self, now_ns: int) -> list[DataRow]:
        """Return the data in the model's order; ``now_ns`` is the mission clock."""
        with self._lock:
            return [self._data_row(data.name, now_ns) for data in self.model.data]

    def _data_row(self, name: str, now_ns: int) -> DataRow:
        reading = self._readings.get(name)
        if reading is None:
            return DataRow(name, "nothing received", None, stale=True)
        return DataRow(name, one_line(reading.value_json), max(0.0, (now_ns - reading.stamp_ns) / NANOSECONDS), reading.stale)

    def skill_rows(self) -> list[SkillRow]:
        """Return the skills in the model's order."""
        with self._lock:
            return [self._skill_row(skill.name) for skill in self.model.skills]

    def _skill_row(self, name: str) -> SkillRow:
        running = tuple(one for one in self._running.values() if one.skill == name)
        return SkillRow(name, running, self._last.get(name, ""), self._unmet(name))

    def _unmet(self, skill: str) -> tuple[str, ...]:
        if not self.alive:
            return ("the managers have gone",)
        if not self._states:
            return ("no states of the resources have been received yet",)
        fresh = {name: json.loads(r.value_json, object_hook=_named) for name, r in self._readings.items() if not r.stale}
        found = unmet(self.model, Situation(self._states, data=fresh), self.model.skill(skill))
        return tuple(one.reason + self._because(one.states) for one in found)

    def _because(self, resources: Iterable[str]) -> str:
        told = [f"{name}: {self._reasons[name]}" for name in resources if self._reasons.get(name)]
        return f" ({'; '.join(told)})" if told else ""


def one_line(value_json: str, width: int = VALUE_WIDTH) -> str:
    """Return a JSON value for one line: the fields without quotes and without their header, numbers rounded, cut to the width."""
    text = _brief(json.loads(value_json))
    return text if len(text) <= width else text[: width - 1] + "…"


def _brief(value: Any) -> str:
    if isinstance(value, dict):
        if set(value) == {"data"}:
            return _brief(value["data"])
        return " ".join(f"{name}={_brief(part)}" for name, part in value.items() if name != "header")
    if isinstance(value, list):
        return f"[{', '.join(_brief(part) for part in value)}]"
    if isinstance(value, bool):
        return str(value).lower()
    return f"{value:.4g}" if isinstance(value, float) else str(value)


def _named(fields: dict[str, Any]) -> Any:
    """Return an object of JSON as conditions look at data: by attribute; a message of std_msgs as the value that it carries."""
    return fields["data"] if set(fields) == {"data"} else SimpleNamespace(**fields)


def _told(event: EngineEvent) -> str:
    if isinstance(event, ExecutionEvent):
        words = [event.skill, event.id[:6], event.state.value, event.result]
        return " ".join(word for word in words if word) + (f": {event.message}" if event.message else "")
    return f"{event.resource} {event.from_state} -> {event.to_state} by {event.cause}"
