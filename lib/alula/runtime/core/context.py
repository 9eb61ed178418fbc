"""The context of a skillset's executions: its situation, its resources, its executions; every change comes out as an event.

Not safe for threads: the engine calls it with its lock held.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, field, replace

from alula.model import semantics
from alula.model.deadlines import due_ns
from alula.model.execution_state import ExecutionState
from alula.model.model import Skillset
from alula.model.situation import Change, Entered, Running, Situation, Step
from alula.model.unmet import Unmet
from alula.runtime.core.events import EngineEvent, ExecutionEvent, TransitionEvent
from alula.runtime.core.execution import Execution
from alula.runtime.core.records import Records, ResourceStatus


@dataclass(eq=False)
class Entry:
    """An execution that has not ended, or one of whose hooks that no stop overtakes has not returned."""

    execution: Execution
    key: Running
    dispatching: bool = False
    """Whether ``on_dispatch``, ``on_pause`` or ``on_resume`` is being called."""
    asking: bool = False
    """Whether ``progress`` is being called."""
    stop_hook: str = ""
    """The one hook that stops the function, once it is decided on; called at once, or after the hook that is being called."""
    stop_due_ns: int = 0
    """When an interruption that is under way is too late, mission clock."""
    waiting: list[Callable[[], None]] = field(default_factory=list)
    """Pauses and resumptions that were asked for while a hook was being called; they come after it, and after a stop."""

    @property
    def may_be_asked(self) -> bool:
        """Return whether ``progress`` may be called: it runs, no hook is being called, and none is to stop the function."""
        return self.execution.state is ExecutionState.RUNNING and not (self.asking or self.dispatching or self.stop_hook)


class SkillsetContext:
    """Records steps; ``publish`` gets the events of each, numbered from 1 without gaps, with the ``instance_id`` of the managers."""

    def __init__(
        self, skillset: Skillset, clock_ns: Callable[[], int], publish: Callable[[Sequence[EngineEvent]], None], instance_id: str = ""
    ) -> None:
        self._skillset = skillset
        self._instance_id = instance_id
        self._clock_ns = clock_ns
        self._publish_events = publish
        self._situation = semantics.initial(skillset)
        created_ns = clock_ns()
        self.resources = {name: ResourceStatus(state, "", created_ns) for name, state in self._situation.states.items()}
        self.records = Records(skillset)
        self.entries: dict[str, Entry] = {}
        self.sequence = 0

    # --- the present ------------------------------------------------------------------------------------------------

    @property
    def situation(self) -> Situation:
        """Return states, data and executions, at the present mission time."""
        now_ns = self._clock_ns()
        if now_ns != self._situation.now_ns:
            self._situation = replace(self._situation, now_ns=now_ns)
        return self._situation

    @property
    def elapsed(self) -> bool:
        """Return whether time alone has broken something."""
        due = due_ns(self._skillset, self._situation)
        return due is not None and self._clock_ns() >= due

    @property
    def due_ns(self) -> int | None:
        """Return when time alone next changes something: an invariant, a progress deadline, a stop that is too late."""
        stops = [entry.stop_due_ns for entry in self.entries.values() if entry.stop_due_ns and not entry.execution.done]
        breaks = due_ns(self._skillset, self._situation)
        return min(stops if breaks is None else [*stops, breaks], default=None)

    def open(self, execution_id: str) -> Entry | None:
        """Return the entry of an execution that has not ended."""
        entry = self.entries.get(execution_id)
        return None if entry is None or entry.execution.done else entry

    def active(self, execution_id: str) -> Entry | None:
        """Return the entry of an execution that has started and not ended."""
        entry = self.entries.get(execution_id)
        return entry if entry is not None and entry.execution.state.active else None

    # --- changes ---------------------------------------------------------------------------------------------------------

    def add(self, execution: Execution) -> Entry:
        """Add an execution that was requested, and publish its first event."""
        entry = self.entries[execution.id] = Entry(execution, Running(execution.id, execution.skill))
        self._publish([self._entered(execution)])
        return entry

    def end_request(self, entry: Entry, state: ExecutionState, message: str) -> None:
        """End an execution that never started."""
        _set_state(entry.execution, Entered(entry.key, state, "", message))
        self._publish([self._entered(entry.execution)])
        self.forget_if_through(entry)

    def enter_phase(self, entry: Entry, phase: ExecutionState) -> None:
        """Record that an execution runs on in another phase; only one that is RUNNING is expected to make progress."""
        if phase is ExecutionState.RUNNING:
            self.progressed(entry)
        else:
            self._situation = semantics.interrupting(self._situation, entry.key)
        entry.execution.state = phase
        self._publish([self._entered(entry.execution)])

    def progressed(self, entry: Entry) -> None:
        """Record that a running execution has made progress now."""
        self._situation = semantics.progressed(self._skillset, self.situation, entry.key)

    def commit(self, step: Step, *, by_itself: Entry | None = None) -> list[Entry]:
        """Apply a step; return the executions whose function is to be stopped now, but not that of ``by_itself``."""
        self._situation = step.situation
        events: list[EngineEvent] = []
        ended: list[Entry] = []
        for happening in step.happenings:
            if isinstance(happening, Change):
                events.append(self._changed(happening))
                continue
            entry = self.entries[happening.execution.id]
            _set_state(entry.execution, self._with_cause(happening))
            events.append(self._entered(entry.execution))
            if entry.execution.done:
                ended.append(entry)
        self._publish(events)
        for entry in ended:
            self.forget_if_through(entry)
        return [entry for entry in ended if entry is not by_itself and _stop_now(entry)]

    def forget_if_through(self, entry: Entry) -> None:
        """Drop an execution that has ended and whose hooks have returned."""
        if entry.execution.done and not entry.dispatching:
            self.entries.pop(entry.key.id, None)

    # --- events ----------------------------------------------------------------------------------------------------------

    def _publish(self, events: Sequence[EngineEvent]) -> None:
        self.records.on_events(events)
        self._publish_events(events)

    def note(self, resource: str, state: str, reason: str) -> None:
        """Take another reason for the state that a resource is in."""
        status = self.resources[resource]
        if status.state == state:
            self.resources[resource] = replace(status, reason=reason)

    def _changed(self, change: Change) -> TransitionEvent:
        self.sequence += 1
        now_ns = self._clock_ns()
        self.resources[change.resource] = ResourceStatus(change.target, change.source, now_ns, change.reason)
        states = (change.resource, change.source, change.target)
        return TransitionEvent(self.sequence, now_ns, *states, change.cause, self._skillset.name, change.reason, self._instance_id)

    def _with_cause(self, entered: Entered) -> Entered:
        """Have a refusal say which change that was explained came last of what it asks for; an end by an invariant says it already."""
        if entered.state is not ExecutionState.NOT_READY:
            return entered
        return replace(entered, message=entered.message + self.cause_of(entered.unmet))

    def cause_of(self, unmet: Sequence[Unmet]) -> str:
        """Return which change that was explained came last of what is asked for, to be put behind a sentence; "" where none was."""
        told = [(name, self.resources[name]) for one in unmet for name in one.states if self.resources[name].reason]
        if not told:
            return ""
        name, last = max(told, key=lambda one: one[1].stamp_ns)
        if not last.previous:  # it has been so from the start
            return f": {name}: {last.reason}"
        return f", after {Change(name, last.previous, last.state, semantics.EXTERN, last.reason).sentence()}"

    def _entered(self, execution: Execution) -> ExecutionEvent:
        self.sequence += 1
        terminated = execution.state is ExecutionState.TERMINATED
        return ExecutionEvent(
            sequence=self.sequence,
            stamp_ns=self._clock_ns(),
            skill=execution.skill,
            id=execution.id,
            state=execution.state,
            result=execution.result,
            message=execution.message,
            inputs=execution.inputs,
            outputs=dict(execution.outputs),
            skillset=self._skillset.name,
            result_kind=self._skillset.skill(execution.skill).kind_of(execution.result) if terminated else None,
            unmet=execution.unmet,
            instance_id=self._instance_id,
        )


def _set_state(execution: Execution, entered: Entered) -> None:
    """Write the state last: a reader that sees the end of the execution sees its reason."""
    execution.result = entered.result
    execution.message = entered.message
    execution.unmet = entered.unmet
    execution.state = entered.state


def _stop_now(entry: Entry) -> bool:
    """Decide on the stop hook of an execution that was ended, unless one is; tell whether it may be called at once."""
    if entry.stop_hook:
        return False
    entry.stop_hook = "on_failure" if entry.execution.state is ExecutionState.FAILED else "on_violation"
    return not entry.dispatching
