"""Replay a recorded mission in virtual time, without ROS: its tree, or another, gets the recorded inputs at the recorded ticks.

1. What the record says of the robot happens under real managers in virtual time (``robot``, ``functional``).
2. The tree is ticked when it was ticked.
3. What it asks for is held against what it asked for. As long as both agree, the record answers.
4. At the first difference the replay stops; or it goes on over mocks, the tree ticked at 10 Hz and whenever something happens.
"""

from __future__ import annotations

import contextlib
import time
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

from alula.common.faults import FaultRequest
from alula.common.plain import to_plain
from alula.common.record import OPERATOR, TICKS, Entry
from alula.missions.director import Director, MissionResult, Outcome
from alula.missions.driver import MissionDriver
from alula.missions.pausing import PauseRefusedError
from alula.missions.plan import MissionPlan
from alula.missions.record import MissionRecord
from alula.missions.skillset import MissionClient, Recorder
from alula.records.replay.comparison import Comparison, Difference
from alula.records.replay.recorded import Knowledge, Recorded, RecordedDecision, ReplayError
from alula.records.replay.robot import ReplayedRobot
from alula.records.tree import path_to
from alula.runtime.client import Client
from alula.runtime.core.events import EngineEvent
from alula.runtime.handle import SkillHandle

LIMIT_S = 3600.0
"""Mission clock after the record's end, after which a mission that goes round in circles is left."""
MAX_GAP_S = 86400.0
"""A mission ticks, so a longer silence is a damaged stamp; virtual time would take minutes or years to get there."""


@dataclass(frozen=True)
class Result:
    """What came of a replay: its decisions, the first difference, and how it ended, None where it was stopped before.

    ``faults``: what was to fail that had not; ``first_s``: when mocks say that each came first, by its name in their behaviour, seconds of
    mission clock, as ``lift_off_s``, which is known with a record only.
    """

    decisions: Sequence[RecordedDecision]
    difference: Difference | None
    end: MissionResult | None
    notes: Sequence[str]
    simulated_s: float
    wall_s: float
    lift_off_s: float | None
    faults: Sequence[FaultRequest]
    first_s: Mapping[str, float]


class ReplayClient(MissionClient):
    """A skillset's client that knows the handles that it gave out."""

    def __init__(self, client: Client, wake: Callable[[], None], recorder: Recorder, handles: dict[str, SkillHandle]) -> None:
        super().__init__(client, wake, recorder)
        self._handles = handles

    def start(self, skill: str, **inputs: object) -> SkillHandle:
        """Start an execution and remember its handle by its id."""
        handle = super().start(skill, **inputs)
        self._handles[handle.id] = handle
        return handle


class Replay:
    """One replay.

    Args:
        recorded: what is replayed.
        robot: the one under the tree, serving the plan's skillsets.
        entries: what the robot and the tree receive, in order.
        plan: the mission, its own or another.
        parameters: of the mission.
        go_on: go on after the first difference.
        record: makes what keeps this replay's own record, given its clock.
        rate: mission clock a second of wall clock at most; 0: no limit.
    """

    def __init__(
        self,
        recorded: Recorded,
        robot: ReplayedRobot,
        entries: Iterable[Entry],
        plan: MissionPlan,
        *,
        parameters: Mapping[str, float],
        go_on: bool = False,
        record: Callable[[Callable[[], int]], MissionRecord] | None = None,
        rate: float = 0.0,
    ) -> None:
        self._recorded = recorded
        self._entries = entries
        self._go_on = go_on
        self._rate = rate
        self._ticked = recorded.started
        self.robot = robot
        self.decisions: list[RecordedDecision] = []
        self._world = self.robot.world
        clock_ns = lambda: self._world.clock.now_ns  # noqa: E731
        self._record = None if record is None else record(clock_ns)
        client = lambda name, wake: ReplayClient(self._world.client(name), wake, self, robot.handles)  # noqa: E731
        self._driver = MissionDriver(plan, client, clock_ns, parameters, record=self._record, soon=self._world.clock.soon)
        self._driver.remembers = True
        self._driver.woken_by_events = False  # while the record says when it is ticked
        self._comparison = Comparison(recorded, self._knowledge)
        robot.differs = lambda why: self._comparison.told(why, self._world.now_s)
        self._world.on_event(self._on_event)

    def run(self) -> Result:
        """Replay to the end, to the first difference, or to where the record breaks off."""
        begun, start_s = time.monotonic(), self._world.now_s
        for entry in self._entries:
            self._advance_to(entry.stamp_ns, begun, start_s)
            self._take(entry)
            self._world.run_for(0.0)
            self._comparison.passed(self._world.now_s)
            if not self._may_go_on():
                break
        if self._may_go_on():
            self._after_the_record()
        self._driver.finish(self.director.end or MissionResult(Outcome.RUNNING))
        notes = [*self._world.errors, *self.robot.host.notes]
        return Result(
            decisions=self.decisions,
            difference=self._comparison.difference,
            end=self.director.end,
            notes=notes,
            simulated_s=self._world.now_s,
            wall_s=time.monotonic() - begun,
            lift_off_s=None if self._record is None else self._record.departure_s,
            faults=self.robot.faults,
            first_s=dict(self.robot.mocks.faults),
        )

    # --- what the record says ----------------------------------------------------------------------------------------

    def _advance_to(self, stamp_ns: int, begun: float, start_s: float) -> None:
        over = lambda: not self._may_go_on()  # noqa: E731
        wait_s = max(0, stamp_ns - self._world.clock.now_ns) / 1e9
        if wait_s > MAX_GAP_S:
            raise ReplayError(
                f"{self._recorded.path}: nothing was recorded from {self._world.now_s:.3f} s to {stamp_ns / 1e9:.3f} s of mission clock; "
                "a stamp there is damaged"
            )
        self._world.run_until(over, timeout_s=wait_s)
        if self._rate > 0.0:
            time.sleep(max(0.0, begun + (self._world.now_s - start_s) / self._rate - time.monotonic()))

    def _take(self, entry: Entry) -> None:
        if entry.topic == TICKS:
            if not self._driver.woken_by_events and not (self._ticked and entry.value.get("unmet")):
                self._driver.tick()
        elif entry.topic == OPERATOR:
            if entry.value.get("by") == "mission":
                self._obey(str(entry.value.get("command")), str(entry.value.get("reason", "")))
        else:
            self.robot.take(entry, diverged=self._comparison.difference is not None)

    def _obey(self, command: str, reason: str) -> None:
        """Give the mission the recorded commands of the operator, where it can obey them now."""
        if command == "abort":
            self._driver.abort(reason)
        elif command in {"pause", "resume"}:
            with contextlib.suppress(PauseRefusedError):
                self._driver.set_paused(paused=command == "pause")

    def _after_the_record(self) -> None:
        """Go on without it, where that was asked for; what was expected and did not come is a difference."""
        if self._comparison.difference is None:
            self._comparison.over(self._world.now_s, whole=self._recorded.whole and self.director.end is None)
        if self._go_on and self.director.end is None:
            self._set_free()
            self.robot.over()
            self._world.run_until(lambda: self.director.end is not None, timeout_s=LIMIT_S)

    # --- the tree ----------------------------------------------------------------------------------------------------

    @property
    def director(self) -> Director:
        """What drives the tree."""
        return self._driver.director

    def _set_free(self) -> None:
        """Let the tree be ticked by the clock and by what happens from now on."""
        if not self._driver.woken_by_events:
            self._driver.woken_by_events = True
            self._driver.tick_regularly(self._world.clock.after)

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
        now = RecordedDecision(len(self.decisions) + 1, self._world.now_s, kind, skillset, skill, execution_id, said)
        if self._may_go_on():  # else this is the rest of the tick that has decided otherwise
            self.decisions.append(now)
        then = self._comparison.decided(now, self.robot.recorded_id(execution_id))
        if kind == "start":
            self.robot.requested(skillset, skill, execution_id, then)
        if self._record is not None:
            self._record.decision(kind, skillset, skill, execution_id, inputs)

    def report(self, skillset: str, handle: SkillHandle) -> None:
        """Record a report of an execution to the tree."""
        if self._record is not None:
            self._record.report(skillset, handle)

    def sample(self, skillset: str, data: str, value: object, stamp_ns: int | None) -> None:
        """Write a value of a data."""
        if self._record is not None:
            self._record.sample(skillset, data, value, stamp_ns)

    def _on_event(self, _skillset: str, event: EngineEvent) -> None:
        self._driver.event(event)

    def _knowledge(self, skill: str) -> Knowledge:
        resources = {
            f"{name}.{resource}": status.state
            for name, managers in self._world.managers.items()
            for resource, status in managers.engine.resources.items()
        }
        blackboard = to_plain(self.director.context.values())
        return Knowledge(resources, blackboard, " > ".join(path_to(self.director.view().as_dict(), skill)))
