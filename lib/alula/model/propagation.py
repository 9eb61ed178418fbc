"""Invariant propagation: what a step breaks, until nothing more is broken (skillsets/LANGUAGE.md, Meaning, has the order)."""

from __future__ import annotations

from dataclasses import replace

from alula.model.conditions import NO_DATA, States, judge
from alula.model.deadlines import good, is_due, is_stuck, waits, watch
from alula.model.effects import after, effect_changes, given_back, without
from alula.model.errors import EffectError
from alula.model.execution_state import ExecutionState
from alula.model.model import Invariant, Skill, Skillset
from alula.model.situation import Change, Entered, Running, Situation, Step
from alula.model.unmet import Unmet, unmet_condition


def propagate(skillset: Skillset, step: Step) -> Step:
    """End every running execution whose invariant is broken, with its effect, and every one that is stuck, until none is left."""
    before = step.situation
    while True:
        step, undecided = _propagate_resources(skillset, step)
        if not (undecided or before.false_since or before.progressed):
            return step
        step = replace(step, situation=watch(skillset, step.situation, before))
        ended = _first_due(skillset, step)
        if ended is None:
            return step
        step = ended


def violate(skillset: Skillset, step: Step, execution: Running, invariant: Invariant, unmet: Unmet, message: str) -> Step:
    """End one execution by its broken invariant; an effect that is no transition is told in the message and not applied."""
    states, effect_failed = step.situation.states, False
    try:
        changes = effect_changes(skillset, execution, invariant.effect, invariant.name, states)
    except EffectError as error:
        changes, message, effect_failed = (), f"{message}; {error}", True
    entered = Entered(execution, ExecutionState.RESOURCE_INVARIANT_VIOLATED, invariant.name, message, effect_failed, (unmet,))
    return step.then(*changes, entered, situation=without(step.situation, execution, after(states, changes)))


def false_invariant(skill: Skill, states: States) -> tuple[Invariant | None, bool]:
    """Return the first invariant that resources alone make false at once, in the model's order, and whether data or time decide others."""
    undecided = False
    for invariant in skill.invariants:
        if waits(invariant):
            undecided = True
            continue
        answer = judge(invariant.condition, states, NO_DATA)
        if answer is False:
            return invariant, True
        undecided = undecided or answer is None
    return None, undecided


# --- what resources decide --------------------------------------------------------------------------------------------


def _propagate_resources(skillset: Skillset, step: Step) -> tuple[Step, bool]:
    """End what resources alone have broken; tell whether data or time decide anything of what runs on."""
    found: dict[Running, tuple[Invariant, Unmet, str]] = {}
    while True:
        undecided = False
        for execution in step.situation.running:
            if execution not in found:
                invariant, asks_more = false_invariant(skillset.skill(execution.skill), step.situation.states)
                undecided = undecided or asks_more
                if invariant is not None:
                    found[execution] = (invariant, *_because(step, invariant))
        if not found:
            return step, undecided
        execution = next(iter(found))
        step = violate(skillset, step, execution, *found.pop(execution))


def _because(step: Step, invariant: Invariant) -> tuple[Unmet, str]:
    """Return what is not as the invariant says, and the message: that, for how long it was so, and after which change."""
    unmet = unmet_condition(invariant.name, invariant.condition, step.situation.states, step.situation.data)
    message = unmet.reason
    if invariant.hold is not None and invariant.hold.for_s > 0:
        message += f" for {invariant.hold.for_s:g} s"
    causes = [happening for happening in step.happenings if isinstance(happening, Change)]
    if causes:
        message += f", after {causes[-1].sentence()}"
    return unmet, message


# --- what data and time decide ----------------------------------------------------------------------------------------


def _first_due(skillset: Skillset, step: Step) -> Step | None:
    """End the first execution that data or time have broken; None when there is none."""
    situation = step.situation
    for execution in situation.running:
        skill = skillset.skill(execution.skill)
        for invariant in skill.invariants:
            if not good(skill, invariant, situation) and is_due(execution, invariant, situation):
                return violate(skillset, step, execution, invariant, *_because(step, invariant))
        if is_stuck(skill, execution, situation):
            return _give_up(skillset, step, skill, execution)
    return None


def _give_up(skillset: Skillset, step: Step, skill: Skill, execution: Running) -> Step:
    """End an execution that makes no progress as FAILED."""
    deadline_s = skill.progress.deadline_s if skill.progress is not None else None
    changes = given_back(skillset, execution, step.situation.states)
    entered = Entered(execution, ExecutionState.FAILED, "", f"no progress for {deadline_s:g} s")
    return step.then(*changes, entered, situation=_left(step.situation, execution, changes))


def _left(situation: Situation, execution: Running, changes: tuple[Change, ...]) -> Situation:
    return without(situation, execution, after(situation.states, changes))
