"""The recorded robot under the tree: real managers in virtual time; below them what was recorded, and mocks where nothing was."""

from __future__ import annotations

import random
from collections import deque
from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace

from alula.common.faults import FaultRequest
from alula.common.record import DATA, EVENTS, REPORTS, Entry
from alula.mock import NEVER, Behaviour, Choice, Ending, LocalMockHost, MockRobot, MockSkill, MockState, Rule, serve_robot
from alula.model.execution_state import ExecutionState
from alula.model.model import Skill, Skillset
from alula.records.replay.recorded import EXTERN, Recorded, RecordedDecision, RecordedExecution, event_of
from alula.runtime.core.events import EngineEvent, TransitionEvent
from alula.runtime.core.execution import Execution
from alula.runtime.handle import SkillHandle
from alula.runtime.local import LocalWorld


class ReplayedSkill(MockSkill):
    """The hooks of one skill: a call that was recorded is answered by the record, any other one by the mock's rules."""

    def __init__(
        self, skills: RecordedSkills, state: MockState, skillset: str, skill: Skill, rules: Sequence[Rule], chance: random.Random
    ) -> None:
        super().__init__(state, skillset, skill, rules, chance)
        self._skills = skills

    def choose(self, inputs: object) -> Choice:
        """Let the record end the call, where it does; the rules still say what the call moves."""
        choice = super().choose(inputs)
        recorded = self._skills.next_execution(".".join(self.place))
        if recorded is None:
            return choice
        by_itself = recorded.state is ExecutionState.TERMINATED
        delay = choice.script.delay if not by_itself or recorded.duration_s is None else recorded.duration_s
        refused = recorded.state is ExecutionState.NOT_VALIDATED
        ending = Ending(refuse=recorded.message or "refused") if refused else NEVER
        return Choice(replace(choice.script, delay=delay, ending=ending, progress=0.0, outputs={}, changes=()), "")

    def on_dispatch(self, execution: Execution) -> None:
        """Begin the execution; the replay ends it as the record says."""
        super().on_dispatch(execution)
        self._skills.dispatched(execution, self)

    def progress(self, execution: Execution) -> float:
        """Return the progress that was reported last."""
        told = self._skills.progress_of(execution.id)
        return super().progress(execution) if told is None else told

    def on_interrupt(self, execution: Execution) -> bool | None:
        """Stop; done when it was done in the record."""
        super().on_interrupt(execution)
        return False if self._skills.stops_later(execution.id) else None

    def on_pause(self, execution: Execution) -> str | None:
        """Hold where it held in the record."""
        return "" if self._skills.held(execution.id) else super().on_pause(execution)

    def on_resume(self, execution: Execution) -> str | None:  # noqa: ARG002
        """Accept: the record says when it ends."""
        return ""


class ReplayHost(LocalMockHost):
    """The mock robot's host: mocks give the data of a skillset only where the record's are no longer true."""

    def __init__(self, world: LocalWorld) -> None:
        super().__init__(world)
        self.mocked: set[str] = set()

    def publish(self, skillset: str, data: str, value: object) -> None:
        """Publish a value of the mocks."""
        if skillset in self.mocked:
            super().publish(skillset, data, value)

    def publish_recorded(self, skillset: str, data: str, value: object) -> None:
        """Publish a value of the record; data that another model does not have are left out and noted."""
        if skillset in self.mocked:
            return
        try:
            super().publish(skillset, data, value)
        except KeyError as error:
            if str(error.args[0]) not in self.notes:
                self.note(str(error.args[0]))


class ReplayedRobot:
    """Virtual time, the mock robot, and which execution is which of the record: the base of replays of every depth.

    Args:
        behaviour: of the mocks; what it has happen by the clock is what the record tells nothing of.
        start_s: mission clock at the beginning.
    """

    def __init__(self, behaviour: Behaviour, *, start_s: float) -> None:
        self.world = LocalWorld(start_s=start_s)
        self.host = ReplayHost(self.world)
        self.mocks = MockRobot(behaviour, self.host)
        self.handles: dict[str, SkillHandle] = {}
        self.faults: list[FaultRequest] = []
        self.differs: Callable[[str], None] = lambda _: None
        """Called with each difference below the decisions of the tree, in words."""
        rules = [rule for found in behaviour.rules.values() for rule in found]
        self.caused = {place for rule in rules for change in rule.changes or () for place in change.states}
        """The resources that skills have change."""
        self._recorded: dict[str, str] = {}
        """The record's id of an execution of this replay."""

    def fail(self, request: FaultRequest) -> None:
        """Have a fault happen that was not recorded; raises SkillRuntimeError where there is none."""
        self.mocks.fail(request)
        self.faults.append(request)

    def requested(self, skillset: str, skill: str, execution_id: str, then: RecordedDecision | None) -> None:
        """Take note of a request; ``then``: the same one in the record, None where there is none."""
        raise NotImplementedError

    def take(self, entry: Entry, *, diverged: bool) -> None:
        """Apply an entry of the record; ``diverged``: the tree has decided otherwise than in the record."""
        raise NotImplementedError

    def recorded_id(self, execution_id: str) -> str | None:
        """Return the record's id of an execution of this replay."""
        return self._recorded.get(execution_id)

    def over(self) -> None:
        """Take that the record has ended."""
        self.host.mocked |= set(self.world.managers)


class RecordedSkills(ReplayedRobot):
    """Skills end as they did, resources and data change as they did.

    Args:
        skillsets: the models that the managers execute.
        recorded: the record.
        behaviour: of the mocks that answer what was not recorded.
        start_s: mission clock at the beginning.
    """

    def __init__(self, skillsets: Sequence[Skillset], recorded: Recorded, behaviour: Behaviour, *, start_s: float) -> None:
        super().__init__(behaviour, start_s=start_s)
        self._executions = recorded.executions
        self._reported = recorded.reported
        events = (entry.value for entry in recorded.entries if entry.topic == EVENTS)
        self._held = {str(event.get("id")) for event in events if event.get("state") == ExecutionState.PAUSED.value}
        self._here: dict[str, str] = {}
        """The execution of this replay that has an id in the record."""
        self._calls: dict[str, deque[RecordedExecution | None]] = {}
        self._running: dict[str, tuple[Execution, MockSkill]] = {}
        self._progress: dict[str, float] = {}
        self._passed: set[str] = set()
        serve_robot(self.world, self.mocks, skillsets, self._make_skill)

    def _make_skill(self, state: MockState, skillset: str, skill: Skill, rules: Sequence[Rule], chance: random.Random) -> MockSkill:
        return ReplayedSkill(self, state, skillset, skill, rules, chance)

    # --- requests ----------------------------------------------------------------------------------------------------

    def requested(self, skillset: str, skill: str, execution_id: str, then: RecordedDecision | None) -> None:
        """Take note of a request."""
        recorded = None if then is None else self._executions.get(then.id)
        if recorded is not None and not (recorded.state.terminal or recorded.state.active):
            recorded = None  # the record broke off before anything came of it
        if recorded is not None:
            self._recorded[execution_id] = recorded.id
            self._here[recorded.id] = execution_id
        self._calls.setdefault(f"{skillset}.{skill}", deque()).append(recorded)

    def next_execution(self, name: str) -> RecordedExecution | None:
        """Return the recorded outcome of the next call of a skill; None where a mock decides."""
        calls = self._calls.get(name)
        return calls.popleft() if calls else None

    def dispatched(self, execution: Execution, hooks: MockSkill) -> None:
        """Take note that a function was started."""
        recorded_id = self._recorded.get(execution.id)
        if recorded_id is not None:
            self._running[recorded_id] = execution, hooks
            if recorded_id in self._passed:  # it was answered before it was asked here
                self.world.clock.soon(lambda: self._end(recorded_id))

    def progress_of(self, execution_id: str) -> float | None:
        """Return the last recorded progress of an execution."""
        recorded_id = self._recorded.get(execution_id)
        return None if recorded_id is None else self._progress.get(recorded_id, 0.0)

    def stops_later(self, execution_id: str) -> bool:
        """Return whether the record has the interruption of an execution at a later moment."""
        recorded_id = self._recorded.get(execution_id)
        if recorded_id is None or recorded_id in self._passed:
            return False
        return self._executions[recorded_id].state is ExecutionState.INTERRUPTED

    def held(self, execution_id: str) -> bool:
        """Return whether an execution was paused in the record."""
        return self._recorded.get(execution_id) in self._held

    # --- what the record tells ---------------------------------------------------------------------------------------

    def report(self, recorded_id: str, progress: float, state: ExecutionState, outputs: Mapping[str, object]) -> None:
        """Report an execution to the tree as the record has it."""
        self._progress[recorded_id] = progress
        if state.terminal:
            self._passed.add(recorded_id)
            self._end(recorded_id)
            return
        handle = self.handles.get(self._here.get(recorded_id, ""))
        if handle is not None and state is ExecutionState.RUNNING and not handle.done:
            handle.run(progress, dict(outputs))

    def take(self, entry: Entry, *, diverged: bool) -> None:
        """Apply an entry of the record."""
        value = entry.value
        if entry.topic == EVENTS:
            self._take_event(event_of(entry), diverged=diverged)
        elif entry.topic == REPORTS:
            self.report(str(value["id"]), float(value.get("progress") or 0.0), ExecutionState(value["state"]), value.get("outputs") or {})
        elif entry.topic == DATA:
            self.sample(str(value["skillset"]), str(value["data"]), value["value"])

    def _take_event(self, event: EngineEvent, *, diverged: bool) -> None:
        if isinstance(event, TransitionEvent):
            if event.cause == EXTERN:
                self.transition(event, diverged=diverged)
        elif event.state.terminal and not self._reported:  # it does not say what the tree was told
            self.report(event.id, 1.0, event.state, event.outputs)

    def transition(self, event: TransitionEvent, *, diverged: bool) -> None:
        """Have a resource change as it did; after the decisions have diverged only where no other course of things explains it."""
        place = (event.skillset, event.resource)
        if diverged and place in self.caused and not self._explained(event.skillset):
            return
        self.mocks.take({place: event.to_state}, event.reason)

    def sample(self, skillset: str, data: str, value: object) -> None:
        """Have a data arrive, unless a fault that was not recorded makes it untrue."""
        if self.mocks.holds(skillset):
            self.host.mocked.add(skillset)
        self.host.publish_recorded(skillset, data, value)

    # --- inside ------------------------------------------------------------------------------------------------------

    def _explained(self, skillset: str) -> bool:
        """Return whether an execution of the skillset runs whose course is the recorded one."""
        return any(
            recorded.skillset == skillset and not execution.done
            for recorded_id, (execution, _) in self._running.items()
            if (recorded := self._executions[recorded_id]).state is ExecutionState.TERMINATED
        )

    def _end(self, recorded_id: str) -> None:
        """End an execution as the record has it; violations and refusals follow from the model by themselves."""
        recorded = self._executions[recorded_id]
        execution, hooks = self._running.get(recorded_id, (None, None))
        if execution is None or hooks is None or execution.done:
            return
        match recorded.state:
            case ExecutionState.TERMINATED:
                hooks.forget(execution.id)
                execution.terminate(recorded.result, recorded.message, recorded.outputs)
            case ExecutionState.INTERRUPTED:
                execution.interrupted(recorded.message)
            case ExecutionState.FAILED:
                execution.fail(recorded.message)
            case _:
                pass
