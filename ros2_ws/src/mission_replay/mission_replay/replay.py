"""A recorded mission again, in virtual time and without ROS: its own tree, or another, is ticked when it was and told what it was told.

1. What the record says of the vehicle happens in real managers in virtual time: extern transitions, data, ends of executions.
2. The tree is ticked when it was ticked.
3. What it asks for is held against what it asked for. As long as both agree, the record answers.
4. At the first difference the replay stops; or it goes on over mocks, the tree ticked at 10 Hz and whenever something happens.
"""

from __future__ import annotations

import time
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

from alula_common.faults import FaultRequest
from alula_common.record import DATA, OPERATOR, REPORTS, TICKS, Entry
from mission_replay.comparison import Comparison, Difference
from mission_replay.recorded import Decision, Knowledge, Recorded, ReplayError, event_of, extern_transition, path_to
from mission_replay.vehicle import Vehicle
from skill_missions.director import Director, End, Outcome
from skill_missions.plan import MissionPlan
from skill_missions.record import MissionRecord
from skill_missions.skillset import MissionClient, Recorder
from skill_model.execution_state import ExecutionState
from skill_model.model import Skillset
from skill_runtime.client import Client
from skill_runtime.core.events import EngineEvent, ExecutionEvent
from skill_runtime.handle import SkillHandle
from skill_runtime.mock import Behaviour
from skill_runtime.plain import to_plain

TICK_PERIOD_S = 0.1
LIMIT_S = 3600.0
"""Mission clock after the record's end, after which a mission that goes round in circles is left."""


@dataclass(frozen=True)
class Result:
    """What came of a replay: its decisions, the first difference, and how it ended, None where it was stopped before."""

    decisions: Sequence[Decision]
    difference: Difference | None
    end: End | None
    notes: Sequence[str]


class ReplayClient(MissionClient):
    """A skillset's client that knows the handles that it gave out."""

    def __init__(self, client: Client, wake: Callable[[], None], recorder: Recorder, handles: dict[str, SkillHandle]) -> None:
        super().__init__(client, wake, recorder)
        self._handles = handles

    def start(self, skill: str, **inputs: object) -> SkillHandle:
        """Start an execution."""
        handle = super().start(skill, **inputs)
        self._handles[handle.id] = handle
        return handle


class Replay:
    """One replay.

    Args:
        recorded: what is replayed.
        plan: the mission, its own or another.
        skillsets: the models, its own or others.
        behaviour: of the mocks that answer what the record does not.
        parameters: of the mission.
        faults: what happens that did not happen.
        go_on: go on after the first difference.
        record: makes what keeps this replay's own record, given its clock.
        rate: mission clock a second of wall clock at most; 0: no limit.
    """

    def __init__(
        self,
        recorded: Recorded,
        plan: MissionPlan,
        skillsets: Sequence[Skillset],
        behaviour: Behaviour,
        *,
        parameters: Mapping[str, float],
        faults: Sequence[FaultRequest] = (),
        go_on: bool = False,
        record: Callable[[Callable[[], int]], MissionRecord] | None = None,
        rate: float = 0.0,
    ) -> None:
        if not recorded.entries:
            raise ReplayError(f"{recorded.path}: is empty")
        self._recorded = recorded
        self._go_on = go_on
        self._rate = rate
        self._ticked = recorded.started
        self.vehicle = Vehicle(skillsets, recorded.answers, behaviour, start_s=min(entry.stamp_ns for entry in recorded.entries) / 1e9)
        self.decisions: list[Decision] = []
        self._world = self.vehicle.world
        self._free = False
        self._due = False
        clock_ns = lambda: self._world.clock.now_ns  # noqa: E731
        self._record = None if record is None else record(clock_ns)
        clients = {s.name: ReplayClient(self._world.client(s.name), self._wake, self, self.vehicle.handles) for s in skillsets}
        mission, blackboard = plan.make(clients, clock_ns, parameters)
        self.director = Director(mission, blackboard)
        self._comparison = Comparison(recorded, self._knowledge)
        for fault in faults:
            self.vehicle.fail(fault)
        self._world.on_event(self._on_event)

    def run(self) -> Result:
        """Replay to the end, to the first difference, or to where the record breaks off."""
        begun, start_s = time.monotonic(), self._world.now_s
        for entry in self._recorded.entries:
            self._advance_to(entry.stamp_ns, begun, start_s)
            self._take(entry)
            self._world.run_for(0.0)
            self._comparison.passed(self._world.now_s)
            if not self._may_go_on():
                break
        if self._may_go_on():
            self._after_the_record()
        if self._record is not None:
            end = self.director.end or End(Outcome.RUNNING)
            self._record.finish(end, self.director, self._world.now_s)
        notes = [*self._world.errors, *self.vehicle.stage.notes]
        return Result(self.decisions, self._comparison.difference, self.director.end, notes)

    # --- what the record says ----------------------------------------------------------------------------------------

    def _advance_to(self, stamp_ns: int, begun: float, start_s: float) -> None:
        over = lambda: not self._may_go_on()  # noqa: E731
        self._world.run_until(over, timeout_s=max(0, stamp_ns - self._world.clock.now_ns) / 1e9)
        if self._rate > 0.0:
            time.sleep(max(0.0, begun + (self._world.now_s - start_s) / self._rate - time.monotonic()))

    def _take(self, entry: Entry) -> None:
        event = extern_transition(entry)
        if event is not None:
            self.vehicle.transition(event, diverged=self._free)
        elif entry.topic == REPORTS:
            value = entry.value
            progress, outputs = float(value.get("progress") or 0.0), value.get("outputs") or {}
            self.vehicle.report(str(value["id"]), progress, ExecutionState(value["state"]), outputs)
        elif entry.topic == DATA:
            self.vehicle.sample(str(entry.value["skillset"]), str(entry.value["data"]), entry.value["value"])
        elif entry.topic == TICKS and not self._free:
            if not (self._ticked and entry.value.get("unmet")):
                self._tick()
        elif entry.topic == OPERATOR and entry.value.get("command") == "abort" and entry.value.get("by") == "mission":
            self.director.abort(str(entry.value.get("reason", "")))
        elif not self._recorded.reported:
            self._take_event(entry)

    def _take_event(self, entry: Entry) -> None:
        """Take the end of an execution from its event, where the record does not say what the tree was told."""
        event = event_of(entry) if entry.value.get("kind") == "EXECUTION" else None
        if isinstance(event, ExecutionEvent) and event.state.terminal:
            self.vehicle.report(event.id, 1.0, event.state, event.outputs)

    def _after_the_record(self) -> None:
        """Go on without it, where that was asked for; what was expected and did not come is a difference."""
        if self.director.end is None and self._recorded.whole and self._comparison.difference is None:
            self._comparison.over(self._world.now_s)
        if self._go_on and self.director.end is None:
            self._set_free()
            self.vehicle.over()
            self._world.run_until(lambda: self.director.end is not None, timeout_s=LIMIT_S)

    # --- the tree ----------------------------------------------------------------------------------------------------

    def _tick(self) -> None:
        self._due = False
        if self._record is not None:
            self._record.tick(self.director)
        try:
            self.director.step()
        except Exception as error:  # noqa: BLE001 - as in flight: whatever breaks in a tree, the robot has to come to rest
            self.director.abort(f"the tree raised {type(error).__name__}: {error}")
        if self._record is None:
            self.director.remember()
        else:
            self._record.outcome_of_tick(self.director)

    def _wake(self) -> None:
        """Have the tree ticked once after all that happens at this moment; while the record says when, it is not up to events."""
        if self._free and not self._due and self.director.end is None:
            self._due = True
            self._world.clock.soon(self._tick)

    def _set_free(self) -> None:
        """Let the tree be ticked by the clock and by what happens from now on."""
        if not self._free:
            self._free = True
            self._tick_regularly()

    def _tick_regularly(self) -> None:
        if self.director.end is None:
            self._world.clock.after(TICK_PERIOD_S, self._tick_regularly)
            self._wake()

    def _may_go_on(self) -> bool:
        if self._comparison.difference is None:
            return True
        if self._go_on:
            self._set_free()
        return self._go_on and self.director.end is None

    # --- what the tree does ------------------------------------------------------------------------------------------

    def decision(self, kind: str, skillset: str, skill: str, execution_id: str, inputs: Mapping[str, object]) -> None:
        """Hold a request of the tree against the record."""
        said: dict[str, Any] = to_plain(inputs)
        now = Decision(len(self.decisions) + 1, self._world.now_s, kind, skillset, skill, execution_id, said)
        if self._may_go_on():  # else this is the rest of the tick that has decided otherwise
            self.decisions.append(now)
        then = self._comparison.decided(now, self.vehicle.recorded_id(execution_id))
        if kind == "start":
            self.vehicle.requested(skillset, skill, execution_id, None if then is None else then.id)
        if self._record is not None:
            self._record.decision(kind, skillset, skill, execution_id, inputs)

    def report(self, skillset: str, handle: SkillHandle) -> None:
        """Write what the tree is told of an execution."""
        if self._record is not None:
            self._record.report(skillset, handle)

    def sample(self, skillset: str, data: str, value: object, stamp_ns: int | None) -> None:
        """Write a value of a data."""
        if self._record is not None:
            self._record.sample(skillset, data, value, stamp_ns)

    def _on_event(self, _skillset: str, event: EngineEvent) -> None:
        if self._record is not None:
            self._record.event(event)
        self._wake()

    def _knowledge(self, skill: str) -> Knowledge:
        resources = {
            f"{name}.{resource}": status.state
            for name, managers in self._world.managers.items()
            for resource, status in managers.engine.resources.items()
        }
        blackboard = to_plain(self.director.blackboard.values())
        return Knowledge(resources, blackboard, path_to(self.director.view().as_dict(), skill))
