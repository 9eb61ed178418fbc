"""Explain why no step of the model has an event, and which events would have been allowed."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

from alula.model import semantics
from alula.model.conditions import NO_DATA, judge
from alula.model.execution_state import ExecutionState as S
from alula.model.model import Skillset
from alula.model.situation import Entered, Running
from alula.model.steps import PHASES, Cause
from alula.records.conformance.beliefs import Belief, agrees, told
from alula.records.conformance.possible import LoggedSteps, Possible
from alula.runtime.core.events import EngineEvent, ExecutionEvent, TransitionEvent

_SHOWN = 12
"""Steps that are named where many would have been allowed."""
_AT_ANY_TIME = frozenset({Cause.REJECT, Cause.INTERRUPT, Cause.FAIL})
"""What an execution may come to in every situation: named last, for it tells a reader least."""


def refusal(steps: LoggedSteps, beliefs: Sequence[Belief], ended: Mapping[str, str], event: EngineEvent) -> str:
    """Return why no belief allows an event; ``ended`` has the last state of the executions that have ended."""
    belief = beliefs[0]
    if belief.expected:
        return f"it comes within a step ({belief.stimulus}) that goes on with {told(belief.expected[0])}"
    if isinstance(event, TransitionEvent):
        reason = _refused_transition(steps.skillset, belief, event)
    else:
        reason = _refused_execution(steps.skillset, belief, ended, event)
    return reason or _out_of_step(steps, belief, event)


def _refused_transition(skillset: Skillset, belief: Belief, event: TransitionEvent) -> str:
    states = belief.situation.states
    if event.resource not in states:
        return f"skillset {skillset.name} has no resource {event.resource}; it has {', '.join(states)}"
    if event.from_state != states[event.resource]:
        return f"{event.resource} was {states[event.resource]}, not {event.from_state}"
    if event.cause == semantics.EXTERN:
        return semantics.extern_refusal(skillset, belief.situation, event.resource, event.to_state)
    if event.cause.startswith("event "):
        return semantics.event_refusal(skillset, belief.situation, event.cause.removeprefix("event "))
    skill, _, rest = event.cause.partition(" ")
    if Running(rest.partition(" ")[0], skill) not in belief.open:
        return f"its cause is no execution that is open: {event.cause}"
    return ""


def _refused_execution(skillset: Skillset, belief: Belief, ended: Mapping[str, str], event: ExecutionEvent) -> str:
    if event.skill not in skillset.skill_index:
        return f"skillset {skillset.name} has no skill {event.skill}; it has {', '.join(skillset.skill_index)}"
    same = belief.execution(event.id)
    if same is None:
        if event.state is S.REQUESTED:
            return ""
        return (
            f"execution {event.id} has ended before, {ended[event.id]}"
            if event.id in ended
            else f"execution {event.id} was never requested"
        )
    if same.skill != event.skill:
        return f"execution {event.id} is one of {same.skill}"
    return _refused_state(skillset, belief, same, event)


def _refused_state(skillset: Skillset, belief: Belief, execution: Running, event: ExecutionEvent) -> str:
    before, states = belief.open[execution], belief.situation.states
    if not event.state.terminal and event.state not in {S.RUNNING, *PHASES.get(before, ())}:
        return f"it was {before.value} before, from where it can't be {event.state.value}"
    if before is S.REQUESTED and event.state is S.RUNNING:
        unmet = [p.name for p in skillset.skill(event.skill).preconditions if judge(p.condition, states, NO_DATA) is False]
        return f"its precondition {unmet[0]} is false" if unmet else ""
    if event.state is S.TERMINATED:
        names = [result.name for result in skillset.skill(event.skill).results]
        return "" if event.result in names else f"{event.skill} has no result {event.result or '(none)'}; it has {', '.join(names)}"
    return ""


def _out_of_step(steps: LoggedSteps, belief: Belief, event: EngineEvent) -> str:
    """Return which event has to come first, where a step has this event further on; otherwise that no step has it."""
    for step in steps.of(belief, event):
        if any(agrees(event, happening) for happening in step.happenings[1:]):
            return f"in the step that this belongs to ({step.stimulus}), {told(step.happenings[0])} comes first"
    return "no step that the model allows in this situation has it"


def allowed(steps: LoggedSteps, beliefs: Sequence[Belief]) -> tuple[str, ...]:
    """Return what would have been allowed, as a reader of the log wants it: the next event of each step."""
    under_way = [told(belief.expected[0]) for belief in beliefs if belief.expected]
    if under_way:
        return tuple(dict.fromkeys(under_way))
    belief = beliefs[0]
    possible = sorted(steps.possible(belief), key=lambda step: step.stimulus.cause in _AT_ANY_TIME)
    found = list(dict.fromkeys(_beginning(step) for step in possible if step.happenings))
    more = [f"and {len(found) - _SHOWN} more"] if len(found) > _SHOWN else []
    return (*found[:_SHOWN], *more, "a request of any skill")


def _beginning(step: Possible) -> str:
    """Return the first event of a step, and its stimulus where the event does not show it."""
    first = step.happenings[0]
    says_it = isinstance(first, Entered) or step.stimulus.cause in {Cause.EXTERN, Cause.EVENT}
    return told(first) + ("" if says_it else f" ({step.stimulus})")
