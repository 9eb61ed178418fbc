"""What a step of a skillset is (paper, section 4.1.2 and Figure 5): pure functions from one situation to the next.

The engine takes its steps here and nowhere else, so a tool that explores all steps of a model explores what is executed.

The rules are in skillsets/LANGUAGE.md, under Meaning. Happenings of a step are in this order: the changes of the request's
effect, then the state that it puts its execution in; then, for each broken execution, the changes of the violation's effect
and the violated state. An execution is broken by the first false invariant in the order of the model.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import replace

from alula.model import deadlines
from alula.model.conditions import Data, States, data_of, holds, in_si, judge, present
from alula.model.effects import after, effect_changes, event_changes, given_back, without
from alula.model.errors import EffectError, UnsupportedModelError
from alula.model.execution_state import ExecutionState
from alula.model.expressions import Expression
from alula.model.model import Event, Skill, Skillset
from alula.model.propagation import propagate, violate
from alula.model.situation import Change, Entered, Running, Situation, Step
from alula.model.unmet import Unmet, unmet_condition, unmet_effect

__all__ = [
    "EXTERN",
    "Change",
    "Entered",
    "Running",
    "Situation",
    "Step",
    "check_supported",
    "elapse",
    "event",
    "event_refusal",
    "extern_refusal",
    "fail",
    "initial",
    "interrupt",
    "interrupting",
    "is_ready",
    "lose",
    "progressed",
    "receive",
    "start",
    "terminate",
    "transition",
    "unmet_preconditions",
]

EXTERN = "extern"


def check_supported(skillset: Skillset) -> None:
    """Refuse what the language has not: data in guards and postconditions, and units that are not known.

    Raises:
        UnsupportedModelError: names the place.
    """
    for skill in skillset.skills:
        kept = [condition for one in skill.invariants for condition in (one.condition, one.recovered)]
        for condition in (*(p.condition for p in skill.preconditions), *kept):
            for atom in data_of(condition):
                in_si(atom)
        pure = [(f"{skill.name}, postcondition of {r.name}", r.postcondition) for r in skill.results]
        _without_data([*pure, (f"{skill.name}, postcondition of the interruption", skill.interrupt.postcondition)])
    _without_data([(f"guard of event {event.name}", event.guard) for event in skillset.events])


def _without_data(conditions: Sequence[tuple[str, Expression]]) -> None:
    for place, condition in conditions:
        for atom in data_of(condition):
            raise UnsupportedModelError(f"{atom.span}: {place}: data {atom.data} can be tested in preconditions and invariants only")


def asked_data(skillset: Skillset) -> frozenset[str]:
    """Return the names of the data that conditions of the skillset ask for."""
    conditions = [p.condition for skill in skillset.skills for p in skill.preconditions]
    conditions += [condition for skill in skillset.skills for one in skill.invariants for condition in (one.condition, one.recovered)]
    return frozenset(atom.data for condition in conditions for atom in data_of(condition))


def initial(skillset: Skillset) -> Situation:
    """Return the situation at the start: every resource in its initial state, nothing running."""
    return Situation({resource.name: resource.initial for resource in skillset.resources})


# --- steps -----------------------------------------------------------------------------------------------------------


def start(skillset: Skillset, situation: Situation, execution: Running) -> Step:
    """Test preconditions and apply the start effect as one: the execution is RUNNING, or NOT_READY and nothing changed."""
    skill = skillset.skill(execution.skill)
    unmet = next(unmet_preconditions(skill, situation.states, situation.data), None)
    if unmet is not None:
        return Step(situation, (Entered(execution, ExecutionState.NOT_READY, unmet.name, unmet.reason, unmet=(unmet,)),))
    try:
        changes = effect_changes(skillset, execution, skill.start, "start", situation.states)
    except EffectError as error:
        unmet = unmet_effect(skill.start, str(error), situation.states)
        return Step(situation, (Entered(execution, ExecutionState.NOT_READY, "", unmet.reason, unmet=(unmet,)),))
    begun = replace(situation, states=after(situation.states, changes), running=(*situation.running, execution))
    return propagate(skillset, Step(progressed(skillset, begun, execution), (*changes, Entered(execution, ExecutionState.RUNNING))))


def extern_refusal(skillset: Skillset, situation: Situation, resource: str, target: str) -> str:
    """Return why the functional layer may not take this transition now, or "" when it may."""
    if resource not in situation.states:
        return f"skillset {skillset.name} has no resource {resource}; it has {', '.join(situation.states)}"
    machine, source = skillset.resource(resource), situation.states[resource]
    if target not in machine.states:
        return f"resource {resource} has no state {target}; it has {', '.join(machine.states)}"
    if machine.has_transition(source, target, extern=True):
        return ""
    if machine.has_transition(source, target, extern=False):
        return f"resource {resource}: {source} -> {target} is for skills only"
    return f"resource {resource} is {source} and has no extern transition {source} -> {target}"


def transition(skillset: Skillset, situation: Situation, resource: str, target: str, reason: str = "") -> Step:
    """Take an extern transition that ``extern_refusal`` does not refuse; ``reason``: why, in words."""
    change = Change(resource, situation.states[resource], target, EXTERN, reason)
    return propagate(skillset, Step(replace(situation, states=after(situation.states, (change,))), (change,)))


def event_refusal(skillset: Skillset, situation: Situation, name: str) -> str:
    """Return why this event of the model can't be taken now, or "" when it can."""
    found = _event(skillset, name)
    if found is None:
        return f"skillset {skillset.name} has no event {name}; it has {', '.join(one.name for one in skillset.events) or 'none'}"
    if not holds(found.guard, situation.states, situation.data):
        return f"event {name}: its guard is false: {present(found.guard, situation.states, situation.data) or 'it is never true'}"
    try:
        event_changes(skillset, found, situation.states)
    except EffectError as error:
        return str(error)
    return ""


def event(skillset: Skillset, situation: Situation, name: str) -> Step:
    """Take an event that ``event_refusal`` does not refuse."""
    found = _event(skillset, name)
    changes = event_changes(skillset, found, situation.states) if found is not None else ()
    return propagate(skillset, Step(replace(situation, states=after(situation.states, changes)), changes))


def receive(skillset: Skillset, situation: Situation, data: str, value: object | None) -> Step:
    """Take a fresh value of a data, or (None) the loss of it."""
    return propagate(skillset, Step(deadlines.with_value(skillset, situation, data, value)))


def elapse(skillset: Skillset, situation: Situation) -> Step:
    """Let the situation's time have come: what it has broken is ended."""
    return propagate(skillset, Step(situation))


def progressed(skillset: Skillset, situation: Situation, execution: Running) -> Situation:
    """Return the situation after an execution has made progress."""
    progress = skillset.skill(execution.skill).progress
    if progress is None or progress.deadline_s is None:
        return situation
    return replace(situation, progressed={**situation.progressed, execution.id: situation.now_ns})


def interrupting(situation: Situation, execution: Running) -> Situation:
    """Return the situation after an interruption was asked for: no progress is expected any more."""
    return replace(situation, progressed={name: at_ns for name, at_ns in situation.progressed.items() if name != execution.id})


def terminate(skillset: Skillset, situation: Situation, execution: Running, result_name: str, message: str = "") -> Step:
    """End a running execution with a result of the model, apply its effect and check its postcondition.

    A result that the skill has not, or whose effect is no transition now, ends it as FAILED (see ``fail``). A false
    postcondition does, too, but after the result's effect: the function has ended, only not as it says.
    """
    skill = skillset.skill(execution.skill)
    try:
        result = skill.result(result_name)
        changes = effect_changes(skillset, execution, result.effect, result.name, situation.states)
    except (KeyError, EffectError) as error:
        return fail(skillset, situation, execution, str(error.args[0]))
    states = after(situation.states, changes)
    ended = Entered(execution, ExecutionState.TERMINATED, result.name, message)
    entered = _if_fulfilled(ended, result.postcondition, f"{skill.name} {result.name}", replace(situation, states=states))
    return propagate(skillset, Step(without(situation, execution, states), (*changes, entered)))


def interrupt(skillset: Skillset, situation: Situation, execution: Running, message: str = "") -> Step:
    """End a running execution as INTERRUPTED with its interrupt effect; FAILED where ``terminate`` would be."""
    skill = skillset.skill(execution.skill)
    try:
        changes = effect_changes(skillset, execution, skill.interrupt.effect, "interrupt", situation.states)
    except EffectError as error:
        return fail(skillset, situation, execution, str(error))
    states = after(situation.states, changes)
    ended = Entered(execution, ExecutionState.INTERRUPTED, "", message)
    where = f"the interruption of {skill.name}"
    entered = _if_fulfilled(ended, skill.interrupt.postcondition, where, replace(situation, states=states))
    return propagate(skillset, Step(without(situation, execution, states), (*changes, entered)))


def fail(skillset: Skillset, situation: Situation, execution: Running, message: str) -> Step:
    """End a running execution as FAILED.

    Its interrupt effect is applied where it is a transition now, so that what the skill holds does not stay taken;
    otherwise nothing changes.
    """
    changes = given_back(skillset, execution, situation.states)
    entered = Entered(execution, ExecutionState.FAILED, "", message)
    return propagate(skillset, Step(without(situation, execution, after(situation.states, changes)), (*changes, entered)))


def lose(skillset: Skillset, situation: Situation, execution: Running, invariant_name: str) -> Step:
    """Have data or time break an invariant of one running execution: what ``receive`` and ``elapse`` do, value and time aside."""
    invariant = next(one for one in skillset.skill(execution.skill).invariants if one.name == invariant_name)
    unmet = unmet_condition(invariant_name, invariant.condition, situation.states, situation.data)
    return propagate(skillset, violate(skillset, Step(situation), execution, invariant, unmet, invariant_name))


# --- parts -----------------------------------------------------------------------------------------------------------


def unmet_preconditions(skill: Skill, states: States, data: Data) -> Iterator[Unmet]:
    """Yield the preconditions that do not hold, in the model's order; a start is refused by the first."""
    for precondition in skill.preconditions:
        if judge(precondition.condition, states, data) is not True:
            yield unmet_condition(precondition.name, precondition.condition, states, data)


def is_ready(skill: Skill, states: States, data: Data) -> bool:
    """Return whether all preconditions hold; ``unmet_preconditions`` says which do not, and why, which takes longer."""
    return all(judge(one.condition, states, data) is True for one in skill.preconditions)


def _if_fulfilled(ended: Entered, postcondition: Expression, where: str, after_effect: Situation) -> Entered:
    """Return the end as it is, or as FAILED where its postcondition is false after the effect."""
    states, data = after_effect.states, after_effect.data
    if judge(postcondition, states, data) is True:
        return ended
    return Entered(ended.execution, ExecutionState.FAILED, "", f"postcondition of {where} is false: {present(postcondition, states, data)}")


def _event(skillset: Skillset, name: str) -> Event | None:
    return next((one for one in skillset.events if one.name == name), None)
