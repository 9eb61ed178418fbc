"""What a mission leaves in the run's folder, whatever middleware it ran over."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from functools import wraps
from pathlib import Path
from typing import Concatenate, ParamSpec

from alula.common import run_log
from alula.common.files import write_text
from alula.common.plain import to_plain
from alula.common.record import BLACKBOARD, DATA, DECISIONS, EVENTS, FILE, MISSION, OPERATOR, REPORTS, TICKS, TREE, RecordWriter
from alula.common.robots import RobotError, find_robot
from alula.missions.conditions import Condition
from alula.missions.director import Director, MissionResult, Outcome
from alula.missions.drawing import draw
from alula.missions.plan import MissionPlan
from alula.missions.skillset import Clock
from alula.runtime.core.events import EngineEvent, ExecutionEvent, event_record
from alula.runtime.handle import SkillHandle
from alula.trees.groot.watching import Watch
from alula.trees.view import NodeView

TREE_LOG, STOP_LOG = "mission.btlog", "stop_here.btlog"
"""Of a mission that is a file, and of what brought the robot to rest after it was left."""
FUTURE_NS = 1_000_000_000
"""By so much the clocks of two computers may be apart, corrected as they are."""
P = ParamSpec("P")


def _kept(method: Callable[Concatenate[MissionRecord, P], None]) -> Callable[Concatenate[MissionRecord, P], None]:
    """Make a method of a record log what it raises, so that its caller goes on."""

    @wraps(method)
    def kept(self: MissionRecord, /, *args: P.args, **kwargs: P.kwargs) -> None:
        try:
            method(self, *args, **kwargs)
        except Exception as error:  # noqa: BLE001 - values of robots, of any kind
            self.failure = self.failure or f"the mission can't be recorded: {type(error).__name__}: {error}"

    return kept


class MissionRecord:
    """Writes ``skills.mcap`` and ``mission.btlog`` on the way, ``tree.svg`` at the end.

    A folder that can't be written to any more ends the record and not the mission; ``problems`` says so. Nothing raises here: what can't
    be written, whatever the reason, is told by ``failure``, upon which the mission's driver has the robot come to rest.

    ``joins``: the managers ran before the mission, and tell it of what has happened; that is not the mission's, and is left out.
    """

    def __init__(self, out: Path, plan: MissionPlan, clock_ns: Clock, parameters: Mapping[str, float], *, joins: bool = False) -> None:
        self.problems: list[str] = []
        self.failure = ""
        """What first kept something from being recorded, other than the folder; empty: nothing did."""
        self._out = out
        self._plan = plan
        self._clock_ns = clock_ns
        self._parameters = dict(parameters)
        self._since_ns = clock_ns() if joins else None
        self._own: set[str] = set()
        """The skillsets of which an event of the mission itself has come: all that follow are."""
        self._joined: dict[str, int] = {}
        """The number of the last event of a skillset that was left out."""
        self._joined_told = True
        self._departure = departure_of_robot()
        self._departure_s: float | None = None
        self._unended: set[str] = set()
        self._decisions = 0
        self._view: NodeView | None = None
        self._blackboard: dict[str, object] = {}
        self._writer = RecordWriter(out / FILE)
        # So that a mission that is killed leaves one that says `running`.
        self._write_mission(MissionResult(Outcome.RUNNING), None, None)

    @property
    def unended(self) -> bool:
        """Return whether executions are open by the events so far: a result may arrive before its event."""
        return bool(self._unended)

    @property
    def departure_s(self) -> float | None:
        """When the robot's state of departure was left first, seconds of mission clock."""
        return self._departure_s

    # --- what the mission comes to know ------------------------------------------------------------------------------

    def _is_earlier(self, event: EngineEvent) -> bool:
        """Return whether an event was before the mission; where the wall clock was set back since, it may seem to be of the future."""
        if self._since_ns is None or event.skillset in self._own:
            return False
        earlier = not self._since_ns <= event.stamp_ns <= self._clock_ns() + FUTURE_NS
        if not earlier:
            self._own.add(event.skillset)
        return earlier

    @_kept
    def event(self, event: EngineEvent) -> None:
        """Write an event of a skillset."""
        if self._is_earlier(event):
            self._joined[event.skillset] = event.sequence
            self._joined_told = False
            return
        if not self._joined_told:  # also for a mission that is killed
            self._write_mission(MissionResult(Outcome.RUNNING), None, None)
        self._writer.write(EVENTS, event.stamp_ns, event_record(event))
        if isinstance(event, ExecutionEvent):
            (self._unended.discard if event.state.terminal else self._unended.add)(event.id)
        elif self._departure_s is None and self._departure == (event.resource, event.from_state):
            self._departure_s = event.stamp_s

    @_kept
    def report(self, skillset: str, handle: SkillHandle) -> None:
        """Record a report of an execution to the tree."""
        told = {"skillset": skillset, "skill": handle.skill, "id": handle.id, "state": handle.state.value, "progress": handle.progress}
        told |= {"result": handle.result, "message": handle.message, "outputs": to_plain(handle.outputs)}
        self._write(REPORTS, told)

    @_kept
    def sample(self, skillset: str, data: str, value: object, stamp_ns: int | None) -> None:
        """Write a value of a data; ``stamp_ns`` None: it is not known when it came, so it is now."""
        stamp_ns = self._clock_ns() if stamp_ns is None else stamp_ns
        content = {"skillset": skillset, "data": data, "value": to_plain(value), "stamp_s": stamp_ns / 1e9}
        self._writer.write(DATA, stamp_ns, content)

    def log_tree(self, watch: Watch, name: str = TREE_LOG) -> None:
        """Have the statuses of a tree's nodes logged, for Groot2 to replay."""
        try:
            watch.log(self._out / name)
        except OSError as error:
            self.problems.append(f"{name} could not be written: {error.strerror or error}")

    def abort(self, reason: str) -> None:
        """Record that the operator stops the mission; call it before the mission stops."""
        self.told("abort", reason)

    @_kept
    def told(self, command: str, reason: str) -> None:
        """Write what the mission is told from outside (``abort``, ``pause``, ``resume``) before it obeys, and what came of it (``paused``).

        The reason may be empty.
        """
        self._write(OPERATOR, {"command": command, "by": "mission", "reason": reason})

    # --- what the mission does ---------------------------------------------------------------------------------------

    @_kept
    def tick(self, conditions: Sequence[Condition]) -> None:
        """Write that the tree is ticked now, and what the mission needs to start, before it has; to be called before it is."""
        known = {"conditions": [[one.needed, one.unmet] for one in conditions]} if conditions else {}
        self._write(TICKS, {"unmet": [one.unmet for one in conditions if one.unmet], **known})

    @_kept
    def decision(self, kind: str, skillset: str, skill: str, execution_id: str, inputs: Mapping[str, object]) -> None:
        """Write a request of the tree."""
        self._decisions += 1
        what: dict[str, object] = {"number": self._decisions, "kind": kind, "skillset": skillset, "skill": skill, "id": execution_id}
        self._write(DECISIONS, {**what, "inputs": to_plain(inputs)})

    @_kept
    def outcome_of_tick(self, director: Director) -> None:
        """Write what a tick has changed in the tree and in the context."""
        view = director.view()
        if view != self._view:
            self._view = view
            self._write(TREE, view.as_dict())
        values = {name: to_plain(value) for name, value in director.context.values().items()}
        changed = {name: value for name, value in values.items() if name not in self._blackboard or self._blackboard[name] != value}
        if changed:
            self._blackboard = values
            self._write(BLACKBOARD, changed)

    def finish(self, end: MissionResult, director: Director, end_s: float) -> None:
        """Write what is left to write."""
        self._draw(end, director)
        self._write_mission(end, director.start_s, end_s)
        self._writer.close()

    # --- inside ------------------------------------------------------------------------------------------------------

    @_kept
    def _ask_facts(self, facts: dict[str, object]) -> None:
        facts |= to_plain(self._plan.facts())

    @_kept
    def _draw(self, end: MissionResult, director: Director) -> None:
        title = f"Mission {self._plan.scenario}: {end.outcome.value.replace('_', ' ')}"
        try:
            write_text(self._out / "tree.svg", draw(director.view(), title))
        except OSError as error:
            self.problems.append(f"the tree could not be written: {error.strerror or error}")

    def _write(self, topic: str, content: Mapping[str, object]) -> None:
        self._writer.write(topic, self._clock_ns(), content)

    def _write_mission(self, end: MissionResult, start_s: float | None, end_s: float | None) -> None:
        self._joined_told = True
        if self._writer.error and self._writer.error not in self.problems:
            self.problems.append(self._writer.error)
        facts: dict[str, object] = {}
        self._ask_facts(facts)
        if self.failure and self.failure not in self.problems:
            self.problems.append(self.failure)
        content = {
            "scenario": self._plan.scenario,
            "outcome": end.outcome.value,
            "reason": end.reason,
            "start_s": start_s,
            "lift_off_s": self._departure_s,
            "end_s": end_s,
            "parameters": self._parameters,
            "inputs": to_plain(self._plan.inputs),
            "problems": self.problems,
            **({"joined": self._joined} if self._joined else {}),
            **facts,
        }
        self._write(MISSION, content)
        if self._writer.error:
            run_log.note(self._out, run_log.MISSION, {**content, "problems": list(dict.fromkeys([*self.problems, self._writer.error]))})


def departure_of_robot() -> tuple[str, str] | None:
    """Return resource and state that the robot of this process leaves at its departure; None: there is no robot, or it has none."""
    try:
        return find_robot().departure
    except RobotError:
        return None
