"""Represent what an event log allows to be the case in a skillset, with the rest of the step that is under way."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field

from alula.model.execution_state import ExecutionState
from alula.model.situation import Change, Entered, Running, Situation
from alula.model.steps import Stimulus
from alula.runtime.core.events import EngineEvent, TransitionEvent

Happening = Change | Entered


@dataclass(frozen=True)
class Belief:
    """A situation that explains all events so far, and what has to follow in the same step.

    ``situation`` is that after the step. ``open`` has the state of each execution that has not ended, requested ones too.
    ``since_ns`` has, for each invariant that may be false for a while, the earliest time from which it can have been false.
    ``earliest_ns`` is when the step was taken at the earliest, ``stimulus`` says what has asked for it.
    """

    situation: Situation
    open: Mapping[Running, ExecutionState] = field(default_factory=dict)
    since_ns: Mapping[tuple[Running, str], int] = field(default_factory=dict)
    expected: tuple[Happening, ...] = ()
    earliest_ns: int = 0
    stimulus: Stimulus | None = None

    def same_future(self, other: Belief) -> bool:
        """Return whether both allow the same events from now on."""
        mine, theirs = self.situation, other.situation
        same = mine.states == theirs.states and mine.running == theirs.running and self.open == other.open
        return same and self.since_ns == other.since_ns and self.expected == other.expected

    def execution(self, execution_id: str) -> Running | None:
        """Return the open execution of an id."""
        return next((one for one in self.open if one.id == execution_id), None)


def after_happening(states: Mapping[Running, ExecutionState], happening: Happening) -> Mapping[Running, ExecutionState]:
    """Return the states of the open executions after a happening."""
    if isinstance(happening, Change):
        return states
    kept = {execution: state for execution, state in states.items() if execution != happening.execution}
    return kept if happening.state.terminal else {**kept, happening.execution: happening.state}


def agrees(event: EngineEvent, happening: Happening) -> bool:
    """Return whether an event records this happening; texts for people are not compared."""
    if isinstance(event, TransitionEvent):
        return happening == Change(event.resource, event.from_state, event.to_state, event.cause)
    return isinstance(happening, Entered) and _key(happening) == (Running(event.id, event.skill), event.state, event.result)


def _key(entered: Entered) -> tuple[Running, ExecutionState, str]:
    return entered.execution, entered.state, entered.result


def told(happening: Happening) -> str:
    """Format a happening as an event."""
    if isinstance(happening, Change):
        return f"{happening.resource} {happening.source} -> {happening.target} ({happening.cause})"
    return f"{happening.execution.skill} {happening.execution.id} {happening.state.value} {happening.result}".rstrip()


def event_told(event: EngineEvent) -> str:
    """Format an event of the log."""
    if isinstance(event, TransitionEvent):
        return told(Change(event.resource, event.from_state, event.to_state, event.cause))
    return told(Entered(Running(event.id, event.skill), event.state, event.result))
