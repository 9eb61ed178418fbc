"""What a step of a skillset is (paper, section 4.1.2 and Figure 5): pure functions from one situation to the next.

The engine takes its steps here and nowhere else, so whoever explores all steps of a model explores what is executed.

A step is atomic: what asks for it, its resource changes, and every invariant that these break, with the effects of those
and what they break in turn, until nothing more is broken. Happenings of a step are in this order: the changes of the
request's effect, then the state that it puts its execution in; then, for each broken execution, the changes of the
violation's effect and the violated state. Executions break in the order in which they were found broken; those found
after the same change in the order of their start, each by the first false invariant of the model. An execution once found
broken ends so, even if the effect of another would have mended its invariant: it was false.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace

from skill_language.model import Effect, Invariant, Skill, Skillset
from skill_runtime.core.conditions import Data, States, data_of, holds, in_si, present
from skill_runtime.core.errors import DataMissingError, EffectError, UnsupportedModelError
from skill_runtime.core.execution import ExecutionState

EXTERN = "extern"
NO_DATA: Data = {}


@dataclass(frozen=True)
class Running:
    """A running execution."""

    id: str
    skill: str


@dataclass(frozen=True)
class Situation:
    """All that the next step depends on; ``running`` is in the order of the start."""

    states: States
    running: tuple[Running, ...] = ()


@dataclass(frozen=True)
class Change:
    """A resource went from one state to another."""

    resource: str
    source: str
    target: str
    cause: str


@dataclass(frozen=True)
class Entered:
    """An execution entered a state; ``result`` as in ``Execution``."""

    execution: Running
    state: ExecutionState
    result: str = ""
    message: str = ""


@dataclass(frozen=True)
class Step:
    """The situation after a step and what happened in it."""

    situation: Situation
    happenings: tuple[Change | Entered, ...] = ()

    def then(self, *happenings: Change | Entered, situation: Situation) -> Step:
        """Continue within the same step."""
        return Step(situation, self.happenings + happenings)


def check_supported(skillset: Skillset) -> None:
    """Refuse what can't be executed: invariants and postconditions over data, durations, deadlines, unknown units.

    Raises:
        UnsupportedModelError: names the place.
    """
    for skill in skillset.skills:
        for precondition in skill.preconditions:
            for atom in data_of(precondition.condition):
                in_si(atom)
        for invariant in skill.invariants:
            if invariant.hold is not None:
                raise UnsupportedModelError(
                    f"{invariant.span}: {skill.name}, invariant {invariant.name}: durations are proved, not yet executed"
                )
        if skill.progress is not None and skill.progress.deadline_s is not None:
            raise UnsupportedModelError(f"{skill.progress.span}: {skill.name}: a progress deadline is proved, not yet executed")
        pure = [(f"invariant {i.name}", i.condition) for i in skill.invariants]
        pure += [(f"postcondition of {r.name}", r.postcondition) for r in skill.results]
        pure += [("postcondition of the interruption", skill.interrupt.postcondition)]
        for place, condition in pure:
            for atom in data_of(condition):
                raise UnsupportedModelError(f"{atom.span}: {skill.name}, {place}: data {atom.data} can be tested in preconditions only")


def initial(skillset: Skillset) -> Situation:
    """Return the situation at the start: every resource in its initial state, nothing running."""
    return Situation({resource.name: resource.initial for resource in skillset.resources})


# --- steps -----------------------------------------------------------------------------------------------------------


def start(skillset: Skillset, situation: Situation, execution: Running, data: Data = NO_DATA) -> Step:
    """Test preconditions and apply the start effect as one: the execution is RUNNING, or NOT_READY and nothing changed."""
    skill = skillset.skill(execution.skill)
    refusal = unmet_precondition(skill, situation.states, data)
    if refusal is not None:
        return Step(situation, (Entered(execution, ExecutionState.NOT_READY, *refusal),))
    try:
        changes = effect_changes(skillset, execution, skill.start, "start", situation.states)
    except EffectError as error:
        return Step(situation, (Entered(execution, ExecutionState.NOT_READY, "", str(error)),))
    begun = Situation(_after(situation.states, changes), (*situation.running, execution))
    return settle(skillset, Step(begun, (*changes, Entered(execution, ExecutionState.RUNNING))))


def extern_refusal(skillset: Skillset, situation: Situation, resource: str, target: str) -> str:
    """Return why the functional layer may not take this transition now, or "" when it may."""
    if resource not in situation.states:
        return f"skillset {skillset.name} has no resource {resource}; it has {', '.join(situation.states)}"
    machine, source = skillset.resource(resource), situation.states[resource]
    if target not in machine.states:
        return f"resource {resource} has no state {target}; it has {', '.join(machine.states)}"
    if machine.has_arrow(source, target, extern=True):
        return ""
    if machine.has_arrow(source, target, extern=False):
        return f"resource {resource}: {source} -> {target} is for skills only"
    return f"resource {resource} is {source} and has no extern transition {source} -> {target}"


def transition(skillset: Skillset, situation: Situation, resource: str, target: str) -> Step:
    """Take an extern transition that ``extern_refusal`` does not refuse."""
    change = Change(resource, situation.states[resource], target, EXTERN)
    return settle(skillset, Step(replace(situation, states=_after(situation.states, (change,))), (change,)))


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
    states = _after(situation.states, changes)
    if holds(result.postcondition, states, NO_DATA):
        entered = Entered(execution, ExecutionState.TERMINATED, result.name, message)
    else:
        reason = f"postcondition of {skill.name} {result.name} is false: {present(result.postcondition, states)}"
        entered = Entered(execution, ExecutionState.FAILED, "", reason)
    return settle(skillset, Step(_without(situation, execution, states), (*changes, entered)))


def interrupt(skillset: Skillset, situation: Situation, execution: Running, message: str = "") -> Step:
    """End a running execution as INTERRUPTED with its interrupt effect; FAILED where ``terminate`` would be."""
    skill = skillset.skill(execution.skill)
    try:
        changes = effect_changes(skillset, execution, skill.interrupt.effect, "interrupt", situation.states)
    except EffectError as error:
        return fail(skillset, situation, execution, str(error))
    states = _after(situation.states, changes)
    if holds(skill.interrupt.postcondition, states, NO_DATA):
        entered = Entered(execution, ExecutionState.INTERRUPTED, "", message)
    else:
        reason = f"postcondition of the interruption of {skill.name} is false: {present(skill.interrupt.postcondition, states)}"
        entered = Entered(execution, ExecutionState.FAILED, "", reason)
    return settle(skillset, Step(_without(situation, execution, states), (*changes, entered)))


def fail(skillset: Skillset, situation: Situation, execution: Running, message: str) -> Step:
    """End a running execution as FAILED.

    Its interrupt effect is applied where it is a transition now, so that what the skill holds does not stay taken;
    otherwise nothing changes.
    """
    skill = skillset.skill(execution.skill)
    try:
        changes = effect_changes(skillset, execution, skill.interrupt.effect, "failure", situation.states)
    except EffectError:
        changes = ()
    states = _after(situation.states, changes)
    entered = Entered(execution, ExecutionState.FAILED, "", message)
    return settle(skillset, Step(_without(situation, execution, states), (*changes, entered)))


def settle(skillset: Skillset, step: Step) -> Step:
    """End every running execution whose invariant is false, with its effect, until none is left."""
    found: dict[Running, Entered] = {}
    while True:
        for execution in step.situation.running:
            if execution not in found:
                found.update(_broken(skillset, step, execution))
        if not found:
            return step
        execution = next(iter(found))
        step = _violate(skillset, step, found.pop(execution))


def _broken(skillset: Skillset, step: Step, execution: Running) -> dict[Running, Entered]:
    """Return how a running execution ends by its first false invariant, or nothing when all are true."""
    states = step.situation.states
    invariant = false_invariant(skillset.skill(execution.skill), states)
    if invariant is None:
        return {}
    message = f"{invariant.name}: {present(invariant.condition, states)}"
    causes = [happening for happening in step.happenings if isinstance(happening, Change)]
    if causes:
        last = causes[-1]
        message += f", after {last.resource} {last.source} -> {last.target} ({last.cause})"
    return {execution: Entered(execution, ExecutionState.RESOURCE_INVARIANT_VIOLATED, invariant.name, message)}


def _violate(skillset: Skillset, step: Step, entered: Entered) -> Step:
    """End one execution by its broken invariant; an effect that is no transition is told in the message and not applied."""
    states, execution = step.situation.states, entered.execution
    invariant = next(i for i in skillset.skill(execution.skill).invariants if i.name == entered.result)
    try:
        changes = effect_changes(skillset, execution, invariant.effect, invariant.name, states)
    except EffectError as error:
        changes, entered = (), replace(entered, message=f"{entered.message}; {error}")
    return step.then(*changes, entered, situation=_without(step.situation, execution, _after(states, changes)))


# --- parts -----------------------------------------------------------------------------------------------------------


def unmet_precondition(skill: Skill, states: States, data: Data) -> tuple[str, str] | None:
    """Return name and reason of the first precondition that does not hold, in the model's order."""
    for precondition in skill.preconditions:
        try:
            if holds(precondition.condition, states, data):
                continue
            reason = present(precondition.condition, states) or "the data does not meet it"
        except DataMissingError as error:
            reason = str(error)
        return precondition.name, f"{precondition.name}: {reason}"
    return None


def false_invariant(skill: Skill, states: States) -> Invariant | None:
    """Return the first invariant of the skill that is false, in the model's order."""
    return next((invariant for invariant in skill.invariants if not holds(invariant.condition, states, NO_DATA)), None)


def effect_changes(skillset: Skillset, execution: Running, effect: Effect, place: str, states: States) -> tuple[Change, ...]:
    """Return what an effect changes from these states; ``place`` names it where the model does not.

    Every assignment must be an arrow for skills from the resource's present state, also one to the state that it is in:
    who releases what nobody holds has lost count.

    Raises:
        EffectError: one is not; then none may be applied.
    """
    name = effect.name or place
    changes: dict[str, Change] = {}
    for assignment in effect.assignments:
        resource, source, target = skillset.resource(assignment.resource), states[assignment.resource], assignment.target
        if resource.name in changes:
            raise EffectError(f"skill {execution.skill}, effect {name}: resource {resource.name} is assigned twice")
        if not resource.has_arrow(source, target, extern=False):
            raise EffectError(
                f"skill {execution.skill}, effect {name}: resource {resource.name} is {source}"
                f" and has no transition {source} -> {target} for skills"
            )
        changes[resource.name] = Change(resource.name, source, target, f"{execution.skill} {execution.id} {name}")
    return tuple(changes.values())


def _after(states: States, changes: tuple[Change, ...]) -> Mapping[str, str]:
    return {**states, **{change.resource: change.target for change in changes}} if changes else states


def _without(situation: Situation, execution: Running, states: States) -> Situation:
    return Situation(states, tuple(other for other in situation.running if other != execution))
