"""A recorded mission: what its executions came to and when, what the tree decided, and what it knew then."""

from __future__ import annotations

import contextlib
import json
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from alula.common.errors import AlulaError
from alula.common.record import BLACKBOARD, DATA, DECISIONS, EVENTS, FILE, MISSION, REPORTS, TICKS, TREE, Entry, RecordError, RecordFollower
from alula.model.execution_state import ExecutionState
from alula.records.tree import path_to
from alula.runtime.core.events import EngineEvent, ExecutionEvent, read_event

EXTERN = "extern"


class ReplayError(AlulaError):
    """A replay can't be made as it was asked for; the message says why, in one line."""


@dataclass(frozen=True)
class RecordedDecision:
    """A request of the tree. ``id`` is the execution's; it differs from run to run."""

    number: int
    t_s: float
    kind: str
    skillset: str
    skill: str
    id: str
    inputs: Mapping[str, Any]

    def words(self) -> str:
        """Return what a person wants to read."""
        said = ", ".join(f"{name}={_short(value)}" for name, value in self.inputs.items())
        return f"{self.kind} {self.skillset}.{self.skill}{f' ({said})' if said else ''}"


@dataclass(frozen=True)
class Knowledge:
    """What a decision was made of: resources by ``skillset.name``, the blackboard, and the path of the node in the tree."""

    resources: Mapping[str, str] = field(default_factory=dict)
    blackboard: Mapping[str, Any] = field(default_factory=dict)
    path: str = ""


@dataclass(frozen=True)
class RecordedExecution:
    """An execution of a record: what became of it, and when."""

    skillset: str
    skill: str
    id: str
    inputs: Mapping[str, Any]
    requested_s: float
    ended_s: float | None = None
    state: ExecutionState = ExecutionState.REQUESTED
    result: str = ""
    message: str = ""
    outputs: Mapping[str, Any] = field(default_factory=dict)

    @property
    def duration_s(self) -> float | None:
        """How long it took; None where it never ended."""
        return None if self.ended_s is None else max(0.0, self.ended_s - self.requested_s)


@dataclass(frozen=True)
class Recorded:
    """One recorded mission.

    Attributes:
        path: the file.
        entries: all of it, in the order in which the mission came to know.
        mission: what was asked for and, unless the record breaks off, how it ended.
        decisions: what the tree asked for, in order.
        executions: by the id of the execution.
        whole: whether the record was ended as records are.
    """

    path: Path
    entries: Sequence[Entry]
    mission: Mapping[str, Any]
    decisions: Sequence[RecordedDecision]
    executions: Mapping[str, RecordedExecution]
    whole: bool

    @property
    def scenario(self) -> str:
        """The scenario's name, empty where the record has none."""
        return str(self.mission.get("scenario", ""))

    @property
    def outcome(self) -> str:
        """How it ended, empty where the record breaks off before."""
        outcome = str(self.mission.get("outcome", ""))
        return "" if outcome == "running" else outcome

    @property
    def begun_s(self) -> float:
        """When the record begins, seconds of mission clock."""
        return min(entry.stamp_s for entry in self.entries)

    @property
    def lift_off_s(self) -> float | None:
        """When the robot departed, seconds of mission clock; None: never."""
        lift_off_s = self.mission.get("lift_off_s")
        return float(lift_off_s) if isinstance(lift_off_s, int | float) else None

    @property
    def zero_s(self) -> float:
        """What times count from: the departure, or the record's beginning where there was none."""
        return self.begun_s if self.lift_off_s is None else self.lift_off_s

    @property
    def started(self) -> bool:
        """Return whether the mission ever began."""
        return any(entry.topic == TICKS and not entry.value.get("unmet") for entry in self.entries)

    @property
    def reported(self) -> bool:
        """Return whether the record has the reports to the tree, and not only the events."""
        return any(entry.topic == REPORTS for entry in self.entries)

    def knowledge(self, decision: RecordedDecision) -> Knowledge:
        """Return what was known when a decision was made."""
        resources: dict[str, str] = {}
        blackboard: dict[str, Any] = {}
        tree: Mapping[str, Any] = {}
        passed = False
        for entry in self.entries:
            if entry.topic == TREE and passed:
                tree = entry.value  # the first view after the decision shows the node at work
                break
            if entry.topic == DECISIONS and entry.value.get("number") == decision.number:
                passed = True
            elif entry.topic == EVENTS and not passed and entry.value.get("kind") == "TRANSITION":
                resources[f"{entry.value['skillset']}.{entry.value['resource']}"] = str(entry.value["to_state"])
            elif entry.topic == BLACKBOARD and not passed:
                blackboard |= entry.value
        return Knowledge(resources, blackboard, " > ".join(path_to(tree, f"{decision.skillset}.{decision.skill}")))


def load(path: Path) -> Recorded:
    """Read a run's folder, its ``skills.mcap``, or the one beside a bag, up to where it was cut off.

    Raises:
        ReplayError: there is no such file, it is no record, it is damaged, or there is no mission in it.
    """
    file = path / FILE if path.is_dir() else path.with_name(FILE) if path.suffix == ".bag" else path
    if not file.is_file():
        bag = f"; {path.name} alone does not tell which mission was run" if path.suffix == ".bag" else ""
        raise ReplayError(f"{file}: there is no such record{bag}")
    follower = RecordFollower(file)
    try:
        entries = follower.poll()
    except (RecordError, OSError) as error:
        raise ReplayError(str(error)) from error
    if follower.broken:
        raise ReplayError(f"{file}: {follower.broken}; what stands before is in its report (alula report {file.parent})")
    missions = [entry.value for entry in entries if entry.topic == MISSION]
    if not missions:
        raise ReplayError(f"{file}: there is no mission in it")
    _check(file, entries)
    return Recorded(file, entries, missions[-1], list(_decisions(file, entries)), _executions(file, entries), follower.ended)


def event_of(entry: Entry) -> EngineEvent:
    """Return the event of an entry of ``/events``; raises ValueError."""
    return read_event(entry.value)


@contextlib.contextmanager
def _of(file: Path, entry: Entry) -> Iterator[None]:
    """Raise ReplayError, naming the entry, where one lacks a field that a replay reads."""
    place = f"{file}: the message on {entry.topic} at {entry.stamp_s:.3f} s of mission clock"
    try:
        yield
    except KeyError as error:
        raise ReplayError(f"{place} has no {error}, which every mission of Alula writes there") from None
    except (TypeError, ValueError) as error:
        raise ReplayError(f"{place} makes no sense: {error}") from None


def _check(file: Path, entries: Iterable[Entry]) -> None:
    for entry in entries:
        value = entry.value
        with _of(file, entry):
            if entry.topic == REPORTS:
                str(value["id"]), float(value.get("progress") or 0.0), ExecutionState(value["state"]), dict(value.get("outputs") or {})
            elif entry.topic == DATA:
                str(value["skillset"]), str(value["data"]), value["value"]


def _decisions(file: Path, entries: Iterable[Entry]) -> Iterator[RecordedDecision]:
    for entry in entries:
        if entry.topic == DECISIONS:
            value = entry.value
            with _of(file, entry):
                kind, skillset, skill, id_ = (str(value[name]) for name in ("kind", "skillset", "skill", "id"))
                decision = RecordedDecision(int(value["number"]), entry.stamp_s, kind, skillset, skill, id_, dict(value["inputs"]))
            yield decision


def _executions(file: Path, entries: Iterable[Entry]) -> dict[str, RecordedExecution]:
    """Put together what is known of each execution."""
    executions: dict[str, RecordedExecution] = {}
    for entry in entries:
        with _of(file, entry):
            event = event_of(entry) if entry.topic == EVENTS else None
        if isinstance(event, ExecutionEvent):
            executions[event.id] = _advance(executions.get(event.id), event)
    return executions


def _advance(before: RecordedExecution | None, event: ExecutionEvent) -> RecordedExecution:
    inputs = event.inputs if isinstance(event.inputs, Mapping) else {}
    execution = before or RecordedExecution(event.skillset, event.skill, event.id, dict(inputs), event.stamp_s)
    if execution.state.terminal:
        return execution
    ended_s = event.stamp_s if event.state.terminal else None
    values = {"state": event.state, "result": event.result, "message": event.message, "outputs": dict(event.outputs), "ended_s": ended_s}
    return RecordedExecution(**{**vars(execution), **values})


def _short(value: Any) -> str:
    return f"{value:g}" if isinstance(value, float) else json.dumps(value) if isinstance(value, dict | list) else str(value)
